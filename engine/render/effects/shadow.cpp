// Shadow: a mask of each light that casts, from maps of what it meets first (shadow_frame.h), which light multiplies
// into what comes of it: it runs before light, and is asked before it.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/hash.h"
#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"
#include "engine/render/shadow_frame.h"
#include "shaders/shared/bindings.h"

namespace stipple::render {

bool isLit(const EffectFrame& frame);  // effects/light.cpp

namespace {

constexpr std::array kPasses{Pass::shadow};
constexpr std::array kParameters{
    Parameter{"texels", "texels of a map along its edge", 64, 8192, 1, {}, [](DrawSettings& s) {
                  return &s.parameters.shadow.texels;
              }}};
constexpr std::array kPassesOfCasters{Pass::cast};
constexpr FramesBefore kMaps{addShadows, addShadowRequests, bytesOfShadows, msOfShadows, kPassesOfCasters};
constexpr std::array kTables{shared::kShadowBinding};  // which backends fill, that know where the maps are

shared::ShadowMap inCamera(const ShadowMapOf& map, const DrawList& draws, const glm::dmat3& cameraFromWorld) {
    const lod::View& light = map.of.view;
    const glm::dvec3 eye = draws.view.eye - light.eye;
    shared::ShadowMap m{};
    m.right = glm::vec3(cameraFromWorld * light.right);
    m.down = glm::vec3(cameraFromWorld * light.down);
    m.forward = glm::vec3(cameraFromWorld * light.forward);
    m.origin = glm::vec3(glm::dvec3(glm::dot(eye, light.right), glm::dot(eye, light.down),
                                    glm::dot(eye, light.forward) - map.of.centreDepth));
    m.focal = static_cast<float>(light.focalPixels);
    m.reach2 = static_cast<float>(std::min(map.of.reach * map.of.reach, 1e30));
    m.casterError = static_cast<float>(map.casterError);
    m.surfaceError = static_cast<float>(draws.shadowMaps->surfaceError / draws.view.focalPixels);
    m.depthStep = static_cast<float>(map.depthStep);
    m.nearest = static_cast<float>(map.nearest);
    m.size = static_cast<float>(map.of.size);
    m.edge = light.width;
    m.stride = shared::shadowStride(light.width);
    m.slot = map.of.slot;
    m.isPerspective = light.isOrthographic ? 0 : 1;
    m.hasLeaves = map.texels->through.empty() ? 0 : 1;
    return m;
}

/// Of all that decides what the masks are: surfaces and maps. 0 where something moves that no number here tells.
uint64_t keyOf(const DrawList& draws, const DrawSettings& settings) {
    if (draws.swaying > 0) return 0;
    uint64_t key = hashBytes(&draws.frame, sizeof(draws.frame));
    const auto add = [&](const auto& values) {
        key = hashBytes(values.data(), values.size() * sizeof(values[0]), key);
    };
    add(draws.cut);
    add(draws.meshCut);
    for (const DrawBatch& batch : draws.batches) {
        add(batch.nodes);
        add(batch.blocks);
    }
    add(draws.shadows);
    for (const ShadowMapOf& map : draws.shadowMaps->maps) {
        const ShadowTexels* const texels = map.texels.get();
        key = hashBytes(&texels, sizeof(texels), key);
    }
    key = hashBytes(&settings.frameTag, sizeof(settings.frameTag), key);
    return std::max<uint64_t>(key, 1);
}

void fill(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) {
    out.isShadowed = true;
    if (!settings.shadows) return;
    out.shadowMaps = settings.shadows;
    for (const ShadowMapOf& map : settings.shadows->maps) {
        out.shadows.push_back(inCamera(map, out, cameraFromWorld));
        out.shadowSlotOf.resize(settings.lights.size());
        out.shadowSlotOf[map.of.light] = 1 + map.of.slot;
        out.shadowSlots = std::max(out.shadowSlots, 1 + map.of.slot);
    }
    out.shadowKey = keyOf(out, settings);
}

}  // namespace

extern const Effect shadowEffect;
constinit const Effect shadowEffect{
    .name = "shadow",
    .summary = "shadows of directional and spot lights",
    .option = "--sun",
    .isAskedFor =
        [](const DrawSettings& s) {
            return std::any_of(s.lights.begin(), s.lights.end(),
                               [](const WorldLight& l) { return l.isSun && l.castsShadow; });
        },
    .calledForBy = [](const SceneFacts& f) { return f.lightsThatCast > 0 ? "lights that cast them" : nullptr; },
    .parameters = kParameters,
    .ofFrame =
        [](const EffectFrame& frame) {
            return frame.settings.shadows != nullptr && !frame.settings.shadows->maps.empty() && isLit(frame);
        },
    .fill = fill,
    .before = &kMaps,
    .stage = Stage::light,
    .passes = kPasses,
    .tables = kTables};

}  // namespace stipple::render
