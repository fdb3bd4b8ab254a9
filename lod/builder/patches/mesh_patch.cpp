// What lies over a cell of the grid, and what becomes of it:
//
//     cover    a triangle of the segment touches the cell: it has to be drawn
//     inside   nothing else does: all four corners lie on the segment, and no border edge crosses it
//     around   one of its neighbours is cover, and all corners lie on the surface: drawn, so that patches overlap
#include "lod/builder/patches/mesh_patch.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/numbers.h"
#include "lod/builder/patches/cone.h"
#include "lod/builder/patches/deviation.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_map.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kNobody = MeshSurface::kNobody;
constexpr uint32_t kMargin = 3;       ///< cells around a segment: of overlap, and what it is looked for in
constexpr double kFaces = 0.17;       ///< cosine between the axis and a triangle that a patch goes on over
constexpr double kSteepest = 4;       ///< height per step of what is drawn around
constexpr double kMostBeside = 0.5;   ///< share of samples beside the source
constexpr double kMostEmpty = 8;      ///< samples of the grid for each over the segment, before it is worth splitting
constexpr size_t kFewSamples = 4096;  ///< that are always worth it

struct Projected {
    std::array<glm::dvec2, 3> at;  ///< samples
    glm::dvec3 heights;
    double area2 = 0;                    ///< twice, with its sign
    int i0 = 0, i1 = 0, j0 = 0, j1 = 0;  ///< samples whose cells it may touch
};

/// Is a unit square with that lower left corner touched by a triangle (counter-clockwise or not)?
bool touches(const Projected& p, double x, double y) {
    for (size_t k = 0; k < 3; ++k) {
        const glm::dvec2 a = p.at.at(k), e = p.at.at((k + 1) % 3) - a;
        const glm::dvec2 outwards = p.area2 < 0 ? glm::dvec2(-e.y, e.x) : glm::dvec2(e.y, -e.x);
        // The square's corner that is farthest inside.
        const glm::dvec2 corner(outwards.x > 0 ? x : x + 1, outwards.y > 0 ? y : y + 1);
        if (glm::dot(outwards, corner - a) > 0) return false;
    }
    return true;
}

bool segmentTouches(const glm::dvec2& a, const glm::dvec2& b, double x, double y) {
    if (std::max(a.x, b.x) < x || std::min(a.x, b.x) > x + 1 || std::max(a.y, b.y) < y || std::min(a.y, b.y) > y + 1)
        return false;
    const glm::dvec2 n(b.y - a.y, a.x - b.x);
    double lo = 1e300, hi = -1e300;
    for (const glm::dvec2& c :
         {glm::dvec2(x, y), glm::dvec2(x + 1, y), glm::dvec2(x, y + 1), glm::dvec2(x + 1, y + 1)}) {
        lo = std::min(lo, glm::dot(n, c - a));
        hi = std::max(hi, glm::dot(n, c - a));
    }
    return lo <= 0 && hi >= 0;
}

class Patcher {
  public:
    Patcher(const MeshSurface& surface, const Segment& segment, const std::vector<uint32_t>& owner, uint32_t self,
            double step, PatchClosing closing)
        : s_(surface), segment_(segment), owner_(owner), self_(self), closing_(closing), allowed_(step) {
        cone_ = coneOf(surface.elements.normal, segment);
        grid_.hasFineNormals = surface.hasFineNormals;
        isPlanned_ = planGrid(
            3 * segment.size(), [&](size_t k) { return s_.at(segment_[k / 3], k % 3); }, cone_.axis, step, kMargin,
            kFewSamples + toWhole<size_t>(kMostEmpty * samplesOver(step)), grid_);
    }

    MeshPatch run() {
        MeshPatch out;
        if (!isPlanned_ || cone_.cosine <= 0 || !isHeightField()) return out;
        countUsed();
        out.patch = toPatch(grid_);
        if (out.patch.width == 0 || beside_ > kMostBeside * static_cast<double>(used_)) {
            out.fit = PatchFit::thin;
            return out;
        }
        measure(out);
        return out;
    }

    /// Of a patch that `run` made.
    void dress(Patch& patch, const std::function<bool()>& isStopped) {
        if (!isPlanned_ || !isHeightField()) return;
        look(countUsed());
        Patch dressed = toPatch(grid_);
        patch.normals = std::move(dressed.normals);
        patch.colours = std::move(dressed.colours);
        patch.materials = std::move(dressed.materials);
        drawMap(patch, isStopped);
    }

  private:
    /// Samples and cells; false: it is none.
    bool isHeightField() {
        hit_.assign(grid_.heights.size(), kNobody);
        isBeside_.assign(grid_.heights.size(), 0);
        state_.assign(grid_.cells.size(), 0);
        lowest_.assign(grid_.cells.size(), 1e300);
        highest_.assign(grid_.cells.size(), -1e300);
        for (const uint32_t t : segment_) rasterise(t, true);
        for (const uint32_t t : segment_) cover(t);
        if (isFolded()) return false;
        if (closing_ == PatchClosing::overlap) goOn();
        for (const uint32_t t : segment_) markBorders(t);
        for (const uint32_t t : beyond_) markBorders(t);
        chooseCells();
        return true;
    }

    /// That lie over the segment, about.
    double samplesOver(double step) const {
        double area = 0;
        for (const uint32_t t : segment_)
            area += s_.elements.area[t] * std::abs(glm::dot(glm::dvec3(s_.elements.normal[t]), cone_.axis));
        return area / (step * step);
    }

    enum State : uint8_t { kCover = 1, kBorder = 2, kNear = 4 };

    Projected project(uint32_t t) const {
        Projected p;
        for (size_t k = 0; k < 3; ++k) {
            const glm::dvec3 q = grid_.local(s_.at(t, k));
            p.at.at(k) = glm::dvec2(q);
            p.heights[static_cast<int>(k)] = q.z;
        }
        const glm::dvec2 e = p.at[1] - p.at[0], f = p.at[2] - p.at[0];
        p.area2 = e.x * f.y - e.y * f.x;
        const glm::dvec2 lo = glm::min(p.at[0], glm::min(p.at[1], p.at[2])),
                         hi = glm::max(p.at[0], glm::max(p.at[1], p.at[2]));
        const auto within = [](double v, uint32_t n) {
            return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(n) - 1));
        };
        p.i0 = within(std::floor(lo.x), grid_.width);
        p.i1 = within(std::floor(hi.x), grid_.width);
        p.j0 = within(std::floor(lo.y), grid_.height);
        p.j1 = within(std::floor(hi.y), grid_.height);
        return p;
    }
    /// Weights of the second and third corner at a place.
    static glm::dvec2 weights(const Projected& p, const glm::dvec2& q) {
        const glm::dvec2 e = p.at[1] - p.at[0], f = p.at[2] - p.at[0], d = q - p.at[0];
        return glm::dvec2(d.x * f.y - d.y * f.x, e.x * d.y - e.y * d.x) / p.area2;
    }
    static double heightAt(const Projected& p, const glm::dvec2& w) {
        return p.heights[0] + w.x * (p.heights[1] - p.heights[0]) + w.y * (p.heights[2] - p.heights[0]);
    }
    template <typename Use>
    void forSamples(const Projected& p, const Use& use) const {
        if (p.area2 == 0) return;
        constexpr double kSlack = 1e-9;  // a sample on an edge is on both triangles
        for (int j = p.j0; j <= std::min(p.j1 + 1, static_cast<int>(grid_.height) - 1); ++j)
            for (int i = p.i0; i <= std::min(p.i1 + 1, static_cast<int>(grid_.width) - 1); ++i) {
                const glm::dvec2 w = weights(p, glm::dvec2(i, j));
                if (w.x < -kSlack || w.y < -kSlack || w.x + w.y > 1 + kSlack) continue;
                use(grid_.at(static_cast<uint32_t>(i), static_cast<uint32_t>(j)), w);
            }
    }
    template <typename Use>
    void forCells(const Projected& p, const Use& use) const {
        for (int j = p.j0; j <= std::min(p.j1, static_cast<int>(grid_.height) - 2); ++j)
            for (int i = p.i0; i <= std::min(p.i1, static_cast<int>(grid_.width) - 2); ++i)
                use(static_cast<uint32_t>(i), static_cast<uint32_t>(j));
    }

    void spread(size_t cell, double height) {
        lowest_[cell] = std::min(lowest_[cell], height);
        highest_[cell] = std::max(highest_[cell], height);
    }

    /// The first triangle that a line meets stays; another one at another height there spreads the cells around.
    void rasterise(uint32_t t, bool isOwn) {
        const Projected p = project(t);
        forSamples(p, [&](size_t sample, const glm::dvec2& w) {
            const double height = heightAt(p, w);
            if (isOwn && grid_.has(sample)) apart_ = std::max(apart_, std::abs(grid_.heights[sample] - height));
            if (hit_[sample] != kNobody) return;
            hit_[sample] = t;
            grid_.heights[sample] = height;
        });
    }

    /// Cells that a triangle touches; corners of those beside it get its plane, the nearest triangle's first.
    void cover(uint32_t t) {
        const Projected p = project(t);
        forCells(p, [&](uint32_t i, uint32_t j) {
            if (p.area2 != 0 && !touches(p, i, j)) return;
            const size_t cell = grid_.cell(i, j);
            state_[cell] |= kCover;
            for (size_t k = 0; k < 3; ++k)
                if (std::floor(p.at.at(k).x) == i && std::floor(p.at.at(k).y) == j)
                    spread(cell, p.heights[static_cast<int>(k)]);
        });
    }

    void markBorders(uint32_t t) {
        const Projected p = project(t);
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t other = s_.across[t][k];
            if (other != kNobody && (owner_[other] == self_ || isBeyond(other))) continue;
            forCells(p, [&](uint32_t i, uint32_t j) {
                if (segmentTouches(p.at.at(k), p.at.at((k + 1) % 3), i, j)) state_[grid_.cell(i, j)] |= kBorder;
            });
        }
    }

    bool isBeyond(uint32_t t) const { return std::binary_search(beyond_.begin(), beyond_.end(), t); }

    bool isFolded() const {
        const double sine = std::sqrt(std::max(0.0, 1 - cone_.cosine * cone_.cosine));
        const double most = std::sqrt(2.0) * grid_.step * sine / cone_.cosine + allowed_;
        bool isTooFar = apart_ > allowed_;
        for (size_t c = 0; c < lowest_.size(); ++c) isTooFar |= highest_[c] - lowest_[c] > most;
        return isTooFar;
    }

    /// Over the triangles beyond the border, as far as cells near the segment.
    void goOn() {
        constexpr int kReach = 2;
        for (uint32_t j = 0; j + 1 < grid_.height; ++j)
            for (uint32_t i = 0; i + 1 < grid_.width; ++i) {
                if ((state_[grid_.cell(i, j)] & kCover) == 0) continue;
                for (int y = -kReach; y <= kReach; ++y)
                    for (int x = -kReach; x <= kReach; ++x)
                        if (const size_t c = cellBeside(i, j, x, y); c != ~size_t{0}) state_[c] |= kNear;
            }
        std::vector<uint32_t> found;  // in the order in which they hang together
        const auto offer = [&](uint32_t t) {
            if (t == kNobody || owner_[t] == self_ || glm::dot(glm::dvec3(s_.elements.normal[t]), cone_.axis) < kFaces)
                return;
            const auto at = std::lower_bound(beyond_.begin(), beyond_.end(), t);
            if (at != beyond_.end() && *at == t) return;
            bool isNear = false;
            forCells(project(t), [&](uint32_t i, uint32_t j) { isNear |= (state_[grid_.cell(i, j)] & kNear) != 0; });
            if (!isNear) return;
            beyond_.insert(at, t);
            found.push_back(t);
        };
        for (const uint32_t t : segment_)
            for (const uint32_t other : s_.elements.links(t)) offer(other);
        for (size_t k = 0; k < found.size(); ++k) {
            rasterise(found[k], false);
            for (const uint32_t other : s_.elements.links(found[k])) offer(other);
        }
    }

    size_t cellBeside(uint32_t i, uint32_t j, int x, int y) const {
        const int a = static_cast<int>(i) + x, b = static_cast<int>(j) + y;
        if (a < 0 || b < 0 || a + 1 >= static_cast<int>(grid_.width) || b + 1 >= static_cast<int>(grid_.height))
            return ~size_t{0};
        return grid_.cell(static_cast<uint32_t>(a), static_cast<uint32_t>(b));
    }

    bool isOnSegment(size_t sample) const { return hit_[sample] != kNobody && owner_[hit_[sample]] == self_; }

    void chooseCells() {
        if (closing_ == PatchClosing::overlap) fillBeside();
        for (uint32_t j = 0; j + 1 < grid_.height; ++j)
            for (uint32_t i = 0; i + 1 < grid_.width; ++i) {
                const size_t cell = grid_.cell(i, j);
                const auto corners = grid_.corners(i, j);
                if (closing_ == PatchClosing::overlap) {
                    grid_.cells[cell] = (state_[cell] & kCover) != 0 || isAround(i, j) ? 1 : 0;
                } else {
                    bool all = (state_[cell] & kCover) != 0;
                    for (const size_t s : corners) all = all && isOnSegment(s);
                    grid_.cells[cell] = all ? 1 : 0;
                }
            }
    }
    bool isAround(uint32_t i, uint32_t j) const {
        bool isBeside = false;
        for (int y = -1; y <= 1; ++y)
            for (int x = -1; x <= 1; ++x)
                if (const size_t c = cellBeside(i, j, x, y); c != ~size_t{0}) isBeside |= (state_[c] & kCover) != 0;
        if (!isBeside) return false;
        double lo = 1e300, hi = -1e300;
        for (const size_t s : grid_.corners(i, j)) {
            if (hit_[s] == kNobody) return false;
            lo = std::min(lo, grid_.heights[s]);
            hi = std::max(hi, grid_.heights[s]);
        }
        return hi - lo <= kSteepest * grid_.step;
    }

    /// Corners of cover that no triangle lies over, and those where what goes on is far from the segment's own plane:
    /// on the plane of the nearest triangle of the segment.
    void fillBeside() {
        std::vector<double> nearest(grid_.heights.size(), 1e300), plane(grid_.heights.size(), 0);
        std::vector<uint32_t> by(grid_.heights.size(), kNobody);
        for (const uint32_t t : segment_) {
            const Projected p = project(t);
            forCells(p, [&](uint32_t i, uint32_t j) {
                if (p.area2 == 0 || !touches(p, i, j)) return;
                for (const size_t s : grid_.corners(i, j)) {
                    if (isOnSegment(s)) continue;
                    const glm::dvec2 at(static_cast<double>(s % grid_.width), static_cast<double>(s / grid_.width));
                    const glm::dvec2 closest = closestOn(p, at);
                    const double squared = glm::dot(at - closest, at - closest);
                    if (squared >= nearest[s]) continue;
                    nearest[s] = squared;
                    by[s] = t;
                    plane[s] = heightAt(p, weights(p, closest)) + slopeAlong(t, at - closest);
                }
            });
        }
        for (size_t s = 0; s < by.size(); ++s) {
            if (by[s] == kNobody || (hit_[s] != kNobody && std::abs(grid_.heights[s] - plane[s]) <= allowed_)) continue;
            hit_[s] = by[s];
            grid_.heights[s] = plane[s];
            isBeside_[s] = 1;
            beside_ += 1;
        }
    }
    /// How much an element's plane rises along that way; slivers' own planes may be steep, their normals are not.
    double slopeAlong(uint32_t t, const glm::dvec2& way) const {
        const glm::dvec3 n = glm::transpose(grid_.frame) * glm::dvec3(s_.elements.normal[t]);
        return -(n.x * way.x + n.y * way.y) * grid_.step / std::max(n.z, 0.2);
    }
    static glm::dvec2 closestOn(const Projected& p, const glm::dvec2& q) {
        glm::dvec2 best = p.at[0];
        double squared = 1e300;
        for (size_t k = 0; k < 3; ++k) {
            const glm::dvec2 a = p.at.at(k), e = p.at.at((k + 1) % 3) - a;
            const double length = glm::dot(e, e);
            const double along = length > 0 ? std::clamp(glm::dot(q - a, e) / length, 0.0, 1.0) : 0;
            const glm::dvec2 d = a + along * e - q;
            if (glm::dot(d, d) < squared) {
                squared = glm::dot(d, d);
                best = a + along * e;
            }
        }
        return best;
    }

    /// Of each sample: is it drawn?
    std::vector<uint8_t> countUsed() {
        std::vector<uint8_t> isUsed(grid_.heights.size(), 0);
        for (uint32_t j = 0; j + 1 < grid_.height; ++j)
            for (uint32_t i = 0; i + 1 < grid_.width; ++i)
                if (grid_.cells[grid_.cell(i, j)] != 0)
                    for (const size_t s : grid_.corners(i, j)) isUsed[s] = 1;
        used_ = static_cast<size_t>(std::count(isUsed.begin(), isUsed.end(), 1));
        return isUsed;
    }
    /// Normals and colours of the samples that are drawn.
    void look(const std::vector<uint8_t>& isUsed) {
        for (size_t s = 0; s < isUsed.size(); ++s) {
            if (isUsed[s] == 0) continue;
            const SurfaceLook l = lookAt(
                hit_[s], {static_cast<double>(s % grid_.width), static_cast<double>(s / grid_.width)}, grid_.step);
            grid_.normals[s] = l.normal;
            grid_.colours[s] = l.colour;
            grid_.materials[s] = l.material;
        }
    }

    /// Sample of the grid that is a patch's first.
    std::pair<uint32_t, uint32_t> firstOf(const Patch& patch) const {
        const glm::dvec3 shift = grid_.local(patch.origin);  // whole samples
        return {static_cast<uint32_t>(std::lround(shift.x)), static_cast<uint32_t>(std::lround(shift.y))};
    }

    /// The patch's map, if it has one, whose texels lie on what lies over them: the first triangle that a line meets,
    /// as of samples.
    void drawMap(Patch& patch, const std::function<bool()>& isStopped) const {
        double wanted = 0;
        if (s_.mapTexels > 0)
            wanted = std::log2(s_.mapTexels);
        else if (s_.texelSide > 0)
            wanted = std::round(std::log2(grid_.step / s_.texelSide));
        patch.map.density = toWhole<uint32_t>(std::clamp(wanted, 0.0, static_cast<double>(s_.mostDensity)));
        if (patch.map.density == 0 && !s_.hasLight) return;
        const bool hasColours = patch.map.density > 0, hasNormals = hasColours && s_.hasMapNormals;
        const auto [i0, j0] = firstOf(patch);
        const MapLevel level = mapOf(patch);
        const double k = 1u << patch.map.density;
        const std::vector<uint32_t> over = trianglesOver(patch, level, i0, j0);
        PatchMap& map = patch.map;
        map.hasMaterials = hasColours && s_.hasMapMaterials;
        if (hasColours) map.colours.assign(level.isKnown.size(), 0);
        if (hasNormals) map.normals.assign(level.isKnown.size(), 0);
        if (s_.hasLight) map.light.assign(level.isKnown.size(), 0);
        const glm::mat3 toLocal(glm::transpose(grid_.frame));
        for (uint32_t y = 0; y < level.height; ++y) {
            if (isStopped && isStopped()) return;
            for (uint32_t x = 0; x < level.width; ++x) {
                const size_t t = level.at(x, y);
                if (level.isKnown[t] == 0) continue;
                const glm::dvec2 at(i0 + x / k, j0 + y / k);
                const SurfaceLook look = lookAt(over[t], at, grid_.step / k);
                if (s_.hasLight) map.light[t] = look.light;
                if (hasColours) map.colours[t] = look.colour | (map.hasMaterials ? uint32_t{look.material} << 24 : 0u);
                if (hasNormals) map.normals[t] = roundedNormal<kMapNormalStep>(toLocal * look.normal);
            }
        }
        if (std::all_of(map.light.begin(), map.light.end(), [](uint32_t l) { return l == 0; })) map.light = {};
        sampleColours(patch);
    }

    /// Of a place of the grid; of its sample where no triangle lies over it, or its cell lies beside the surface.
    std::vector<uint32_t> trianglesOver(const Patch& patch, const MapLevel& level, uint32_t i0, uint32_t j0) const {
        std::vector<uint32_t> over(level.isKnown.size(), kNobody);
        const double k = 1u << patch.map.density;
        const auto spread = [&](uint32_t t) {
            const Projected p = project(t);
            if (p.area2 == 0) return;
            glm::dvec2 lo(1e300), hi(-1e300);
            for (const glm::dvec2& corner : p.at) {
                lo = glm::min(lo, (corner - glm::dvec2(i0, j0)) * k);
                hi = glm::max(hi, (corner - glm::dvec2(i0, j0)) * k);
            }
            const auto within = [](double v, uint32_t n) {
                return toWhole<uint32_t>(std::clamp(v, 0.0, static_cast<double>(n)));
            };
            const uint32_t x1 = within(std::floor(hi.x) + 1, level.width),
                           y1 = within(std::floor(hi.y) + 1, level.height);
            for (uint32_t y = within(std::ceil(lo.y), level.height); y < y1; ++y)
                for (uint32_t x = within(std::ceil(lo.x), level.width); x < x1; ++x) {
                    const size_t at = level.at(x, y);
                    if (over[at] != kNobody || level.isKnown[at] == 0) continue;
                    const glm::dvec2 w = weights(p, {i0 + x / k, j0 + y / k});
                    if (w.x >= -1e-9 && w.y >= -1e-9 && w.x + w.y <= 1 + 1e-9) over[at] = t;
                }
        };
        for (const uint32_t t : segment_) spread(t);
        for (const uint32_t t : beyond_) spread(t);
        for (uint32_t y = 0; y < level.height; ++y)
            for (uint32_t x = 0; x < level.width; ++x) {
                const size_t at = level.at(x, y);
                const auto i = i0 + static_cast<uint32_t>(x / k + 0.5), j = j0 + static_cast<uint32_t>(y / k + 0.5);
                const size_t sample = grid_.at(std::min(i, grid_.width - 1), std::min(j, grid_.height - 1));
                if (level.isKnown[at] != 0 && (over[at] == kNobody || isBeside_[sample] != 0)) over[at] = hit_[sample];
            }
        return over;
    }

    /// What a triangle shows at a place of the grid, or at that of its own near there.
    SurfaceLook lookAt(uint32_t triangle, const glm::dvec2& at, double side) const {
        const Projected p = project(triangle);
        glm::dvec2 w(1.0 / 3);
        if (p.area2 != 0) w = glm::clamp(weights(p, at), 0.0, 1.0);
        if (const double sum = w.x + w.y; sum > 1) w /= sum;
        return s_.look(triangle, w.x, w.y, side);
    }

    void measure(MeshPatch& out) const {
        const auto [i0, j0] = firstOf(out.patch);
        OverPatch over;
        // No border crosses it, so the surface that lies over a corner lies over all of it.
        over.isInside = [&](uint32_t i, uint32_t j) {
            if ((state_[grid_.cell(i + i0, j + j0)] & kBorder) != 0) return false;
            for (const size_t s : grid_.corners(i + i0, j + j0))
                if (hit_[s] == kNobody || isBeside_[s] != 0) return false;
            return true;
        };
        over.triangle = [&](size_t sample) {
            const auto i = static_cast<uint32_t>(sample % out.patch.width),
                       j = static_cast<uint32_t>(sample / out.patch.width);
            return hit_[grid_.at(i + i0, j + j0)];
        };
        over.apart = apart_;
        over.isOpen = closing_ != PatchClosing::overlap;
        const Deviation d = deviationOf({s_, segment_, owner_, self_, beyond_}, out.patch, over);
        out.patch.errorToSource = d.toSource;
        out.patch.errorFromSource = d.fromSource;
        out.toSource = d.toSourceSquares;
        out.toSourceWeight = d.toSourceWeight;
        out.fromSource = d.fromSourceSquares;
        out.fromSourceWeight = d.fromSourceWeight;
        // (A single triangle is as it is.)
        out.fit = d.overOwn <= allowed_ || segment_.size() == 1 ? PatchFit::good : PatchFit::folded;
    }

    const MeshSurface& s_;
    const Segment& segment_;
    const std::vector<uint32_t>& owner_;
    uint32_t self_;
    PatchClosing closing_;
    double allowed_;  ///< scene units: one step
    NormalCone cone_;
    HeightGrid grid_;
    bool isPlanned_ = false;
    double apart_ = 0;               ///< most between the segment's triangles over one sample
    std::vector<uint32_t> hit_;      ///< the triangle over a sample, or whose plane it lies on
    std::vector<uint8_t> isBeside_;  ///< samples: nothing lies over them
    std::vector<uint32_t> beyond_;   ///< triangles of others that the patch may go on over, ascending
    std::vector<uint8_t> state_;     ///< of cells
    std::vector<double> lowest_, highest_;
    double beside_ = 0;
    size_t used_ = 0;
};

}  // namespace

MeshPatch patchOfTriangles(const MeshSurface& surface, const Segment& segment, const std::vector<uint32_t>& owner,
                           uint32_t self, double step, PatchClosing closing) {
    return Patcher(surface, segment, owner, self, step, closing).run();
}

void dressPatch(const MeshSurface& surface, const Segment& segment, const std::vector<uint32_t>& owner, uint32_t self,
                double step, PatchClosing closing, const std::function<bool()>& isStopped, Patch& patch) {
    Patcher(surface, segment, owner, self, step, closing).dress(patch, isStopped);
}

}  // namespace stipple::lod
