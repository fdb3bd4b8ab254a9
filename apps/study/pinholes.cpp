#include "apps/study/pinholes.h"

#include <algorithm>
#include <cmath>

#include "apps/study/models.h"
#include "engine/base/process.h"
#include "engine/base/rng.h"

namespace stipple::study {
namespace {

using glm::dvec3;

dvec3 anyDirection(Rng& rng) {
    for (;;) {
        const dvec3 d(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
        const double length = glm::length(d);
        if (length > 0.1 && length < 1) return d / length;
    }
}

}  // namespace

Result<Pinholes> countPinholes(Drawer& sphere, uint32_t poses, uint32_t size) {
    Pinholes out;
    Rng rng(20);
    for (uint32_t pose = 0; pose < poses && !isStopRequested(); ++pose) {
        const dvec3 outwards = anyDirection(rng), side = anyDirection(rng);
        const double away = 1 + std::exp2(rng.uniform(-7, 2));
        const dvec3 eye = away * outwards;
        // Towards some place of the sphere that is seen; near it mostly the horizon.
        const dvec3 target = glm::normalize(outwards + std::min(1.0, 0.8 * (away - 1) + 0.2) * side);
        const dvec3 up =
            std::abs(glm::dot(glm::normalize(target - eye), dvec3(0, 0, 1))) < 0.9 ? dvec3(0, 0, 1) : dvec3(1, 0, 0);
        const lod::View view = viewFrom(eye, target, up, size, size);
        const double tau = pose % 2 == 0 ? 1 : kLeaves;
        for (const render::Reconstruction& r : render::reconstructions()) {
            STIPPLE_ASSIGN(const render::Image image, sphere.draw(view, settingsOf(r.mode, tau, false)));
            const bool isFirst = &r == render::reconstructions().data();
            uint64_t open = 0;
            for (size_t i = 0; i < image.depth.size(); ++i) {
                const double x = static_cast<double>(i % size) + 0.5 - 0.5 * size,
                             y = static_cast<double>(i / size) + 0.5 - 0.5 * size;
                const dvec3 ray = glm::normalize(view.forward + (x * view.right + y * view.down) / view.focalPixels);
                const double along = -glm::dot(eye, ray);
                if (along <= 0 || glm::length(eye + along * ray) > 0.97) continue;
                out.looked += isFirst;
                open += image.depth[i] <= 0;
            }
            out.open[r.mode] += open;
        }
    }
    if (isStopRequested()) return fail(ErrorKind::interrupted, "interrupted", "the study");
    return out;
}

}  // namespace stipple::study
