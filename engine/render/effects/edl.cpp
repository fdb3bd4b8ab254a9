// Eye-dome lighting (shaders/shared/edl.h): what has no light of its own, or no normals to be lit by, shows its shape
// by how deep its neighbours are.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "engine/render/kinds/kind.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/edl.h"

namespace stipple::render {
namespace {

constexpr std::array kPasses{Pass::edl};
constexpr std::array kTables{shared::kEdlBinding};
constexpr std::array kWhere{"unlit", "everything"};
constexpr std::array kParameters{
    Parameter{"strength",
              "how dark: times the mean of the logarithms (base 2) of depth over depth of neighbours",
              0,
              1e6,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.edl.strength; }},
    Parameter{"radius",
              "how far neighbours are, pixels",
              1,
              8,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.edl.radius; }},
    Parameter{"scales",
              "how many radii, each twice the one before, are looked at",
              1,
              shared::kEdlScales,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.edl.scales; }},
    Parameter{"where", "what is lit, too, or not", 0, 0, 1, kWhere,
              [](DrawSettings& s) { return &s.parameters.edl.where; }}};

/// Which kinds of what is lit get it, too.
uint32_t litToo(const DrawSettings& s) {
    const bool isAll = s.parameters.edl.where != 0;
    const bool lackNormals = s.parameters.facts.hasPointsWithoutNormals;
    return (isAll || lackNormals ? shared::kEdlPoints : 0u) | (isAll ? shared::kEdlTriangles : 0u);
}

/// Could a pixel of what is drawn have it?
bool ofFrame(const EffectFrame& frame) {
    const DrawSettings& s = frame.settings;
    if (s.debugView != shared::kDebugNone || s.layer != nullptr || !(s.parameters.edl.strength > 0)) return false;
    bool any = litToo(s) != 0 && !frame.content.isEmpty();
    forEachKind([&](lod::Kind kind) { any = any || (frame.content.has(kind) && !drawnKind(kind).isLit(s)); });
    return any;
}

void fill(const DrawSettings& settings, const glm::dmat3&, DrawList& out) {
    const EdlSettings& edl = settings.parameters.edl;
    shared::EdlConstants c{};
    c.strength = static_cast<float>(edl.strength / shared::kEdlNeighbours);
    // An orthographic picture counts depths as one in perspective does from where it shows as much (a view of 50
    // degrees): by their share of the distance there.
    if (out.view.isOrthographic) {
        const double focal50 = 0.5 * out.view.height / std::tan(0.5 * 50 * 0.017453292519943295);
        c.perDepth = static_cast<float>(out.view.focalPixels / (std::log(2.0) * focal50));
    }
    c.scales = static_cast<uint32_t>(std::clamp(edl.scales, 1.0, double{shared::kEdlScales}));
    c.lit = litToo(settings);
    const std::array<float*, 3> weights{&c.weight0, &c.weight1, &c.weight2};
    const std::array<int*, 3> straight{&c.straight0, &c.straight1, &c.straight2},
        slanted{&c.slanted0, &c.slanted1, &c.slanted2};
    // A slope falls twice as far over twice the way: scales count by 1, 1/2, 1/4, or the widest would be all that is
    // seen and leave black halos of its radius.
    const double sum = 2 - std::ldexp(1.0, 1 - static_cast<int>(c.scales));
    for (uint32_t k = 0; k < shared::kEdlScales; ++k) {
        const double radius = std::ldexp(edl.radius, static_cast<int>(k));
        *weights.at(k) = k < c.scales ? static_cast<float>(std::ldexp(1.0, -static_cast<int>(k)) / sum) : 0.0f;
        *straight.at(k) = std::max(1, static_cast<int>(std::lround(radius)));
        *slanted.at(k) = std::max(1, static_cast<int>(std::lround(radius * std::sqrt(0.5))));
    }
    out.addTable<shared::EdlConstants>(shared::kEdlBinding, {&c, 1});
}

}  // namespace

extern const Effect edlEffect;
constinit const Effect edlEffect{.name = "edl",
                                 .summary = "eye-dome lighting: shape by depth, where there is no light or no normals",
                                 .calledForBy = [](const SceneFacts& f) -> const char* {
                                     if (f.hasUnlitPoints) return "points that keep their colours";
                                     if (f.hasPointsWithoutNormals) return "points without normals";
                                     return f.hasUnlitTriangles ? "surfaces that keep their colours" : nullptr;
                                 },
                                 .parameters = kParameters,
                                 .ofFrame = ofFrame,
                                 .fill = fill,
                                 .passes = kPasses,
                                 .tables = kTables,
                                 .toleranceSteps = 1};

}  // namespace stipple::render
