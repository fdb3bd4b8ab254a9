#include "lod/cut.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/cut_view.h"

namespace stipple::lod {
namespace {

class Selector {
  public:
    Selector(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
             CutScratch& scratch, Cut& cut)
        : hierarchies_(scene.hierarchies),
          instances_(scene.instances),
          crowds_(scene.crowds),
          residency_(residency),
          view_(view),
          budgets_(budgets),
          scratch_(scratch),
          cut_(cut) {
        ++scratch_.frame;
        scratch_.slotsUsed = 0;
        if (scratch_.slotOf.size() != instances_.size()) findDrivers();
        for (const Crowd& crowd : crowds_) isReady_.push_back(isReady(crowd));
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
            cut_.counters.trianglesDrawn = cut_.counters.standIns = cut_.counters.crowdMembers = 0;
            cut_.counters.nodesCulled = cut_.counters.nodesMissing = cut_.counters.nodesDrawn = 0;
            cut_.tauEffective = 0;
            wantRoots();
            beginEvaluation();
            for (const uint32_t i : scratch_.drivers) emitBest(i, step);
            cut_.counters.crowdMembers = scratch_.active.size();
            std::sort(scratch_.active.begin(), scratch_.active.end());
            for (const uint32_t i : scratch_.active) emitBest(i, step);
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

    /// Once for a scene: there may be so many instances that only to look at them takes milliseconds.
    void findDrivers() {
        scratch_.slotOf.assign(instances_.size(), {0, 0});
        scratch_.activeStamp.assign(instances_.size(), 0);
        scratch_.drivers.clear();
        for (size_t i = 0; i < instances_.size(); ++i) {
            STIPPLE_CHECK(instances_[i].source < residency_.drawable.size(), "residency of a source");
            if (!instances_[i].isDriven && !hierarchyOf(i).nodes.empty())
                scratch_.drivers.push_back(static_cast<uint32_t>(i));
        }
    }

    /// What this frame remembers of instance i.
    CutScratch::Slot& slotOf(size_t i) {
        auto& [frame, number] = scratch_.slotOf[i];
        if (frame == scratch_.frame) return scratch_.slots[number];
        frame = scratch_.frame;
        number = scratch_.slotsUsed++;
        if (number == scratch_.slots.size()) scratch_.slots.emplace_back();
        CutScratch::Slot& slot = scratch_.slots[number];
        const Hierarchy& h = hierarchyOf(i);
        slot.view = makeLocalView(h, instances_[i], view_);
        slot.inputError = instances_[i].inputError / (instances_[i].scale * h.unit * h.errors.smallest);
        if (slot.stamp.size() < h.nodes.size()) {
            slot.stamp.resize(h.nodes.size(), 0);
            slot.epsilon.resize(h.nodes.size(), 0);
        }
        return slot;
    }

    int32_t epsilonOf(size_t i, CutScratch::Slot& slot, uint32_t index, int32_t parentEpsilon) {
        if (slot.stamp[index] != scratch_.frame) {
            slot.stamp[index] = scratch_.frame;
            const Hierarchy& h = hierarchyOf(i);
            int32_t value = allowedError(h, h.nodes[index], slot.view);
            // Nested spheres give eps_child >= eps_parent; this makes it so to the last rounding.
            if (value != kCulled) value = std::max(value, parentEpsilon);
            slot.epsilon[index] = value;
        }
        return slot.epsilon[index];
    }

    /// Allowed error in steps of the smallest code at tau = 2^(step/32).
    static double allowedAt(int32_t epsilon, int step) {
        return epsilon == kInside ? 0.0 : std::exp2(static_cast<double>(epsilon + step) / kStepsPerOctave);
    }
    /// Allowed own error of records: what the input's error leaves of the whole.
    static uint32_t codeOf(const CutScratch::Slot& slot, int32_t epsilon, int step) {
        if (slot.inputError == 0) return codeAt(epsilon, step);
        const double left = allowedAt(epsilon, step) - slot.inputError;
        if (!(left >= 1)) return 0;
        return static_cast<uint32_t>(std::min(8 * std::log2(left), double{ErrorScale::kLargest}));
    }

    // ---- crowds ----

    bool isReady(const Crowd& crowd) const {
        return std::all_of(crowd.sources.begin(), crowd.sources.end(),
                           [&](uint32_t source) { return residency_.drawable[source][0] != 0; });
    }
    void wantRoots() {
        for (size_t c = 0; c < crowds_.size(); ++c)
            for (const uint32_t source : crowds_[c].sources)
                if (residency_.drawable[source][0])
                    cut_.keep.emplace_back(source, 0u);
                else
                    cut_.wanted.push_back({source, 0, 1e8f});
    }
    void beginEvaluation() {
        ++scratch_.evaluation;
        scratch_.active.clear();
    }
    /// Does this leaf of a crowd's points have to give way to the crowd's members?
    bool givesWay(size_t i, const CutScratch::Slot& slot, const Node& node, int32_t epsilon, int step) const {
        return instances_[i].crowd != Instance::kNone && node.isLeaf() && allowedAt(epsilon, step) < slot.inputError;
    }
    void activate(const Crowd& crowd, uint32_t index) {
        for (uint32_t k = crowd.first[index]; k < crowd.first[index + 1]; ++k) {
            const uint32_t member = crowd.members[k];
            if (scratch_.activeStamp[member] == scratch_.evaluation) continue;
            scratch_.activeStamp[member] = scratch_.evaluation;
            scratch_.active.push_back(member);
        }
    }

    void emitBest(uint32_t i, int step) {
        const uint32_t best = bestOf(i, step);
        if (best != i && hasRoot(best)) {
            ++cut_.counters.standIns;
            emit(best, step);
        } else {
            emit(i, step);
        }
    }
    uint64_t bestCost(uint32_t i, int step, uint64_t most) {
        const uint32_t best = bestOf(i, step);
        return hierarchyOf(best).isMesh() ? meshCost(best, step) : pointCost(best, step, most);
    }

    /// Records and triangles of the full cut (everything resident) at `step`; stops counting above the budget.
    uint64_t cost(int step) {
        ++cut_.counters.evaluations;
        beginEvaluation();
        uint64_t total = 0;
        const auto add = [&](uint32_t i) {
            if (total <= budgets_.records) total += bestCost(i, step, budgets_.records - total);
        };
        for (const uint32_t i : scratch_.drivers) add(i);
        for (size_t k = 0; k < scratch_.active.size() && total <= budgets_.records; ++k) add(scratch_.active[k]);
        return total;
    }

    uint64_t pointCost(size_t i, int step, uint64_t most) {
        const Hierarchy& h = hierarchyOf(i);
        CutScratch::Slot& slot = slotOf(i);
        uint64_t total = 0;
        auto& stack = scratch_.stack;
        stack.assign(1, 0u);
        while (!stack.empty()) {
            const uint32_t index = stack.back();
            stack.pop_back();
            const Node& node = h.nodes[index];
            const int32_t parentEpsilon = index == 0 ? kInside : slot.epsilon[node.parent];
            const int32_t epsilon = epsilonOf(i, slot, index, parentEpsilon);
            if (epsilon == kCulled) continue;
            if (givesWay(i, slot, node, epsilon, step)) {
                activate(crowds_[instances_[i].crowd], index);
                continue;
            }
            const uint32_t parentCode = index == 0 ? ErrorScale::kLargest : codeOf(slot, parentEpsilon, step);
            const uint32_t code = codeOf(slot, epsilon, step);
            total += h.countGreater(node.parentCounts, node.records, parentCode) -
                     h.countGreater(node.ownCounts, node.records, code);
            if (total > most) return total;
            if (node.errorCode <= code) continue;
            const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
            for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
        }
        return total;
    }

    /// Are all records of a stand-in within the error that `step` allows?
    bool isGoodEnough(uint32_t standIn, int step) {
        CutScratch::Slot& slot = slotOf(standIn);
        const int32_t epsilon = epsilonOf(standIn, slot, 0, kInside);
        return epsilon != kCulled && epsilon != kInside && allowedAt(epsilon, step) >= slot.inputError;
    }

    /// What to draw for instance i: the coarsest of its stand-ins that is good enough, if it has fewer records than i
    /// itself; else i.
    uint32_t bestOf(uint32_t i, int step) {
        uint32_t best = i;
        for (uint32_t next = instances_[i].standIn; next != Instance::kNone && isGoodEnough(next, step);
             next = instances_[next].standIn)
            best = next;
        if (best == i) return i;
        if (hierarchyOf(i).isMesh()) {
            const uint64_t triangles = meshCost(i, step);
            return pointCost(best, step, triangles) < triangles ? best : i;
        }
        const uint64_t points = pointCost(best, step, std::numeric_limits<uint64_t>::max());
        return points <= pointCost(i, step, points) ? best : i;
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

    /// Is a child in view, and its records needed (or else the parent's in their place)?
    bool isCovering(size_t i, CutScratch::Slot& slot, uint32_t child, int32_t parentEpsilon, int step) {
        const int32_t epsilon = epsilonOf(i, slot, child, parentEpsilon);
        if (epsilon == kCulled) return false;
        return !(givesWay(i, slot, hierarchyOf(i).nodes[child], epsilon, step) && isReady_[instances_[i].crowd]);
    }

    /// Can the points that stand in be drawn? Asks for them if not: meanwhile the mesh is drawn.
    bool hasRoot(uint32_t i) {
        const uint32_t source = instances_[i].source;
        if (residency_.drawable[source][0]) return true;
        cut_.wanted.push_back({source, 0, 1e9f});
        return false;
    }

    /// Screen-space error, px, of error code `code` at a node with allowed error `epsilon`.
    static double pixelsOf(const CutScratch::Slot& slot, uint32_t code, int32_t epsilon) {
        const double error = (code == 0 ? 0 : std::exp2(code / 8.0)) + slot.inputError;
        if (error == 0) return 0;
        return epsilon == kInside ? 1e6 : error * std::exp2(-static_cast<double>(epsilon) / kStepsPerOctave);
    }

    void emit(size_t i, int step) {
        const Hierarchy& h = hierarchyOf(i);
        if (h.nodes.empty()) return;
        const uint32_t source = instances_[i].source;
        const std::vector<uint8_t>& drawable = residency_.drawable[source];
        const auto instance = static_cast<uint32_t>(i);
        if (h.isMesh()) {
            emitMesh(instance, step);
            return;
        }
        CutScratch::Slot& slot = slotOf(i);
        const size_t firstDraw = cut_.draw.size();
        auto& stack = scratch_.stack;
        stack.assign(1, 0u);
        while (!stack.empty()) {
            const uint32_t index = stack.back();
            stack.pop_back();
            const Node& node = h.nodes[index];
            ++cut_.counters.nodesVisited;
            const int32_t parentEpsilon = index == 0 ? kInside : slot.epsilon[node.parent];
            const int32_t epsilon = epsilonOf(i, slot, index, parentEpsilon);
            if (epsilon == kCulled) {
                ++cut_.counters.nodesCulled;
                continue;
            }
            const bool isTooCoarse = givesWay(i, slot, node, epsilon, step);
            if (isTooCoarse && isReady_[instances_[i].crowd]) {
                activate(crowds_[instances_[i].crowd], index);
                continue;
            }
            const bool isDrawable = drawable[index] != 0;
            const uint32_t code = codeOf(slot, epsilon, step);
            if (isDrawable) {
                cut_.keep.emplace_back(source, index);
            } else {
                ++cut_.counters.nodesMissing;
                const double pixels = index == 0 ? 1e9 : pixelsOf(slot, h.nodes[node.parent].errorCode, parentEpsilon);
                cut_.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
            }
            uint32_t octantMask = 0;
            if (node.errorCode > code) {
                uint32_t child = node.firstChild;
                for (uint32_t octant = 0; octant < 8; ++octant) {
                    if (!(node.childMask >> octant & 1u)) continue;
                    stack.push_back(child);
                    // A child out of view is not drawn and not missing either.
                    if (!drawable[child] && isCovering(i, slot, child, epsilon, step)) octantMask |= 1u << octant;
                    ++child;
                }
            }
            // Only what hangs together with the root is drawn: a node whose parent is missing is covered above.
            if (!isDrawable || !isReachable(drawable, h, index)) continue;
            const uint32_t parentCode = index == 0 ? ErrorScale::kLargest : codeOf(slot, parentEpsilon, step);
            const uint32_t count = h.countGreater(node.parentCounts, node.records, parentCode);
            if (count == 0) continue;
            const uint32_t tooCoarse = octantMask ? 0 : h.countGreater(node.ownCounts, node.records, code);
            cut_.counters.recordsDrawn += count - tooCoarse;
            cut_.counters.recordsTested += count;
            const double delivered =
                pixelsOf(slot, octantMask ? node.errorCode : std::min<uint32_t>(node.errorCode, code), epsilon);
            if (octantMask || isTooCoarse) cut_.tauEffective = std::max(cut_.tauEffective, delivered);
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
    void refineGroups(size_t i, int step, const OnRefined& onRefined) {
        const Hierarchy& h = hierarchyOf(i);
        CutScratch::Slot& slot = slotOf(i);
        std::vector<uint8_t>& state = scratch_.groupState;
        state.assign(h.nodes.size(), kCoarse);
        for (uint32_t index = 0; index < h.nodes.size(); ++index) {
            const MeshGroup& group = h.groups[index];
            bool isReached = true;
            for (uint32_t k = 0; k < group.parents; ++k)
                isReached = isReached && state[h.parents[group.firstParent + k]];
            if (!isReached) continue;
            ++cut_.counters.nodesVisited;
            const int32_t epsilon = epsilonOf(i, slot, index, kInside);
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

    uint64_t meshCost(size_t i, int step) {
        refineGroups(i, step, [](uint32_t, int32_t) { return true; });
        uint64_t total = 0;
        drawnRuns(hierarchyOf(i), [&](uint32_t, const MeshRun& run) { total += run.triangles; });
        return total;
    }

    void emitMesh(uint32_t instance, int step) {
        const Hierarchy& h = hierarchyOf(instance);
        CutScratch::Slot& slot = slotOf(instance);
        const uint32_t source = instances_[instance].source;
        const std::vector<uint8_t>& drawable = residency_.drawable[source];
        const uint64_t missingBefore = cut_.counters.nodesMissing;
        refineGroups(instance, step, [&](uint32_t index, int32_t epsilon) {
            if (drawable[index]) {
                cut_.keep.emplace_back(source, index);
                return true;
            }
            ++cut_.counters.nodesMissing;
            const Node& node = h.nodes[index];
            const bool isRoot = h.groups[index].parents == 0;
            const double pixels = isRoot ? 1e9 : pixelsOf(slot, node.errorCode, epsilon);
            cut_.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
            if (!isRoot) cut_.tauEffective = std::max(cut_.tauEffective, pixels);
            return false;
        });
        if (!h.textures.empty()) wantTiles(instance, slot.view, cut_.counters.nodesMissing == missingBefore);
        uint32_t last = MeshRun::kOriginal;
        drawnRuns(h, [&](uint32_t index, const MeshRun& run) {
            const bool isExact = run.producer == MeshRun::kOriginal;
            // A producer that no view asked about was not looked at: its own error is smaller still.
            const double pixels = isExact ? 0
                                          : pixelsOf(slot, h.nodes[run.producer].errorCode,
                                                     epsilonOf(instance, slot, run.producer, kInside));
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
    std::span<const Crowd> crowds_;
    std::vector<bool> isReady_;  ///< of each crowd: can its members be drawn?
    const Residency& residency_;
    const View& view_;
    const Budgets& budgets_;
    CutScratch& scratch_;
    Cut& cut_;
};

}  // namespace

void selectCut(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
               CutScratch& scratch, Cut& cut) {
    Selector(scene, residency, view, budgets, scratch, cut).run();
}

}  // namespace stipple::lod
