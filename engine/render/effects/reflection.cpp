// Reflections of the screen (shaders/shared/reflection.h): what the picture shows is seen in smooth surfaces, in the
// place of the surroundings. It is part of light. Glass has its own way of looking at the picture (refraction.cpp);
// neither it nor what blends is a mirror here, or seen in one.
#include <algorithm>
#include <array>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "engine/render/kinds/kind.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/reflection.h"

namespace stipple::render {

bool isLit(const EffectFrame& frame);  // effects/light.cpp

namespace {

constexpr std::array kPasses{Pass::reflection};
constexpr std::array kTables{shared::kReflectionBinding};
constexpr std::array kParameters{
    Parameter{"distance",
              "how far mirror rays are followed, world units (0: twice what the largest file covers)",
              0,
              1e15,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.reflection.distance; }},
    Parameter{"steps",
              "of the longest rays on their way across the picture; what is narrower than one may be missed",
              4,
              1024,
              1,
              {},
              [](DrawSettings& s) { return &s.parameters.reflection.steps; }}};

bool isSmooth(float roughness) { return roughness < shared::kMirrorRoughest; }

/// Could a pixel of it be smooth? A texture may make any surface so; points with materials of their own may have any.
bool hasMirrors(const EffectFrame& frame, lod::Kind kind) {
    const DrawList& draws = frame.draws;
    if (!frame.content.has(kind) || !drawnKind(kind).isLit(frame.settings)) return false;
    if (kind == lod::Kind::triangles)
        return std::any_of(draws.materials.begin(), draws.materials.end(), [](const shared::SurfaceMaterial& m) {
            return isSmooth(m.roughness) || (m.surfaceTexture.texture != 0 && m.roughness > 0);
        });
    const std::vector<shared::DrawNode>& nodes = draws.of(kind).nodes;
    return std::any_of(nodes.begin(), nodes.end(), [](const shared::DrawNode& node) {
        const uint32_t own = node.material & ~shared::kOnlyMaterial;
        const bool isOnly = (node.material & shared::kOnlyMaterial) != 0;
        return (node.materials > 0 && !isOnly) ||
               (own != shared::kPlainPoint && isSmooth(static_cast<float>(own >> 8 & 255u) / 255.0f));
    });
}

bool ofFrame(const EffectFrame& frame) {
    if (!isLit(frame) || frame.settings.isBlended) return false;
    bool any = false;
    forEachKind([&](lod::Kind kind) { any = any || hasMirrors(frame, kind); });
    return any;
}

void fill(const DrawSettings& settings, const glm::dmat3&, DrawList& out) {
    constexpr double kShare = 2, kMost = 1e15, kMostSteps = 1024;
    constexpr uint32_t kFewest = 4;
    const ReflectionSettings& s = settings.parameters.reflection;
    // (A single point has no extent.)
    const double extent = settings.parameters.facts.extent, usual = extent > 0 ? kShare * extent : kMost;
    shared::ReflectionConstants c{};
    c.reach = static_cast<float>(std::min(s.distance > 0 ? s.distance : usual, kMost));
    c.steps = s.steps >= kFewest ? static_cast<uint32_t>(std::min(s.steps, kMostSteps)) : kFewest;
    out.addTable<shared::ReflectionConstants>(shared::kReflectionBinding, {&c, 1});
}

}  // namespace

extern const Effect reflectionEffect;
constinit const Effect reflectionEffect{
    .name = "reflection",
    .summary = "what the picture shows, mirrored in smooth surfaces",
    .calledForBy = [](const SceneFacts& f) { return f.hasMirrors ? "smooth materials" : nullptr; },
    .parameters = kParameters,
    .ofFrame = ofFrame,
    .fill = fill,
    .passes = kPasses,
    .tables = kTables,
    .toleranceSteps = 1};  // what is kept between passes is rounded

}  // namespace stipple::render
