#include "engine/render/effects/facts.h"

#include <algorithm>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/kinds/kind.h"

namespace stipple::render {

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
