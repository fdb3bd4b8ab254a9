#include "lod/builder/mesh/triangle_grid.h"

#include <algorithm>
#include <cmath>

#include "engine/base/lanes.h"
#include "engine/base/wide.h"
#include "lod/primitives/triangle.h"

namespace stipple::lod {
namespace {

constexpr float kMostCells = 48;  ///< along an axis
constexpr float kMostSquare = 1e38f, kMostDistance = 1e19f;
constexpr uint64_t kMostItems = 16;  ///< a triangle, on average; needles that lie across the axes would be everywhere

}  // namespace

/// Least square of a distance from items [first, last) and, as eight are looked at at once, some behind them. The
/// numbers are those of closestWeights(), of whose cases the first that holds counts: here they stand the other way
/// round, and each takes the place of those before it.
STIPPLE_WIDE static float leastSquare(const TriangleGrid::Columns& columns, size_t first, size_t last,
                                      const float (&p)[3]) {
    const float px = p[0], py = p[1], pz = p[2];
    Floats least = Floats{} + kMostSquare;
    for (; first < last; first += kLanes) {
        const auto* const at = columns.data();
        const Floats ax = floatsAt(at[0].data(), first).v, ay = floatsAt(at[1].data(), first).v,
                     az = floatsAt(at[2].data(), first).v, bx = floatsAt(at[3].data(), first).v,
                     by = floatsAt(at[4].data(), first).v, bz = floatsAt(at[5].data(), first).v,
                     cx = floatsAt(at[6].data(), first).v, cy = floatsAt(at[7].data(), first).v,
                     cz = floatsAt(at[8].data(), first).v;
        const Floats abx = bx - ax, aby = by - ay, abz = bz - az, acx = cx - ax, acy = cy - ay, acz = cz - az;
        const Floats apx = px - ax, apy = py - ay, apz = pz - az, bpx = px - bx, bpy = py - by, bpz = pz - bz,
                     cpx = px - cx, cpy = py - cy, cpz = pz - cz;
        const Floats d1 = abx * apx + aby * apy + abz * apz, d2 = acx * apx + acy * apy + acz * apz,
                     d3 = abx * bpx + aby * bpy + abz * bpz, d4 = acx * bpx + acy * bpy + acz * bpz,
                     d5 = abx * cpx + aby * cpy + abz * cpz, d6 = acx * cpx + acy * cpy + acz * cpz;
        const Floats va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2, all = va + vb + vc;
        const Floats alongB = d4 - d3, alongC = d5 - d6;
        const auto isBC = (va <= 0) & (alongB >= 0) & (alongC >= 0), isAC = (vb <= 0) & (d2 >= 0) & (d6 <= 0),
                   isAB = (vc <= 0) & (d1 >= 0) & (d3 <= 0);
        const auto isA = (d1 <= 0) & (d2 <= 0), isB = (d3 >= 0) & (d4 <= d3), isC = (d6 >= 0) & (d5 <= d6);
        const Floats partB = isAB ? d1 : vb, wholeB = isAB ? d1 - d3 : all;
        const Floats partC = isAC ? d2 : isBC ? alongB : vc, wholeC = isAC ? d2 - d6 : isBC ? alongB + alongC : all;
        const Floats none = Floats{}, one = none + 1.0f;
        const Floats shareB = wholeB > 0 ? partB / wholeB : none, shareC = wholeC > 0 ? partC / wholeC : none;
        Floats b = isAC ? none : isBC ? one - shareC : shareB, c = shareC;
        b = isC ? none : b;
        c = isC ? one : c;
        b = isAB ? shareB : b;
        c = isAB ? none : c;
        b = isB ? one : b;
        c = isB ? none : c;
        b = isA ? none : b;
        c = isA ? none : c;
        const Floats dx = px - (ax + b * abx + c * acx), dy = py - (ay + b * aby + c * acy),
                     dz = pz - (az + b * abz + c * acz);
        const Floats square = dx * dx + dy * dy + dz * dz;
        least = square < least ? square : least;
    }
    return leastOf(least);
}

TriangleGrid::TriangleGrid(const std::vector<glm::vec3>& position, const std::vector<uint32_t>& indices, bool wantsEach)
    : position_(position), indices_(indices) {
    glm::vec3 lo(3e38f), hi(-3e38f);
    double area = 0;
    const auto triangles = static_cast<uint32_t>(indices.size() / 3);
    for (uint32_t t = 0; t < triangles; ++t) {
        for (size_t k = 0; k < 3; ++k) {
            lo = glm::min(lo, corner(t, k));
            hi = glm::max(hi, corner(t, k));
        }
        area += 0.5 *
                static_cast<double>(glm::length(glm::cross(corner(t, 1) - corner(t, 0), corner(t, 2) - corner(t, 0))));
    }
    const float cell =
        std::max({static_cast<float>(std::sqrt(area / std::max(1.0, static_cast<double>(triangles))) * 2.0),
                  std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z}) / kMostCells, 1e-3f});
    chooseCells(lo, hi, cell);
    placeItems();
    if (wantsEach) makeSpheres();
}

/// Of that edge, or of twice as much, and so on, until there are few enough items.
void TriangleGrid::chooseCells(const glm::vec3& lo, const glm::vec3& hi, float edge) {
    lo_ = lo;
    const uint64_t triangles = indices_.size() / 3;
    for (uint64_t items = ~uint64_t{0}; items > kMostItems * triangles + 64; edge *= 2) {
        edge_ = edge;
        perCell_ = 1 / edge;
        for (int a = 0; a < 3; ++a) size_[a] = 1 + static_cast<int>((hi[a] - lo[a]) * perCell_);
        items = 0;
        for (uint32_t t = 0; t < triangles; ++t) {
            const glm::u64vec3 cells(lastCell(t) - firstCell(t) + 1);
            items += cells.x * cells.y * cells.z;
        }
    }
}

glm::ivec3 TriangleGrid::firstCell(uint32_t t) const {
    return cellOf(glm::min(corner(t, 0), glm::min(corner(t, 1), corner(t, 2))));
}
glm::ivec3 TriangleGrid::lastCell(uint32_t t) const {
    return cellOf(glm::max(corner(t, 0), glm::max(corner(t, 1), corner(t, 2))));
}

void TriangleGrid::placeItems() {
    start_.assign(static_cast<size_t>(size_.x) * static_cast<size_t>(size_.y) * static_cast<size_t>(size_.z) + 1, 0);
    const auto forCells = [&](const auto& use) {
        for (uint32_t t = 0; t < indices_.size() / 3; ++t) {
            const glm::ivec3 from = firstCell(t), to = lastCell(t);
            for (int z = from.z; z <= to.z; ++z)
                for (int y = from.y; y <= to.y; ++y)
                    for (int x = from.x; x <= to.x; ++x) use(t, start_[number(x, y, z)]);
        }
    };
    forCells([](uint32_t, uint32_t& count) { ++count; });
    uint32_t sum = 0;
    for (uint32_t& s : start_) s = sum += s;
    items_.resize(sum);
    // (What stands behind the last is looked at with it.)
    std::array<float*, 9> to{};
    for (size_t k = 0; k < columns_.size(); ++k) {
        columns_.at(k).resize(items_.size() + kLanes - 1);
        to.at(k) = columns_.at(k).data();
    }
    forCells([&](uint32_t t, uint32_t& at) {
        items_[--at] = t;
        for (size_t k = 0; k < 3; ++k) {
            const glm::vec3& from = corner(t, k);
            to[3 * k][at] = from.x;
            to[3 * k + 1][at] = from.y;
            to[3 * k + 2][at] = from.z;
        }
    });
    for (std::vector<float>& column : columns_)
        for (size_t i = items_.size(); i < column.size() && i > 0; ++i) column[i] = column[i - 1];
}

void TriangleGrid::makeSpheres() {
    spheres_.resize(indices_.size() / 3);
    for (uint32_t t = 0; t < spheres_.size(); ++t) {
        const glm::vec3 &a = corner(t, 0), &b = corner(t, 1), &c = corner(t, 2);
        const glm::vec3 m = (a + b + c) * (1.0f / 3);
        const float r = std::max({glm::length(a - m), glm::length(b - m), glm::length(c - m)});
        spheres_[t] = glm::vec4(m, r * 1.00001f + 1e-6f);
    }
}

float TriangleGrid::leastInRow(const glm::vec3& p, int x0, int x1, int y, int z) const {
    return std::sqrt(leastSquare(columns_, start_[number(x0, y, z)], start_[number(x1, y, z) + 1], {p.x, p.y, p.z}));
}

float TriangleGrid::distance(const glm::vec3& p, uint32_t t) const {
    const glm::vec3 &a = corner(t, 0), &b = corner(t, 1), &c = corner(t, 2);
    const glm::vec2 w = closestWeights(p, a, b, c);
    return glm::length(p - (a + w.x * (b - a) + w.y * (c - a)));
}

float TriangleGrid::leastDistance(const glm::vec3& p, uint32_t hint, float enough) const {
    // What lies in the same cell first: the ball is much smaller afterwards.
    const glm::ivec3 own = cellOf(p);
    const size_t cell = number(own.x, own.y, own.z);
    // (What is no number is not less than that.)
    float least = start_[cell] == start_[cell + 1] ? std::min(kMostDistance, distance(p, hint))
                                                   : leastInRow(p, own.x, own.x, own.y, own.z);
    if (least <= enough) return least;
    const glm::ivec3 from = cellOf(p - least), to = cellOf(p + least);
    if (from == to) return least;
    // How far a row is at least, a little less for what rounding makes of it: along y and along z. (Cells at the border
    // hold what lies beyond, too.)
    const auto off = [&](int a, int at) {
        const float first = lo_[a] + static_cast<float>(at) * edge_;
        const float below = first - p[a], above = at + 1 < size_[a] ? p[a] - (first + edge_) : 0;
        return std::max({0.0f, below, above}) - 0.01f * edge_;
    };
    for (int z = from.z; z <= to.z; ++z) {
        if (off(2, z) > least) continue;
        for (int y = from.y; y <= to.y; ++y) {
            if (off(1, y) > least) continue;
            least = std::min(least, leastInRow(p, from.x, to.x, y, z));
            if (least <= enough) return least;
        }
    }
    return least;
}

}  // namespace stipple::lod
