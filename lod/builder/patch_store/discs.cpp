#include "lod/builder/patch_store/discs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "lod/primitives/patch_map.h"

namespace stipple::lod {
namespace {

LeftDisc united(std::span<const LeftDisc> discs) {
    LeftDisc one;
    glm::dvec3 place(0), normal(0), colour(0);
    double weight = 0;
    for (const LeftDisc& d : discs) {
        const double area = double{d.radius} * double{d.radius};
        weight += area;
        place += area * d.place;
        normal += area * glm::dvec3(d.normal);
        const uint32_t seen = withEmission(d.colour, d.light);
        for (int a = 0; a < 3; ++a) colour[a] += area * static_cast<double>(seen >> (8 * a) & 255u);
    }
    one.place = place / weight;
    const double length = glm::length(normal);
    one.normal = length > 1e-6 * weight ? glm::vec3(normal / length) : discs.front().normal;
    double reach = 0;
    for (const LeftDisc& d : discs) reach = std::max(reach, glm::distance(d.place, one.place) + double{d.radius});
    one.radius = static_cast<float>(reach * (1 + 1e-6));
    for (int a = 0; a < 3; ++a)
        one.colour |= static_cast<uint32_t>(std::clamp(colour[a] / weight + 0.5, 0.0, 255.0)) << (8 * a);
    return one;
}

struct InCell {
    uint64_t cell;  ///< as a number; those far out share one with others
    uint32_t disc;
};
/// By cells, in each in their order.
std::vector<InCell> byCell(const std::vector<LeftDisc>& discs, double edge) {
    constexpr uint64_t kAxis = (uint64_t{1} << 21) - 1;
    std::vector<InCell> out;
    out.reserve(discs.size());
    for (uint32_t k = 0; k < discs.size(); ++k) {
        const glm::dvec3 c = glm::floor(discs[k].place / edge);
        const auto along = [&](int a) { return static_cast<uint64_t>(static_cast<int64_t>(c[a])) & kAxis; };
        out.push_back({along(2) << 42 | along(1) << 21 | along(0), k});
    }
    std::sort(out.begin(), out.end(),
              [](const InCell& a, const InCell& b) { return a.cell != b.cell ? a.cell < b.cell : a.disc < b.disc; });
    return out;
}
size_t countCells(const std::vector<InCell>& order) {
    size_t cells = 0;
    for (size_t k = 0; k < order.size(); ++k) cells += k == 0 || order[k].cell != order[k - 1].cell ? 1 : 0;
    return cells;
}

}  // namespace

double uniteDiscs(std::vector<LeftDisc>& discs, double edge, size_t most) {
    constexpr double kCoarser = 1.25;
    std::vector<InCell> order = byCell(discs, edge);
    while (discs.size() > most && countCells(order) > most) order = byCell(discs, edge *= kCoarser);
    std::vector<LeftDisc> out, in;
    double largest = 0;
    for (size_t first = 0, end = 0; first < order.size(); first = end) {
        in.clear();
        for (end = first; end < order.size() && order[end].cell == order[first].cell; ++end)
            in.push_back(discs[order[end].disc]);
        out.push_back(united(in));
        largest = std::max(largest, double{out.back().radius});
    }
    discs = std::move(out);
    return largest;
}

}  // namespace stipple::lod
