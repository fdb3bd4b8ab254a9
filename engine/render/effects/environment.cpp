// Environment: a picture of the surroundings (environment.h) in the place of the plain sky. Light's pass reads its
// table.
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/bindings.h"

namespace stipple::render {

bool isLit(const EffectFrame& frame);  // effects/light.cpp

namespace {

constexpr std::array kTables{shared::kEnvironmentBinding};

void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    shared::FrameConstants& f = out.frame;
    const glm::dmat3 axes = environmentAxes(settings.worldUp);
    f.environmentX = glm::vec3(cameraFromWorld * axes[0]);
    f.environmentY = glm::vec3(cameraFromWorld * axes[1]);
    f.environmentZ = glm::vec3(cameraFromWorld * axes[2]);
    f.hasEnvironment = 1;
    f.environmentSharp = settings.environment->sharpEdge;
    f.ambient = 1;
    out.environment = settings.environment;
}

}  // namespace

extern const Effect environmentEffect;
constinit const Effect environmentEffect{.name = "environment",
                                         .summary = "light and reflections of an HDR picture",
                                         .isRequested = [](const DrawSettings& s) { return s.environment != nullptr; },
                                         .option = "--environment",
                                         .ofFrame = isLit,
                                         .fill = fill,
                                         .stage = Stage::light,
                                         .tables = kTables};

}  // namespace stipple::render
