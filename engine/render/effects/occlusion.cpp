// Ambient occlusion: creases and what lies below something get less of the light from all around
// (shaders/shared/occlusion.h). Asked for by name, for no scene is unreadable without it. It is part of light: what
// keeps its colours (unlit) keeps them.
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"

namespace stipple::render {

bool isLit(const EffectFrame& frame);  // effects/light.cpp

namespace {

constexpr std::array kPasses{Pass::occlusion};

/// A radius that is less than a pixel everywhere hides nothing (aoPlace).
bool isSeen(const EffectFrame& frame) {
    return isLit(frame) && frame.settings.occlusion.radius * frame.content.nearestPixels > 1;
}

void fill(const DrawSettings& settings, const glm::dmat3&, DrawList& out) {
    out.frame.aoRadius = static_cast<float>(settings.occlusion.radius);
    out.frame.aoEdge = settings.occlusion.isFull ? 1 : 2;
}

}  // namespace

extern const Effect occlusionEffect;
constinit const Effect occlusionEffect{
    .name = "occlusion",
    .summary = "ambient occlusion: less light from all around in creases and below things (--occlusion-radius)",
    .isRequested = nullptr,
    .ofScene = [](const EffectScene& scene) { return !scene.instances.empty(); },
    .ofFrame = isSeen,
    .ofNode = nullptr,
    .fill = fill,
    .stage = Stage::surface,
    .passes = kPasses,
    .tolerancePixels = 0,
    .toleranceSteps = 0};

}  // namespace stipple::render
