// The environment's picture behind everything (shaders/shared/background.h): where nothing is seen, and as a part of
// what is covered in part. It is light as that of surfaces is: tone is on it, too. (Fog is not: it has the picture's
// mean as its colour.) Of a frame of layers (layers.h) what lies behind them has it.
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/background.h"
#include "shaders/shared/bindings.h"

namespace stipple::render {
namespace {

constexpr std::array kPasses{Pass::background};
constexpr std::array kTables{shared::kBackgroundBinding, shared::kBackdropBinding};

void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    const shared::BackgroundConstants c = backgroundConstants(settings, cameraFromWorld, out.view);
    out.addTable<shared::BackgroundConstants>(shared::kBackgroundBinding, {&c, 1});
    out.backdrop = settings.backdrop;
}

}  // namespace

extern const Effect backgroundEffect;
constinit const Effect backgroundEffect{.name = "background",
                                        .summary = "the environment's picture behind everything",
                                        .isRequested = [](const DrawSettings& s) { return s.backdrop != nullptr; },
                                        .option = "--background environment",
                                        .leaveOut = [](DrawSettings& s) { s.backdrop.reset(); },
                                        .ofFrame =
                                            [](const EffectFrame& frame) {
                                                const DrawSettings& s = frame.settings;
                                                return showsBackdrop(s) && s.layer == nullptr && !s.isBlended;
                                            },
                                        .fill = fill,
                                        .stage = Stage::lit,
                                        .passes = kPasses,
                                        .tables = kTables};

}  // namespace stipple::render
