// The environment's picture behind everything once more, in fp64 (../surroundings.cpp has how it is looked up).
#include <cmath>

#include "engine/reference/decode.h"
#include "engine/reference/effects/effects.h"
#include "engine/reference/surroundings.h"
#include "shaders/shared/bindings.h"

namespace stipple::reference {
namespace {

using glm::dvec3;

dvec3 behind(const render::DrawList& draws, const glm::dvec2& pixel) {
    const auto& c = *draws.tableAt<shared::BackgroundConstants>(shared::kBackgroundBinding);
    const dvec3 ray = viewRay(draws.view, pixel).direction;
    const dvec3 d(glm::dot(dvec3(c.axisX), ray), glm::dot(dvec3(c.axisY), ray), glm::dot(dvec3(c.axisZ), ray));
    const double angle =
        draws.view.isOrthographic ? 0 : std::pow(glm::dot(ray, ray), -0.75) / draws.view.focalPixels;  // of the pixel
    return tonedLight(c.tone, lightFrom(*draws.backdrop, d, angle));
}

}  // namespace

constinit const RestatedEffect backgroundRestated{.behind = behind};

}  // namespace stipple::reference
