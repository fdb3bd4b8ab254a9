// Ambient occlusion: creases and what lies below something get less of the light from all around
// (shaders/shared/occlusion.h). Asked for by name, for no scene is unreadable without it. It is part of light: what
// keeps its colours (unlit) keeps them.
#include <algorithm>
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/occlusion.h"

namespace stipple::render {

bool isLit(const EffectFrame& frame);  // effects/light.cpp

namespace {

constexpr std::array kPasses{Pass::occlusion};
constexpr std::array kTables{shared::kOcclusionBinding};
constexpr std::array kDetail{"half", "full"};
constexpr std::array kParameters{
    Parameter{"radius",
              "how far away things take light from each other, world units (0: a 50th of what the largest file covers)",
              0,
              1e15,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.occlusion.radius; }},
    Parameter{"detail", "of every pixel (full), or of every second one both ways, which is quicker", 0, 0, 1, kDetail,
              [](DrawSettings& s) { return &s.parameters.occlusion.detail; }}};

/// World units.
double radiusOf(const DrawSettings& s) {
    constexpr double kShare = 0.02, kMost = 1e15;
    if (s.parameters.occlusion.radius > 0) return std::min(s.parameters.occlusion.radius, kMost);
    // (A single point has no extent.)
    const double extent = s.parameters.facts.extent;
    return extent > 0 ? std::min(kShare * extent, kMost) : 1;
}

uint32_t edgeOf(const DrawSettings& s) { return s.parameters.occlusion.detail == 1 ? 1 : 2; }

/// A radius that is less than a pixel everywhere hides nothing (aoPlace).
bool isSeen(const EffectFrame& frame) {
    const lod::View& view = frame.draws.view;
    const double pixels = view.focalPixels / (view.isOrthographic ? 1 : view.nearPlane);
    return isLit(frame) && radiusOf(frame.settings) * pixels > 1;
}

void fill(const DrawSettings& settings, const glm::dmat3&, DrawList& out) {
    const shared::OcclusionConstants c{static_cast<float>(radiusOf(settings)), edgeOf(settings)};
    out.addTable<shared::OcclusionConstants>(shared::kOcclusionBinding, {&c, 1});
}

/// Two of each pixel that is asked.
uint64_t openness(const DrawList& draws) {
    const uint32_t edge = draws.tableAt<shared::OcclusionConstants>(shared::kOcclusionBinding)->edge;
    const auto asked = [&](uint32_t n) { return uint64_t{(n + edge - 1) / edge}; };
    return 2 * asked(draws.frame.width) * asked(draws.frame.height);
}

constexpr std::array kPlanes{EffectPlane{shared::kOpenBinding, openness}};

}  // namespace

extern const Effect occlusionEffect;
constinit const Effect occlusionEffect{
    .name = "occlusion",
    .summary = "ambient occlusion: less light from all around in creases and below things",
    .isRequested = nullptr,
    .parameters = kParameters,
    .ofScene = [](const EffectScene& scene) { return !scene.instances.empty(); },
    .ofFrame = isSeen,
    .ofNode = nullptr,
    .fill = fill,
    .stage = Stage::surface,
    .passes = kPasses,
    .tables = kTables,
    .planes = kPlanes,
    .tolerancePixels = 0,
    .toleranceSteps = 0};

}  // namespace stipple::render
