// Silhouettes and normals of a statue's discs, at the leaves, against the surface that they were sampled from and
// against the discs themselves, both traced.
#pragma once

#include <functional>
#include <vector>

#include "apps/study/measure.h"
#include "apps/study/models.h"

namespace stipple::study {

struct OutlineRow {
    double spacingPixels = 0;
    uint64_t points = 0;
    std::string what;        ///< a mode, or "traced discs"
    double overlap = 0;      ///< IoU with the surface
    double distance = 0;     ///< mean distance of the outlines, px: the area between them over their length
    double outside = 0;      ///< of that distance, what lies outside of the surface's outline, px
    double normal = 0;       ///< mean angle to the surface's normals where both are seen, degrees
    double discOverlap = 0;  ///< IoU with the traced discs
    double discNormal = 0;   ///< mean angle to the normals of the traced discs
};

struct OutlineSettings {
    std::vector<double> spacings{1, 4, 12};  ///< px
    uint32_t size = 600;                     ///< px
    std::vector<double> azimuths{20, 140, 260};
    std::string folder;  ///< for stores
};
using MakeBackend = std::function<Result<std::unique_ptr<render::Backend>>()>;

Result<std::vector<OutlineRow>> measureOutlines(const Surface& statue, const OutlineSettings& settings,
                                                const MakeBackend& backend, Executor& executor);

}  // namespace stipple::study
