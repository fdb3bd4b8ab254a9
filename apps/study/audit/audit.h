// The bound audit (ALGORITHMS 4): the place of each pixel (its depth, along the ray of its centre), its distance in
// space from the nearest full-detail surface, in pixels there (times F/Z; orthographic: over the pixel's size), against
// what the frame states, tau, and half a pixel, which is the sample's own.
#pragma once

#include <string>

#include "apps/study/audit/full_detail.h"
#include "engine/base/executor.h"

namespace stipple::study {

/// Half a pixel of the pixel's own, and what floats of depth may be off, px.
inline constexpr double kSamplePixels = 0.5;

struct Audit {
    uint64_t drawn = 0;       ///< pixels with depth
    double p50 = 0, p99 = 0;  ///< px, over those; nan without any
    double worst = 0;         ///< px; at most kAuditReach
    uint64_t worstPixel = 0;  ///< its index
    // Pixels farther away than stated and kSamplePixels, each in one class:
    uint64_t outline = 0;  ///< within two pixels of where nothing is drawn
    uint64_t gap = 0;      ///< the traced ray meets nothing there: a gap was closed
    uint64_t between = 0;  ///< between the nearest and farthest traced depths of the 5 x 5 pixels around
    uint64_t other = 0;
    uint64_t beyond() const { return outline + gap + between + other; }
    double share() const { return drawn > 0 ? static_cast<double>(beyond()) / static_cast<double>(drawn) : 0; }
};

/// Distances are not followed beyond that, px.
inline constexpr double kAuditReach = 64;

/// Where a pixel of a view lies: `depth` along the ray of its centre; world.
glm::dvec3 placeOf(const lod::View& view, size_t pixel, double depth);

/// `image` with depth; `traced`: the same view's, with depth, for classes. `stated`: px.
Audit auditDepths(const render::Image& image, const render::Image& traced, const lod::View& view,
                  const FullDetail& full, double stated, Executor& executor);

}  // namespace stipple::study
