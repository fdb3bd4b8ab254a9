// Fog and aerial perspective (shaders/shared/fog.h). Where nothing is seen there is none: how far the air goes behind
// the scene is not known, and its colour, unless another one is given, is that of the background (of the environment's
// picture behind everything: its mean, the light that air without a direction of its own sends on).
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/fog.h"

namespace stipple::render {
namespace {

constexpr std::array kPasses{Pass::fog};
constexpr std::array kTables{shared::kFogBinding};
constexpr std::array kKinds{"grey", "air"};
constexpr std::array kParameters{Parameter{"density",
                                           "what a ray loses on its way, 1 / world unit (e.g. 0.01: 1 % of each unit)",
                                           0,
                                           1e9,
                                           1,
                                           {},
                                           [](DrawSettings& s) { return &s.parameters.fog.density; }},
                                 Parameter{"height",
                                           "by which the air thins out to 37 %, world units; 0: even",
                                           0,
                                           1e12,
                                           1,
                                           {},
                                           [](DrawSettings& s) { return &s.parameters.fog.height; }},
                                 Parameter{"base",
                                           "height, along the scene's up, at which it has that density, world units",
                                           -1e12,
                                           1e12,
                                           1,
                                           {},
                                           [](DrawSettings& s) { return &s.parameters.fog.base; }},
                                 Parameter{"colour",
                                           "sRGB, 0 to 255 each; without: that of the background",
                                           0,
                                           255,
                                           3,
                                           {},
                                           [](DrawSettings& s) { return s.parameters.fog.colour.data(); }},
                                 Parameter{"kind", "grey, or air, which takes out more of blue than of red", 0, 0, 1,
                                           kKinds, [](DrawSettings& s) { return &s.parameters.fog.kind; }}};

/// Extinction of air at 680, 550 and 440 nm, over that at 550 nm: the fourth power of the frequency (Rayleigh).
constexpr std::array kOfAir{0.428, 1.0, 2.441};

glm::dvec3 densityOf(const FogSettings& fog) {
    return fog.kind != 0 ? fog.density * glm::dvec3(kOfAir[0], kOfAir[1], kOfAir[2]) : glm::dvec3(fog.density);
}

glm::vec3 colourOf(const DrawSettings& settings) {
    glm::vec3 colour = showsBackdrop(settings) ? settings.backdrop->mean : settings.background;
    for (size_t c = 0; c < 3; ++c)
        if (const double given = settings.parameters.fog.colour.at(c); given >= 0)
            colour[static_cast<int>(c)] = shared::linearFromSrgb(static_cast<float>(given / 255));
    return colour;
}

/// Density at a height over that at `base`.
double thinned(const FogSettings& fog, double height) {
    const double kMost = shared::kFogMostHeights;
    return fog.height > 0 ? std::exp(std::clamp((fog.base - height) / fog.height, -kMost, kMost)) : 1;
}

/// The farthest of what is drawn, from the eye that was asked for, and the lowest height.
struct Reach {
    double farthest = 0, lowest = 0;
};
Reach reachOf(const EffectFrame& frame) {
    const DrawList& draws = frame.draws;
    const glm::dvec3 up = glm::normalize(frame.settings.worldUp),
                     eye = draws.view.eye - draws.view.forward * draws.eyeAdvanced;
    Reach reach{0, glm::dot(up, eye)};
    const auto look = [&](uint32_t instance, uint32_t number) {
        const lod::Instance& place = draws.instances[instance];
        const lod::Hierarchy& h = *draws.hierarchies[place.hierarchy];
        const lod::Node& node = h.nodes[number];
        const glm::dvec3 centre =
            place.translation + place.rotation * (place.scale * (h.origin + h.unit * node.centre));
        const double radius = node.radius * place.scale * h.unit + place.sway;
        reach.farthest = std::max(reach.farthest, glm::length(centre - eye) + radius);
        reach.lowest = std::min(reach.lowest, glm::dot(up, centre) - radius);
    };
    for (const lod::CutDraw& draw : draws.cut) look(draw.instance, draw.node);
    for (const lod::CutMeshDraw& draw : draws.meshCut) look(draw.instance, draw.node);
    return reach;
}

/// Is anything farther than what fog leaves as it was? By the largest density on any way.
bool ofFrame(const EffectFrame& frame) {
    const DrawSettings& s = frame.settings;
    const FogSettings& fog = s.parameters.fog;
    if (!(fog.density > 0) || s.debugView != shared::kDebugNone || s.layer != nullptr || frame.content.isEmpty())
        return false;
    constexpr double kLeast = 1.0 / 4096;
    const Reach reach = reachOf(frame);
    const glm::dvec3 density = densityOf(fog) * thinned(fog, reach.lowest);
    const glm::vec3 colour = colourOf(s);
    const double brightest = std::max({1.0f, colour.r, colour.g, colour.b}) * s.parameters.tone.exposure;
    const double most = std::max({density.x, density.y, density.z}) * reach.farthest;
    return -std::expm1(-most) * std::max(1.0, brightest) > kLeast;
}

void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    const FogSettings& fog = settings.parameters.fog;
    const glm::dvec3 up = glm::normalize(settings.worldUp);
    shared::FogConstants c{};
    c.density = glm::vec3(densityOf(fog) * thinned(fog, glm::dot(up, out.view.eye)));
    c.inverseHeight = fog.height > 0 ? static_cast<float>(1 / fog.height) : 0.0f;
    c.colour = colourOf(settings);
    c.advanced = static_cast<float>(out.eyeAdvanced);
    c.up = glm::vec3(cameraFromWorld * up);
    c.isGrey = fog.kind == 0 ? 1u : 0u;
    out.addTable<shared::FogConstants>(shared::kFogBinding, {&c, 1});
}

}  // namespace

extern const Effect fogEffect;
constinit const Effect fogEffect{.name = "fog",
                                 .summary = "fog and aerial perspective",
                                 .parameters = kParameters,
                                 .ofFrame = ofFrame,
                                 .fill = fill,
                                 .stage = Stage::lit,
                                 .passes = kPasses,
                                 .tables = kTables,
                                 .toleranceSteps = 1};

}  // namespace stipple::render
