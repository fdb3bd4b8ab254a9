// Refraction: a layer of glass (layers.h) is lit by what it reflects and by what is seen through it. Only frames of
// such layers have it; theirs is the light of the frame, so that no other effect of light runs in them.
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "engine/render/layers.h"
#include "shaders/shared/bindings.h"

namespace stipple::render {

extern const Effect lightEffect, environmentEffect;

namespace {

constexpr std::array kPasses{Pass::refract};
constexpr std::array kTables{shared::kLayerBinding, shared::kOpticsBinding, shared::kBehindBinding,
                             shared::kBackBinding};

void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    lightEffect.fill(settings, cameraFromWorld, out);
    if (settings.environment) environmentEffect.fill(settings, cameraFromWorld, out);
    auto tables = std::make_shared<LayerTables>();
    fillLayer(*settings.layer, out, *tables);
    out.glass = std::move(tables);
    out.layer = settings.layer;
}

}  // namespace

extern const Effect refractionEffect;
constinit const Effect refractionEffect{.name = "refraction",
                                        .summary = "glass and water: what is behind them, bent",
                                        .isRequested = [](const DrawSettings& s) { return s.layer != nullptr; },
                                        .option = "--material, or a material",
                                        .ofFrame = [](const EffectFrame& frame) { return !frame.content.isEmpty(); },
                                        .fill = fill,
                                        .stage = Stage::light,
                                        .passes = kPasses,
                                        .tables = kTables};

}  // namespace stipple::render
