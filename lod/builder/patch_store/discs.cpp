#include "lod/builder/patch_store/discs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace stipple::lod {
namespace {

LeftDisc united(const std::vector<LeftDisc>& discs) {
    LeftDisc one;
    glm::dvec3 place(0), normal(0), colour(0);
    double weight = 0;
    for (const LeftDisc& d : discs) {
        const double area = double{d.radius} * double{d.radius};
        weight += area;
        place += area * d.place;
        normal += area * glm::dvec3(d.normal);
        for (int a = 0; a < 3; ++a) colour[a] += area * static_cast<double>(d.colour >> (8 * a) & 255u);
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

}  // namespace

double uniteDiscs(std::vector<LeftDisc>& discs, double edge) {
    std::map<std::array<int64_t, 3>, std::vector<LeftDisc>> cells;
    for (const LeftDisc& d : discs) {
        const glm::dvec3 c = glm::floor(d.place / edge);
        cells[{static_cast<int64_t>(c.z), static_cast<int64_t>(c.y), static_cast<int64_t>(c.x)}].push_back(d);
    }
    discs.clear();
    double largest = 0;
    for (const auto& [key, in] : cells) {
        discs.push_back(united(in));
        largest = std::max(largest, double{discs.back().radius});
    }
    return largest;
}

}  // namespace stipple::lod
