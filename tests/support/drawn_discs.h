// What discs cover and where they are, by brute force in fp64: rays of pixels' centres against every disc near them,
// distances of places from the nearest disc. Decoded from the stored records; it knows nothing of slopes, pyramids and
// kernels.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "apps/study/audit/nearest_field.h"
#include "engine/reference/decode.h"
#include "engine/render/frame.h"
#include "lod/store/store.h"
#include "tests/support/support.h"

namespace stipple::test {

/// Discs of any size and direction in a cube of edge 2, of any colours.
std::vector<TestPoint> anyDiscs(size_t count, uint64_t seed);

/// All leaf records of a store.
std::vector<reference::Disc> leafDiscs(const lod::Store& store);
/// The records that a frame of this one store draws, with the radii that it draws them with.
std::vector<reference::Disc> discsOfCut(const lod::Store& store, const render::FrameState& state);

/// Direction of the ray through a place on the image, with z = 1 along `forward`, so that t is depth; world space.
glm::dvec3 rayThrough(const lod::View& view, double x, double y);

/// Which discs the rays of all pixels' centres meet.
struct RayHits {
    uint32_t width = 0, height = 0;
    std::vector<std::vector<double>> depths;  ///< of each pixel, nearest first
    bool isCovered(size_t pixel) const { return !depths[pixel].empty(); }
};
/// Rays against discs as the frame draws them: at least `leastPixels` in radius, those of strays at most a 128th of the
/// picture's height (4 pixels); a disc of one side only from there; without a normal it faces the eye.
RayHits hitDiscs(const std::vector<reference::Disc>& discs, const lod::View& view, double leastPixels = 1);

/// Distance of a place from one disc; without a normal it is a ball.
double distanceTo(const reference::Disc& disc, const glm::dvec3& place);

/// Distances from the nearest of many discs.
struct OfDiscs {
    using Item = reference::Disc;
    static void grow(const reference::Disc& d, glm::dvec3& lo, glm::dvec3& hi) {
        lo = glm::min(lo, d.position - d.radius);
        hi = glm::max(hi, d.position + d.radius);
    }
    static double along(const reference::Disc& d, int axis) { return d.position[axis]; }
    static double distance(const reference::Disc& d, const glm::dvec3& place) { return distanceTo(d, place); }
};
using DiscField = study::NearestField<OfDiscs>;

}  // namespace stipple::test
