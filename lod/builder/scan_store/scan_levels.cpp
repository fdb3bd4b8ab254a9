#include "lod/builder/scan_store/scan_levels.h"

#include <algorithm>
#include <cmath>

#include "lod/builder/scan_store/patch_ground.h"

namespace stipple::lod {
namespace {

constexpr double kUnimportant = 0.1;  ///< steps: below that nobody looks closer

/// Calls use(i, j, sample, triangle) for those triangles of the drawn cells whose middles lie in a cube.
template <typename Use>
void forTriangles(const Patch& p, const glm::dvec3& corner, const glm::dvec3& lo, double edge, const Use& use) {
    const PatchSurface surface(p);
    const double slack = 1e-9 * edge;  // sums in another order round otherwise
    for (uint32_t j = 0; j + 1 < p.height; ++j)
        for (uint32_t i = 0; i + 1 < p.width; ++i) {
            if (!p.hasCell(i, j)) continue;
            surface.trianglesOf(i, j, [&](size_t a, size_t b, size_t c) {
                const PatchGround::Triangle t{corner + surface.position(a), corner + surface.position(b),
                                              corner + surface.position(c)};
                const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0 - lo;
                if (glm::all(glm::greaterThanEqual(middle, glm::dvec3(-slack))) &&
                    glm::all(glm::lessThanEqual(middle, glm::dvec3(edge + slack))))
                    use(i, j, a, t);
            });
        }
}

/// Samples beside no cell go.
void dropUnused(Patch& p) {
    std::vector<uint8_t> isUsed(p.heights.size(), 0);
    for (uint32_t j = 0; j + 1 < p.height; ++j)
        for (uint32_t i = 0; i + 1 < p.width; ++i)
            if (p.hasCell(i, j))
                for (const size_t s : {p.at(i, j), p.at(i + 1, j), p.at(i, j + 1), p.at(i + 1, j + 1)}) isUsed[s] = 1;
    for (size_t s = 0; s < isUsed.size(); ++s)
        if (isUsed[s] == 0) p.heights[s] = 0;
}

double keepWhatIsThere(const std::vector<ChildPatches>& children, const LevelSettings& settings, ScanPatches& made) {
    PatchGround ground;
    for (const ChildPatches& c : children) ground.add(*c.patches, c.corner);
    double most = kUnimportant * settings.step;
    uint32_t hint = 0;
    for (Patch& p : made.patches) {
        std::vector<uint8_t> cells = p.cells;
        forTriangles(p, settings.corner, settings.corner, settings.edge,
                     [&](uint32_t i, uint32_t j, size_t, const PatchGround::Triangle& t) {
                         uint8_t& cell = cells[size_t{j} * (p.width - 1) + i];
                         if (cell == 0) return;
                         const double d = ground.boundOf(t, settings.step, most, hint);
                         if (std::isfinite(d))
                             most = std::max(most, d);
                         else
                             cell = 0;
                     });
        if (cells == p.cells) continue;
        p.cells = std::move(cells);
        dropUnused(p);
    }
    for (size_t k = made.patches.size(); k-- > 0;) {
        if (made.patches[k].drawnCells() > 0) continue;
        made.patches.erase(made.patches.begin() + static_cast<ptrdiff_t>(k));
        made.isOwn.erase(made.isOwn.begin() + static_cast<ptrdiff_t>(k));
    }
    return most;
}

LeftDisc discOver(const PatchGround::Triangle& t, uint32_t colour) {
    LeftDisc d;
    d.place = (t[0] + t[1] + t[2]) / 3.0;
    double radius = 0;
    for (const glm::dvec3& p : t) radius = std::max(radius, glm::distance(p, d.place));
    d.radius = static_cast<float>(radius * (1 + 1e-6));
    const glm::dvec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const double length = glm::length(n);
    d.normal = length > 0 ? glm::vec3(n / length) : glm::vec3(0, 0, 1);
    d.colour = colour;
    return d;
}

}  // namespace

double agreeWithChildren(const std::vector<ChildPatches>& children, const LevelSettings& settings, ScanPatches& made,
                         std::vector<LeftDisc>& uncovered) {
    double most = keepWhatIsThere(children, settings, made);
    PatchGround ground;
    ground.add(made.patches, settings.corner);
    uint32_t hint = 0;
    for (const ChildPatches& c : children)
        for (const Patch& p : *c.patches)
            forTriangles(p, c.corner, c.corner, c.edge,
                         [&](uint32_t, uint32_t, size_t sample, const PatchGround::Triangle& t) {
                             const double d = ground.boundOf(t, settings.step, most, hint);
                             if (std::isfinite(d))
                                 most = std::max(most, d);
                             else
                                 uncovered.push_back(discOver(t, p.colours[sample]));
                         });
    return most;
}

}  // namespace stipple::lod
