// Environment: a picture of the surroundings (environment.h) in the place of the plain sky. Light's pass reads its
// table.
#include <array>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/bindings.h"

namespace stipple::render {

bool isLit(const EffectFrame& frame);  // effects/light.cpp

namespace {

constexpr std::array kTables{shared::kEnvironmentBinding};

/// The environment's y is the scene's up, its -z as near to the scene's as that allows.
void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    shared::FrameConstants& f = out.frame;
    const glm::dvec3 up = glm::normalize(settings.worldUp);
    const glm::dvec3 aside = std::abs(up.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
    const glm::dvec3 back = glm::normalize(glm::cross(aside, up)), right = glm::cross(up, back);
    f.environmentX = glm::vec3(cameraFromWorld * right);
    f.environmentY = glm::vec3(cameraFromWorld * up);
    f.environmentZ = glm::vec3(cameraFromWorld * back);
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
