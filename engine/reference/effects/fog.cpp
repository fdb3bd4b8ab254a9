// Fog once more, in fp64: the integral of the density over the way from the eye, by its heights at both ends.
#include <cmath>

#include "engine/reference/decode.h"
#include "engine/reference/effects/effects.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/fog.h"

namespace stipple::reference {
namespace {

glm::dvec3 onSent(const render::DrawList& draws, const glm::dvec3& sent, const glm::dvec2& pixel, double depth) {
    const auto& f = *draws.tableAt<shared::FogConstants>(shared::kFogBinding);
    const ViewRay ray = viewRay(draws.view, pixel);
    const double before = draws.view.isOrthographic ? draws.eyeAdvanced : 0;
    const glm::dvec3 end = ray.at(depth), begin = draws.view.isOrthographic ? ray.at(-before) : glm::dvec3(0);
    const double way = glm::length(end - begin);
    double mean = 1;  // of the density, over that at the eye's height
    if (f.inverseHeight > 0) {
        const glm::dvec3 up(f.up);
        const auto heights = [&](const glm::dvec3& p) { return glm::dot(up, p) * f.inverseHeight; };
        const double low = heights(begin), high = heights(end), rise = high - low;
        mean = std::abs(rise) < 1e-9 ? std::exp(-low) : std::exp(-low) * -std::expm1(-rise) / rise;
    }
    const glm::dvec3 through = glm::exp(-glm::dvec3(f.density) * way * mean);
    return through * sent + (1.0 - through) * glm::dvec3(f.colour);
}

}  // namespace

constinit const RestatedEffect fogRestated{.onSent = onSent};

}  // namespace stipple::reference
