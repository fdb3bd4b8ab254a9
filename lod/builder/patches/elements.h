// What patches are made of: small pieces of surface, points or triangles, each with its neighbours.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace stipple::lod {

/// In an order that hangs on the places alone (Morton), so that neither the order of the input nor threads show.
struct SurfaceElements {
    std::vector<glm::dvec3> centre;   ///< scene units, about the middle of all
    std::vector<glm::vec3> normal;    ///< unit
    std::vector<double> area;         ///< squared scene units
    std::vector<uint32_t> firstLink;  ///< one more than elements
    std::vector<uint32_t> link;       ///< neighbours, either way
    size_t size() const { return centre.size(); }
    std::span<const uint32_t> links(size_t i) const {
        return {link.data() + firstLink[i], link.data() + firstLink[i + 1]};
    }
};

/// Pairs (either way) as lists of neighbours, each sorted, none twice.
void setLinks(std::vector<std::pair<uint32_t, uint32_t>> pairs, SurfaceElements& elements);

/// Elements that become one patch, ascending.
using Segment = std::vector<uint32_t>;

}  // namespace stipple::lod
