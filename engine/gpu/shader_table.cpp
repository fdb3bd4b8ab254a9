#include "engine/gpu/shader_table.h"

#include <algorithm>

#include "engine/base/check.h"
#include "engine/gpu/mesh_frame.h"
#include "shaders/shared/background.h"
#include "shaders/shared/edl.h"
#include "shaders/shared/ewa.h"
#include "shaders/shared/fog.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/material.h"
#include "shaders/shared/occlusion.h"
#include "shaders/shared/optics.h"
#include "shaders/shared/reflection.h"
#include "shaders/shared/shadow_table.h"
#include "shaders/shared/surface.h"
#include "shaders/shared/texture.h"
#include "shaders/shared/tone.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::gpu {
namespace {

#include "shader_table.inc"

/// Do all shaders that touch a buffer lay it out as `stride` says? At least one must.
constexpr bool isLaidOut(uint32_t binding, size_t stride) {
    bool any = false;
    for (const Shader& s : kShaders)
        for (const BindingUse& u : s.uses) {
            if (u.binding != binding) continue;
            any = true;
            if (u.stride != stride) return false;
        }
    return any;
}
constexpr bool areBindingsKnown() {
    for (const Shader& s : kShaders) {
        if (s.pushBytes != 0 && s.pushBytes != sizeof(shared::Step)) return false;
        for (const BindingUse& u : s.uses)
            if (u.binding >= shared::kBindings) return false;
    }
    return true;
}
static_assert(areBindingsKnown());
static_assert(isLaidOut(shared::kFrameBinding, sizeof(shared::FrameConstants)));
static_assert(isLaidOut(shared::kNodesBinding, sizeof(shared::DrawNode)));
static_assert(isLaidOut(shared::kBlocksBinding, sizeof(shared::DrawBlock)));
static_assert(isLaidOut(shared::kVisibilityBinding, sizeof(uint64_t)));
static_assert(isLaidOut(shared::kTexelsBinding, sizeof(uint32_t)));
static_assert(isLaidOut(shared::kImageBinding, sizeof(uint32_t)));
static_assert(isLaidOut(shared::kExtraBinding, sizeof(float)));
static_assert(isLaidOut(shared::kMeshesBinding, sizeof(shared::DrawMesh)));
static_assert(isLaidOut(shared::kClustersBinding, sizeof(shared::DrawCluster)));
static_assert(isLaidOut(shared::kMaterialsBinding, sizeof(shared::SurfaceMaterial)));
static_assert(isLaidOut(shared::kTexturesBinding, sizeof(shared::TextureInfo)));
static_assert(isLaidOut(shared::kTilesBinding, sizeof(TileAddress)));
static_assert(isLaidOut(shared::kLightsBinding, sizeof(shared::LightSource)));
static_assert(isLaidOut(shared::kTriangleWordsBinding, sizeof(uint32_t)));
static_assert(isLaidOut(shared::kEnvironmentBinding, sizeof(float)));
static_assert(isLaidOut(shared::kDiscsBinding, sizeof(shared::WideDisc)));
static_assert(isLaidOut(shared::kFrontsBinding, sizeof(shared::FilteredFront)));
static_assert(isLaidOut(shared::kSumsBinding, sizeof(shared::FilteredSums)));
static_assert(isLaidOut(shared::kFilteredBinding, sizeof(shared::FilteredPixel)));
static_assert(isLaidOut(shared::kMaterialSumsBinding, sizeof(shared::MaterialSums)));
static_assert(isLaidOut(shared::kSecondGroupsBinding, sizeof(shared::GroupCounts)));
static_assert(isLaidOut(shared::kStatsBinding, sizeof(shared::GroupCounts)));
static_assert(isLaidOut(shared::kCoverageBinding, sizeof(uint32_t)));
static_assert(isLaidOut(shared::kLayerBinding, sizeof(shared::LayerConstants)));
static_assert(isLaidOut(shared::kOpticsBinding, sizeof(shared::Optic)));
static_assert(isLaidOut(shared::kBehindBinding, sizeof(float)));
static_assert(isLaidOut(shared::kBackBinding, sizeof(float)));
static_assert(isLaidOut(shared::kSurfaceBinding, sizeof(shared::SurfaceWords)));
#ifndef STIPPLE_ONLY_LIGHT
static_assert(isLaidOut(shared::kEdlBinding, sizeof(shared::EdlConstants)));
static_assert(isLaidOut(shared::kFogBinding, sizeof(shared::FogConstants)));
static_assert(isLaidOut(shared::kToneBinding, sizeof(shared::ToneConstants)));
static_assert(isLaidOut(shared::kOcclusionBinding, sizeof(shared::OcclusionConstants)));
static_assert(isLaidOut(shared::kOpenBinding, sizeof(float)));
static_assert(isLaidOut(shared::kShadowBinding, sizeof(shared::ShadowTable)));
static_assert(isLaidOut(shared::kBackgroundBinding, sizeof(shared::BackgroundConstants)));
static_assert(isLaidOut(shared::kBackdropBinding, sizeof(uint32_t)));
static_assert(isLaidOut(shared::kReflectionBinding, sizeof(shared::ReflectionConstants)));
#endif

}  // namespace

std::span<const Shader> shaders() { return kShaders; }

const Shader* shaderNamed(std::string_view name) {
    const auto* const found =
        std::find_if(std::begin(kShaders), std::end(kShaders), [&](const Shader& s) { return name == s.name; });
    return found == std::end(kShaders) ? nullptr : found;
}

uint64_t bytesOf(uint32_t binding, uint64_t count) {
    for (const Shader& s : kShaders)
        for (const BindingUse& u : s.uses)
            if (u.binding == binding) return u.offset + count * u.stride;
    STIPPLE_CHECK(false, "a binding of no shader");
    return 0;
}

}  // namespace stipple::gpu
