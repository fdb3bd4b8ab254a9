#include "apps/study/audit/audit.h"

#include <algorithm>
#include <cmath>

#include "apps/study/statistics/intervals.h"

namespace stipple::study {
namespace {

/// What is traced in the 5 x 5 pixels around one.
struct Around {
    bool isBesideNothing = false;
    double nearest = kAuditReach * 1e300, farthest = 0;
};
Around lookAround(const render::Image& image, const render::Image& traced, size_t pixel) {
    Around a;
    const int64_t w = image.width, h = image.height;
    for (int64_t k = 0; k < 25; ++k) {
        const int64_t x = static_cast<int64_t>(pixel) % w + k % 5 - 2, y = static_cast<int64_t>(pixel) / w + k / 5 - 2;
        if (x < 0 || y < 0 || x >= w || y >= h) continue;
        const auto at = static_cast<size_t>(y * w + x);
        a.isBesideNothing = a.isBesideNothing || !(image.depth[at] > 0);
        const double z = traced.depth[at];
        if (!(z > 0)) continue;
        a.nearest = std::min(a.nearest, z);
        a.farthest = std::max(a.farthest, z);
    }
    return a;
}

uint64_t& classOf(Audit& audit, const render::Image& image, const render::Image& traced, size_t i, double slack) {
    const Around around = lookAround(image, traced, i);
    if (around.isBesideNothing) return audit.outline;
    if (!(traced.depth[i] > 0)) return audit.gap;
    const double z = image.depth[i];
    return around.nearest - slack < z && z < around.farthest + slack ? audit.between : audit.other;
}

}  // namespace

glm::dvec3 placeOf(const lod::View& view, size_t pixel, double depth) {
    const double x = static_cast<double>(pixel % view.width) + 0.5 - 0.5 * view.width;
    const double y = static_cast<double>(pixel / view.width) + 0.5 - 0.5 * view.height;
    const double scale = view.isOrthographic ? 1 / view.focalPixels : depth / view.focalPixels;
    return view.eye + depth * view.forward + scale * (x * view.right + y * view.down);
}

Audit auditDepths(const render::Image& image, const render::Image& traced, const lod::View& view,
                  const FullDetail& full, double stated, Executor& executor) {
    std::vector<float> away(image.depth.size(), -1);
    executor.parallelFor(away.size(), 256, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const double z = image.depth[i];
            if (!(z > 0)) continue;
            const double pixel = view.isOrthographic ? 1 / view.focalPixels : z / view.focalPixels;
            away[i] = static_cast<float>(full.distance(placeOf(view, i, z), kAuditReach * pixel) / pixel);
        }
    });
    Audit audit;
    std::vector<double> all;
    for (size_t i = 0; i < away.size(); ++i) {
        const double d = away[i];
        if (d < 0) continue;
        all.push_back(d);
        if (d > audit.worst) {
            audit.worst = d;
            audit.worstPixel = i;
        }
        if (d <= stated + kSamplePixels) continue;
        const double pixel = view.isOrthographic ? 1 / view.focalPixels : double{image.depth[i]} / view.focalPixels;
        ++classOf(audit, image, traced, i, (stated + kSamplePixels) * pixel);
    }
    audit.drawn = all.size();
    audit.p50 = quantile(all, 0.5);
    audit.p99 = quantile(all, 0.99);
    return audit;
}

}  // namespace stipple::study
