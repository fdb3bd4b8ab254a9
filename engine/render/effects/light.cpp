// Light: a sun over the viewer's shoulder, or lights of the scene's own, on what is not drawn as it is.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "engine/render/kinds/kind.h"
#include "shaders/shared/bindings.h"

namespace stipple::render {
namespace {

constexpr std::array kPasses{Pass::light};
constexpr std::array kTables{shared::kLightsBinding};

void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    constexpr double kPi = 3.14159265358979323846;
    constexpr float kAmbientBesideLights = 0.2f;
    for (const WorldLight& light : settings.lights) {
        shared::LightSource l{};
        const glm::dvec3 axis = cameraFromWorld * light.direction;
        const bool isFar = light.kind == shared::kLightDirectional;
        l.position = glm::vec3(isFar ? -axis : cameraFromWorld * (light.position - out.view.eye));
        l.kind = light.kind;
        l.colour = light.colour * static_cast<float>(1 / kPi);
        l.range = light.range;
        l.axis = glm::vec3(axis);
        l.cosInner = std::cos(light.innerCone);
        l.cosOuter = std::cos(light.outerCone);
        out.lights.push_back(l);
    }
    out.frame.lightCount = static_cast<uint32_t>(out.lights.size());
    const bool isSunny =
        std::any_of(settings.lights.begin(), settings.lights.end(), [](const auto& l) { return l.isSun; });
    if (!out.lights.empty() && !isSunny) out.frame.ambient = kAmbientBesideLights;
}

}  // namespace

bool isLit(const EffectFrame& frame) {
    const DrawSettings& s = frame.settings;
    bool isAnyLit = false;
    forEachKind([&](lod::Kind kind) { isAnyLit = isAnyLit || (frame.content.has(kind) && drawnKind(kind).isLit(s)); });
    return s.debugView == shared::kDebugNone && s.layer == nullptr && isAnyLit;
}

extern const Effect lightEffect;
constinit const Effect lightEffect{.name = "light",
                                   .summary = "a sun, or the scene's own lights",
                                   .isRequested = [](const DrawSettings& s) { return s.lit || !s.unlitTriangles; },
                                   .option = "--shade",
                                   .ofFrame = isLit,
                                   .fill = fill,
                                   .stage = Stage::light,
                                   .passes = kPasses,
                                   .tables = kTables};

}  // namespace stipple::render
