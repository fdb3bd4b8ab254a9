#include "lod/cut.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"

namespace stipple::lod {
namespace {

constexpr int32_t kCulled = std::numeric_limits<int32_t>::min();
constexpr int32_t kInside = -1'000'000;  // the eye is inside the sphere: only exact records are fine enough
constexpr int kStepsPerOctave = 32;      // resolution of tau; error codes have 8
constexpr int kLargestTauStep = 40 * kStepsPerOctave;

/// A view in the lattice space of one instance.
struct LocalView {
    glm::dvec3 eye, forward;
    std::array<glm::dvec3, 4> planes;  ///< inward normals of the frustum's sides, through the eye
    double nearPlane = 0, focal = 0, cosineCorner = 0;
};

LocalView makeLocalView(const Hierarchy& h, const Instance& instance, const View& view) {
    LocalView local;
    const glm::dmat3 inverse = glm::transpose(instance.rotation);
    const double unitsPerStep = instance.scale * h.unit;
    local.eye = (inverse * (view.eye - instance.translation) / instance.scale - h.origin) / h.unit;
    local.forward = inverse * view.forward;
    const glm::dvec3 right = inverse * view.right, down = inverse * view.down;
    const double halfW = 0.5 * view.width, halfH = 0.5 * view.height, f = view.focalPixels;
    local.planes = {
        glm::normalize(right * f + local.forward * halfW), glm::normalize(-right * f + local.forward * halfW),
        glm::normalize(down * f + local.forward * halfH), glm::normalize(-down * f + local.forward * halfH)};
    local.nearPlane = view.nearPlane / unitsPerStep;
    local.focal = f;
    local.cosineCorner = f / std::sqrt(f * f + halfW * halfW + halfH * halfH);
    return local;
}

/// Allowed error of N at tau = 1 px as a code of 1/32 octave, rounded down; kCulled if N is out of view.
int32_t allowedError(const Hierarchy& h, const Node& node, const LocalView& view) {
    const glm::dvec3 d = node.centre - view.eye;
    const double r = node.radius;
    const double depth = glm::dot(d, view.forward);
    if (depth + r < view.nearPlane) return kCulled;
    for (const glm::dvec3& plane : view.planes)
        if (glm::dot(d, plane) < -r) return kCulled;
    const double distance = glm::length(d);
    const double nearest = distance - r;
    if (!(nearest > 0)) return kInside;
    // cos(alpha + beta), alpha: axis to centre, beta: angular radius.
    const double cosAlpha = depth / distance, sinAlpha = std::sqrt(std::max(0.0, 1 - cosAlpha * cosAlpha));
    const double sinBeta = r / distance, cosBeta = std::sqrt(std::max(0.0, 1 - sinBeta * sinBeta));
    const double cosine = std::max(cosAlpha * cosBeta - sinAlpha * sinBeta, view.cosineCorner);
    const double allowed = nearest * cosine * cosine / view.focal;
    const double code = std::floor(kStepsPerOctave * std::log2(allowed / h.errors.smallest));
    return static_cast<int32_t>(std::clamp(code, -900'000.0, 900'000.0));
}

/// Allowed error code of a node at tau = 2^(step/32).
uint32_t codeAt(int32_t epsilon, int step) {
    const int32_t sum = epsilon + step;
    if (sum < 0) return 0;
    return std::min<uint32_t>(static_cast<uint32_t>(sum) / (kStepsPerOctave / 8), ErrorScale::kLargest);
}

class Selector {
  public:
    Selector(std::span<const Hierarchy* const> hierarchies, std::span<const Instance> instances,
             const Residency& residency, const View& view, const Budgets& budgets, CutScratch& scratch, Cut& cut)
        : hierarchies_(hierarchies),
          instances_(instances),
          residency_(residency),
          view_(view),
          budgets_(budgets),
          scratch_(scratch),
          cut_(cut) {
        ++scratch_.frame;
        scratch_.epsilon.resize(instances.size());
        scratch_.stamp.resize(instances.size());
        for (size_t i = 0; i < instances.size(); ++i) {
            const size_t count = hierarchyOf(i).nodes.size();
            if (scratch_.stamp[i].size() == count) continue;
            scratch_.epsilon[i].assign(count, 0);
            scratch_.stamp[i].assign(count, 0);
        }
    }

    void run() {
        cut_.draw.clear();
        cut_.meshDraw.clear();
        cut_.wanted.clear();
        cut_.keep.clear();
        cut_.counters = {};
        cut_.truncated = false;
        const double tau = std::max(budgets_.errorPixels, 1e-6);
        const int target = static_cast<int>(std::floor(kStepsPerOctave * std::log2(tau)));
        int step = stepForBudget(target);
        cut_.tauTarget = step == target ? tau : std::exp2(static_cast<double>(step) / kStepsPerOctave);
        // Missing chunks put parents in the place of children. That draws fewer records, except where children are
        // partly out of view, so the sum is checked and the step raised in the rare case.
        for (;; ++step) {
            cut_.draw.clear();
            cut_.wanted.clear();
            cut_.keep.clear();
            cut_.meshDraw.clear();
            cut_.counters.recordsDrawn = cut_.counters.recordsTested = cut_.counters.nodesVisited = 0;
            cut_.counters.trianglesDrawn = cut_.counters.standIns = 0;
            cut_.counters.nodesCulled = cut_.counters.nodesMissing = cut_.counters.nodesDrawn = 0;
            cut_.tauEffective = 0;
            for (size_t i = 0; i < instances_.size(); ++i) {
                if (instances_[i].isStandIn || hierarchyOf(i).nodes.empty()) continue;
                if (usesStandIn(i, step) && hasRoot(instances_[i].standIn)) {
                    ++cut_.counters.standIns;
                    emit(instances_[i].standIn, step - kStepsPerOctave);
                } else {
                    emit(i, step);
                }
            }
            if (cut_.counters.recordsDrawn + cut_.counters.trianglesDrawn <= budgets_.records ||
                step >= kLargestTauStep)
                break;
        }
        cut_.tauEffective =
            std::max(cut_.tauEffective, step == target ? tau : std::exp2(double(step) / kStepsPerOctave));
        if (cut_.counters.recordsDrawn + cut_.counters.trianglesDrawn > budgets_.records) truncate();
        cut_.counters.nodesDrawn += cut_.draw.size();
    }

  private:
    const Hierarchy& hierarchyOf(size_t i) const { return *hierarchies_[instances_[i].hierarchy]; }

    int32_t epsilonOf(size_t i, const LocalView& local, uint32_t index, int32_t parentEpsilon) {
        if (scratch_.stamp[i][index] != scratch_.frame) {
            scratch_.stamp[i][index] = scratch_.frame;
            const Hierarchy& h = hierarchyOf(i);
            int32_t value = allowedError(h, h.nodes[index], local);
            // Nested spheres give eps_child >= eps_parent; this makes it so to the last rounding.
            if (value != kCulled) value = std::max(value, parentEpsilon);
            scratch_.epsilon[i][index] = value;
        }
        return scratch_.epsilon[i][index];
    }

    /// Records and triangles of the full cut (everything resident) at `step`; stops counting above the budget.
    uint64_t cost(int step) {
        ++cut_.counters.evaluations;
        uint64_t total = 0;
        for (size_t i = 0; i < instances_.size() && total <= budgets_.records; ++i) {
            if (hierarchyOf(i).nodes.empty() || instances_[i].isStandIn) continue;
            if (usesStandIn(i, step))
                total += pointCost(instances_[i].standIn, step - kStepsPerOctave, budgets_.records - total);
            else if (hierarchyOf(i).isMesh())
                total += meshCost(i, makeLocalView(hierarchyOf(i), instances_[i], view_), step);
            else
                total += pointCost(i, step, budgets_.records - total);
        }
        return total;
    }

    uint64_t pointCost(size_t i, int step, uint64_t most) {
        const Hierarchy& h = hierarchyOf(i);
        const LocalView local = makeLocalView(h, instances_[i], view_);
        uint64_t total = 0;
        auto& stack = scratch_.stack;
        stack.assign(1, 0u);
        while (!stack.empty()) {
            const uint32_t index = stack.back();
            stack.pop_back();
            const Node& node = h.nodes[index];
            const int32_t parentEpsilon = index == 0 ? kInside : scratch_.epsilon[i][node.parent];
            const int32_t epsilon = epsilonOf(i, local, index, parentEpsilon);
            if (epsilon == kCulled) continue;
            const uint32_t parentCode = index == 0 ? ErrorScale::kLargest : codeAt(parentEpsilon, step);
            const uint32_t code = codeAt(epsilon, step);
            total += h.countGreater(node.parentCounts, node.records, parentCode) -
                     h.countGreater(node.ownCounts, node.records, code);
            if (total > most) return total;
            if (node.errorCode <= code) continue;
            const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
            for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
        }
        return total;
    }

    /// Are the points that may stand in for mesh `i` good enough at `step`, half of the error being theirs and half
    /// left for their own levels of detail, and fewer than its triangles?
    bool usesStandIn(size_t i, int step) {
        const Instance& mesh = instances_[i];
        if (mesh.standIn == Instance::kNone) return false;
        const Hierarchy& points = hierarchyOf(mesh.standIn);
        const LocalView local = makeLocalView(points, instances_[mesh.standIn], view_);
        const int32_t epsilon = epsilonOf(mesh.standIn, local, 0, kInside);
        if (epsilon == kCulled || epsilon == kInside) return false;
        const double allowed = points.errors.smallest * points.unit * instances_[mesh.standIn].scale *
                               std::exp2(static_cast<double>(epsilon + step) / kStepsPerOctave);
        if (!(2 * mesh.standInError <= allowed)) return false;
        const uint64_t triangles = meshCost(i, makeLocalView(hierarchyOf(i), mesh, view_), step);
        return pointCost(mesh.standIn, step - kStepsPerOctave, triangles) < triangles;
    }

    /// The smallest step >= target whose full cut fits the budget (cost falls with the step).
    int stepForBudget(int target) {
        if (budgets_.records == std::numeric_limits<uint64_t>::max()) return target;
        // From the coarse side, so that no evaluation walks much more than the budget's worth of nodes.
        int hi = std::max(target, 0) + 8 * kStepsPerOctave;
        while (hi < kLargestTauStep && cost(hi) > budgets_.records)
            hi = std::min(hi + 8 * kStepsPerOctave, kLargestTauStep);
        int lo = target;
        if (cost(lo) <= budgets_.records) return lo;
        while (hi - lo > 1) {
            const int middle = lo + (hi - lo) / 2;
            (cost(middle) <= budgets_.records ? hi : lo) = middle;
        }
        return hi;
    }

    /// Can the points that stand in be drawn? Asks for them if not: meanwhile the mesh is drawn.
    bool hasRoot(uint32_t i) {
        const uint32_t source = instances_[i].source;
        if (residency_.drawable[source][0]) return true;
        cut_.wanted.push_back({source, 0, 1e9f});
        return false;
    }

    /// Screen-space error, px, of error code `code` at a node with allowed error `epsilon`.
    static double pixelsOf(uint32_t code, int32_t epsilon) {
        if (code == 0) return 0;
        if (epsilon == kInside) return 1e6;
        return std::exp2(code / 8.0 - static_cast<double>(epsilon) / kStepsPerOctave);
    }

    void emit(size_t i, int step) {
        const Hierarchy& h = hierarchyOf(i);
        if (h.nodes.empty()) return;
        const LocalView local = makeLocalView(h, instances_[i], view_);
        const uint32_t source = instances_[i].source;
        const std::vector<uint8_t>& drawable = residency_.drawable[source];
        const auto instance = static_cast<uint32_t>(i);
        if (h.isMesh()) {
            emitMesh(instance, local, step);
            return;
        }
        const size_t firstDraw = cut_.draw.size();
        auto& stack = scratch_.stack;
        stack.assign(1, 0u);
        while (!stack.empty()) {
            const uint32_t index = stack.back();
            stack.pop_back();
            const Node& node = h.nodes[index];
            ++cut_.counters.nodesVisited;
            const int32_t parentEpsilon = index == 0 ? kInside : scratch_.epsilon[i][node.parent];
            const int32_t epsilon = epsilonOf(i, local, index, parentEpsilon);
            if (epsilon == kCulled) {
                ++cut_.counters.nodesCulled;
                continue;
            }
            const bool isDrawable = drawable[index] != 0;
            const uint32_t code = codeAt(epsilon, step);
            if (isDrawable) {
                cut_.keep.emplace_back(source, index);
            } else {
                ++cut_.counters.nodesMissing;
                const double pixels = index == 0 ? 1e9 : pixelsOf(h.nodes[node.parent].errorCode, parentEpsilon);
                cut_.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
            }
            uint32_t octantMask = 0;
            if (node.errorCode > code) {
                uint32_t child = node.firstChild;
                for (uint32_t octant = 0; octant < 8; ++octant) {
                    if (!(node.childMask >> octant & 1u)) continue;
                    stack.push_back(child);
                    // A child out of view is not drawn and not missing either.
                    if (!drawable[child] && epsilonOf(i, local, child, epsilon) != kCulled) octantMask |= 1u << octant;
                    ++child;
                }
            }
            // Only what hangs together with the root is drawn: a node whose parent is missing is covered above.
            if (!isDrawable || !isReachable(drawable, h, index)) continue;
            const uint32_t parentCode = index == 0 ? ErrorScale::kLargest : codeAt(parentEpsilon, step);
            const uint32_t count = h.countGreater(node.parentCounts, node.records, parentCode);
            if (count == 0) continue;
            const uint32_t tooCoarse = octantMask ? 0 : h.countGreater(node.ownCounts, node.records, code);
            cut_.counters.recordsDrawn += count - tooCoarse;
            cut_.counters.recordsTested += count;
            const double delivered =
                pixelsOf(octantMask ? node.errorCode : std::min<uint32_t>(node.errorCode, code), epsilon);
            if (octantMask) cut_.tauEffective = std::max(cut_.tauEffective, delivered);
            if (count > tooCoarse)
                cut_.draw.push_back({instance, index, count, code, octantMask, static_cast<float>(delivered)});
        }
        std::sort(cut_.draw.begin() + static_cast<std::ptrdiff_t>(firstDraw), cut_.draw.end(),
                  [](const CutDraw& a, const CutDraw& b) { return a.node < b.node; });
    }

    // ---- meshes: groups are refined or not, all of a group's clusters at once (lod/mesh.h) ----

    enum GroupState : uint8_t { kCoarse = 0, kRefined = 1, kUnseen = 2 };

    /// Decides for every group whether its clusters stand in for its simplification; calls onRefined(index, epsilon)
    /// for those in view that should, which says whether they can.
    template <typename OnRefined>
    void refineGroups(size_t i, const LocalView& local, int step, const OnRefined& onRefined) {
        const Hierarchy& h = hierarchyOf(i);
        std::vector<uint8_t>& state = scratch_.groupState;
        state.assign(h.nodes.size(), kCoarse);
        for (uint32_t index = 0; index < h.nodes.size(); ++index) {
            const MeshGroup& group = h.groups[index];
            bool isReached = true;
            for (uint32_t k = 0; k < group.parents; ++k)
                isReached = isReached && state[h.parents[group.firstParent + k]];
            if (!isReached) continue;
            ++cut_.counters.nodesVisited;
            const int32_t epsilon = epsilonOf(i, local, index, kInside);
            if (epsilon == kCulled) {
                ++cut_.counters.nodesCulled;
                state[index] = kUnseen;
            } else if (h.nodes[index].errorCode > codeAt(epsilon, step) && onRefined(index, epsilon)) {
                state[index] = kRefined;
            }
        }
    }

    /// Calls use(index, run) for all runs that are drawn.
    template <typename Use>
    void drawnRuns(const Hierarchy& h, const Use& use) const {
        const std::vector<uint8_t>& state = scratch_.groupState;
        for (uint32_t index = 0; index < h.nodes.size(); ++index) {
            if (state[index] != kRefined) continue;
            const MeshGroup& group = h.groups[index];
            for (uint32_t r = 0; r < group.runs; ++r) {
                const MeshRun& run = h.runs[group.firstRun + r];
                if (run.producer == MeshRun::kOriginal || state[run.producer] == kCoarse) use(index, run);
            }
        }
    }

    /// Is any of a refined group's runs drawn, not all replaced by finer ones?
    bool drawsAny(const Hierarchy& h, uint32_t index) const {
        for (uint32_t r = 0; r < h.groups[index].runs; ++r) {
            const uint32_t producer = h.runs[h.groups[index].firstRun + r].producer;
            if (producer == MeshRun::kOriginal || scratch_.groupState[producer] == kCoarse) return true;
        }
        return false;
    }

    uint64_t meshCost(size_t i, const LocalView& local, int step) {
        refineGroups(i, local, step, [](uint32_t, int32_t) { return true; });
        uint64_t total = 0;
        drawnRuns(hierarchyOf(i), [&](uint32_t, const MeshRun& run) { total += run.triangles; });
        return total;
    }

    void emitMesh(uint32_t instance, const LocalView& local, int step) {
        const Hierarchy& h = hierarchyOf(instance);
        const uint32_t source = instances_[instance].source;
        const std::vector<uint8_t>& drawable = residency_.drawable[source];
        const uint64_t missingBefore = cut_.counters.nodesMissing;
        refineGroups(instance, local, step, [&](uint32_t index, int32_t epsilon) {
            if (drawable[index]) {
                cut_.keep.emplace_back(source, index);
                return true;
            }
            ++cut_.counters.nodesMissing;
            const Node& node = h.nodes[index];
            const bool isRoot = h.groups[index].parents == 0;
            const double pixels = isRoot ? 1e9 : pixelsOf(node.errorCode, epsilon);
            cut_.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
            if (!isRoot) cut_.tauEffective = std::max(cut_.tauEffective, pixels);
            return false;
        });
        if (!h.textures.empty()) wantTiles(instance, local, cut_.counters.nodesMissing == missingBefore);
        uint32_t last = MeshRun::kOriginal;
        drawnRuns(h, [&](uint32_t index, const MeshRun& run) {
            const bool isExact = run.producer == MeshRun::kOriginal;
            // A producer that no view asked about was not looked at: its own error is smaller still.
            const double pixels =
                isExact ? 0
                        : pixelsOf(h.nodes[run.producer].errorCode, epsilonOf(instance, local, run.producer, kInside));
            cut_.meshDraw.push_back(
                {instance, index, run.firstCluster, run.clusters, run.triangles, static_cast<float>(pixels)});
            cut_.counters.trianglesDrawn += run.triangles;
            cut_.counters.nodesDrawn += index != last ? 1 : 0;
            last = index;
        });
    }

    /// Texture tiles that the groups in view can show: from the level whose texels are about a pixel where the group is
    /// nearest to the coarsest, the part that its texture coordinates cover.
    /// Geometry comes first: while some of it is missing, only the coarsest level is asked for and nothing finer is
    /// held on to, or the textures of coarse groups would fill the memory that fine groups need.
    void wantTiles(uint32_t instance, const LocalView& local, bool isWhole) {
        const Hierarchy& h = hierarchyOf(instance);
        const uint32_t source = instances_[instance].source;
        std::vector<uint8_t>& seen = scratch_.tileSeen;
        seen.assign(h.tiles.size(), 0);
        const auto want = [&](uint32_t tile, float priority) {
            if (seen[tile]) return;
            seen[tile] = 1;
            const auto chunk = static_cast<uint32_t>(h.nodes.size() + tile);
            if (residency_.drawable[source][chunk])
                cut_.keep.emplace_back(source, chunk);
            else
                cut_.wanted.push_back({source, chunk, priority});
        };
        for (uint32_t index = 0; index < h.nodes.size(); ++index) {
            const MeshGroup& g = h.groups[index];
            if (scratch_.groupState[index] != kRefined || g.textures == 0 || !drawsAny(h, index)) continue;
            const double nearest =
                std::max(glm::length(h.nodes[index].centre - local.eye) - h.nodes[index].radius, local.nearPlane);
            const double uvPerPixel = 0.5 * g.uvPerStep * nearest / local.focal;
            for (uint32_t k = 0; k < g.textures; ++k) {
                const shared::TextureInfo& t = h.textures[h.groupTextures[g.firstTexture + k]];
                const double texels = uvPerPixel * std::max(t.width, t.height);
                const auto finest = static_cast<uint32_t>(
                    std::clamp(std::floor(std::log2(std::max(texels, 1.0))), 0.0, double(t.levels - 1)));
                const auto range = [](float lo, float hi, uint32_t wrap, uint32_t size, uint32_t tiles) {
                    // Coordinates that wrap around, or may, take the whole row.
                    const float a = std::floor(lo), texel = 1.0f / static_cast<float>(size);
                    if (wrap == shared::kWrapMirror || hi - a >= 1 - texel || lo - a <= texel || !(hi - lo < 1))
                        return std::pair{0u, tiles - 1};
                    const auto tile = [&](float u) {
                        const float at = std::clamp(u - a, 0.0f, 1.0f) * static_cast<float>(size);
                        return std::min(static_cast<uint32_t>(at / shared::kTileTexels), tiles - 1);
                    };
                    return std::pair{tile(lo - texel), tile(hi + texel)};
                };
                // Parts that are seen at a slant, or farther away, take the coarser levels.
                for (uint32_t level = t.levels; level-- > (isWhole ? finest : t.levels - 1);) {
                    const uint32_t across = shared::tilesAcross(t.width, level),
                                   down = shared::tilesAcross(t.height, level);
                    const auto [x0, x1] = range(g.lowU, g.highU, t.wrapU, shared::levelSize(t.width, level), across);
                    const auto [y0, y1] = range(g.lowV, g.highV, t.wrapV, shared::levelSize(t.height, level), down);
                    for (uint32_t y = y0; y <= y1; ++y)
                        for (uint32_t x = x0; x <= x1; ++x)
                            want(t.firstTile[level] + y * across + x, static_cast<float>(1 + level));
                }
            }
        }
    }

    /// True if every ancestor is drawable (a child whose parent's chunk is missing is covered by a coarser ancestor).
    static bool isReachable(const std::vector<uint8_t>& drawable, const Hierarchy& h, uint32_t index) {
        while (index != 0) {
            index = h.nodes[index].parent;
            if (!drawable[index]) return false;
        }
        return true;
    }

    /// Even the coarsest cut is too large: leave out records, finest first, and say so.
    void truncate() {
        cut_.truncated = true;
        uint64_t left = budgets_.records;
        for (CutDraw& draw : cut_.draw) {
            draw.count = static_cast<uint32_t>(std::min<uint64_t>(draw.count, left));
            left -= draw.count;
        }
        std::erase_if(cut_.draw, [](const CutDraw& d) { return d.count == 0; });
        cut_.counters.recordsDrawn = budgets_.records - left;
        uint64_t triangles = 0;
        std::erase_if(cut_.meshDraw, [&](const CutMeshDraw& d) {
            const bool isLeftOut = triangles + d.triangles > left;
            if (!isLeftOut) triangles += d.triangles;
            return isLeftOut;
        });
        cut_.counters.trianglesDrawn = triangles;
    }

    std::span<const Hierarchy* const> hierarchies_;
    std::span<const Instance> instances_;
    const Residency& residency_;
    const View& view_;
    const Budgets& budgets_;
    CutScratch& scratch_;
    Cut& cut_;
};

}  // namespace

void selectCut(std::span<const Hierarchy* const> hierarchies, std::span<const Instance> instances,
               const Residency& residency, const View& view, const Budgets& budgets, CutScratch& scratch, Cut& cut) {
    for (const Instance& i : instances) STIPPLE_CHECK(i.source < residency.drawable.size(), "residency of a source");
    Selector(hierarchies, instances, residency, view, budgets, scratch, cut).run();
}

}  // namespace stipple::lod
