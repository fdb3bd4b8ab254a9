// Tone (shaders/shared/tone.h): exposure and a filmic curve, on surfaces; the background is what was asked for.
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/tone.h"

namespace stipple::render {
namespace {

constexpr std::array kPasses{Pass::tone};
constexpr std::array kTables{shared::kToneBinding};
constexpr std::array kCurves{"none", "filmic"};
constexpr std::array kMetering{"none", "average"};
constexpr std::array kParameters{
    Parameter{"exposure",
              "factor of light (2: one stop more)",
              1e-6,
              1e6,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.tone.exposure; }},
    Parameter{"curve", "none (what is brighter than 1 is white), or filmic (it rolls off)", 0, 0, 1, kCurves,
              [](DrawSettings& s) { return &s.parameters.tone.curve; }},
    Parameter{"metering",
              "none, or average (of each picture the mean of its logarithms becomes "
              "middle grey; exposure counts from there)",
              0, 0, 1, kMetering, [](DrawSettings& s) { return &s.parameters.tone.metering; }}};

void fill(const DrawSettings& settings, const glm::dmat3&, DrawList& out) {
    const ToneSettings& tone = settings.parameters.tone;
    const shared::ToneConstants c{static_cast<float>(tone.exposure), tone.curve != 0 ? 1u : 0u};
    out.addTable<shared::ToneConstants>(shared::kToneBinding, {&c, 1});
}

}  // namespace

extern const Effect toneEffect;
constinit const Effect toneEffect{.name = "tone",
                                  .summary = "exposure, and a filmic curve",
                                  .parameters = kParameters,
                                  .ofFrame =
                                      [](const EffectFrame& frame) {
                                          const DrawSettings& s = frame.settings;
                                          const ToneSettings& tone = s.parameters.tone;
                                          return (tone.exposure != 1 || tone.curve != 0) &&
                                                 s.debugView == shared::kDebugNone && s.layer == nullptr &&
                                                 !frame.content.isEmpty();
                                      },
                                  .fill = fill,
                                  .stage = Stage::lit,
                                  .passes = kPasses,
                                  .tables = kTables};

}  // namespace stipple::render
