#include "engine/render/effects/facts.h"

#include <algorithm>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/kinds/kind.h"
#include "shaders/shared/reflection.h"

namespace stipple::render {
namespace {

bool isMirror(float roughness, const lod::Optics& optics) {
    return roughness < shared::kMirrorRoughest && optics.isPlain() && !optics.blends;
}
/// Whatever their textures say, which make surfaces smoother only.
bool hasMirrors(const std::vector<shared::SurfaceMaterial>& materials, const lod::StoreDescription& d) {
    for (size_t m = 0; m < materials.size(); ++m)
        if (isMirror(materials[m].roughness, m < d.optics.size() ? d.optics[m] : lod::Optics{})) return true;
    return false;
}
/// (A list of all that there are says nothing of which of them the points have.)
bool hasMirrors(const std::vector<lod::PointMaterial>& materials, const DrawSettings& settings) {
    if (settings.pointMaterial)
        return isMirror(static_cast<float>(*settings.pointMaterial >> 8 & 255u) / 255.0f,
                        settings.optics.value_or(lod::Optics{}));
    return materials.size() < lod::kMostPointMaterials &&
           std::any_of(materials.begin(), materials.end(),
                       [](const lod::PointMaterial& m) { return isMirror(m.roughness, m.optics); });
}

}  // namespace

SceneFacts factsOf(std::span<const std::shared_ptr<const lod::Store>> stores, const DrawSettings& settings) {
    SceneFacts facts;
    const auto isLit = [&](lod::Kind kind) { return drawnKind(kind).isLit(settings); };
    for (const auto& store : stores) {
        const lod::Hierarchy& h = store->hierarchy;
        const lod::StoreDescription& d = store->description;
        const bool isMesh = h.isMesh(), isCurves = h.isCurves, hasPatches = d.patches.patches > 0;
        const bool isPoints = !isMesh && !isCurves && (!hasPatches || d.patches.left + d.patches.discs > 0);
        facts.hasTriangles = facts.hasTriangles || isMesh;
        facts.hasCurves = facts.hasCurves || isCurves;
        facts.hasPatches = facts.hasPatches || hasPatches;
        facts.hasPoints = facts.hasPoints || isPoints;
        facts.hasUnlitTriangles = facts.hasUnlitTriangles || (isMesh && !isLit(lod::Kind::triangles)) ||
                                  (hasPatches && !isLit(lod::Kind::patches));
        facts.hasUnlitPoints = facts.hasUnlitPoints || (isPoints && !isLit(lod::Kind::points));
        const auto isClear = [](const lod::Optics& o) { return o.blends; };
        const auto hasClear = [](const lod::PointMaterial& m) { return m.optics.blends; };
        facts.hasTransparent = facts.hasTransparent || std::any_of(d.optics.begin(), d.optics.end(), isClear) ||
                               std::any_of(d.pointMaterials.begin(), d.pointMaterials.end(), hasClear);
        facts.hasMirrors = facts.hasMirrors || (isMesh && isLit(lod::Kind::triangles) && hasMirrors(d.materials, d)) ||
                           (((isPoints && isLit(lod::Kind::points)) || (hasPatches && isLit(lod::Kind::patches))) &&
                            hasMirrors(d.pointMaterials, settings));
        const double extent = glm::length(d.focusMax - d.focusMin);
        if (std::isfinite(extent)) facts.extent = std::max(facts.extent, extent);
        facts.hasPointsWithoutNormals = facts.hasPointsWithoutNormals || (isPoints && !d.hasNormals);
    }
    facts.lights = static_cast<uint32_t>(settings.lights.size());
    facts.lightsThatCast = static_cast<uint32_t>(std::count_if(settings.lights.begin(), settings.lights.end(),
                                                               [](const WorldLight& l) { return l.castsShadow; }));
    return facts;
}

}  // namespace stipple::render
