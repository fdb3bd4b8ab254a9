// Looks up the input point nearest to a place: exact integers, whatever the level of detail on the screen.
#pragma once

#include <optional>

#include "lod/store/store.h"

namespace stipple::lod {

struct NearestPoint {
    uint32_t node = 0, record = 0;
    std::array<uint64_t, 3> lattice{};  ///< steps from the store's origin
    glm::dvec3 position{0};             ///< world units
    double distance = 0;
    shared::PointRecord packed{};
    std::vector<double> attributes;  ///< in the order of StoreDescription::attributes
};

/// The leaf point nearest to `place` (world units); of equally near ones the first in storage order.
/// Largest radius among the leaf records of a store, world units: how far the discs of samples reach from their
/// surface.
Result<double> largestLeafRadius(const Store& store);

Result<NearestPoint> findNearest(const Store& store, const glm::dvec3& place);

}  // namespace stipple::lod
