#include "engine/scene/curves.h"

#include <algorithm>
#include <cmath>

#include "engine/base/hash.h"
#include "engine/base/numbers.h"
#include "shaders/shared/record.h"

namespace stipple::scene {

lod::CurveSet flattenCurves(const Scene& scene, const std::vector<Placement>& placed) {
    lod::CurveSet out;
    out.up = {0, 1, 0};
    out.hasColour = true;
    const auto byte = [](float linear) {
        return unitToByte(shared::srgbFromLinear(linear > 0.0f ? std::min(linear, 1.0f) : 0.0f));
    };
    for (const Placement& at : placed)
        for (const Primitive& p : scene.meshes[static_cast<size_t>(at.mesh)].primitives) {
            if (p.kind != PrimitiveKind::lines) continue;
            const glm::dmat3 linear(at.world);
            const glm::dmat3 forNormals(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                                        glm::cross(linear[0], linear[1]));
            const auto scale = static_cast<float>(std::cbrt(std::abs(glm::determinant(linear))));
            const glm::vec4 base =
                p.material < 0 ? glm::vec4(1) : scene.materials[static_cast<size_t>(p.material)].baseColour;
            const auto add = [&](uint32_t v) {
                const glm::vec4 c = p.colour.empty() ? base : base * p.colour[v];
                out.addVertex(glm::dvec3(at.world * glm::dvec4(p.at(v), 1)),
                              p.radius.empty() ? 0.0f : p.radius[v] * scale,
                              p.normal.empty() ? glm::vec3(0) : glm::vec3(forNormals * glm::dvec3(p.normal[v])),
                              byte(c.r) | byte(c.g) << 8 | byte(c.b) << 16);
            };
            for (size_t i = 0; i + 2 <= p.indices.size(); i += 2) {
                if (i == 0 || p.indices[i] != p.indices[i - 1]) {
                    if (i > 0) out.endCurve(!p.normal.empty());
                    add(p.indices[i]);
                }
                add(p.indices[i + 1]);
            }
            if (p.indices.size() >= 2) out.endCurve(!p.normal.empty());
        }
    return out;
}

lod::CurveSource curveSource(const Scene& scene, const std::vector<Placement>& placed) {
    lod::CurveSource source;
    for (const Placement& at : placed)
        for (const Primitive& p : scene.meshes[static_cast<size_t>(at.mesh)].primitives)
            source.vertices += p.kind == PrimitiveKind::lines ? p.indices.size() / 2 : 0;
    source.identity = [&scene, placed] {
        uint64_t hash = 0;
        for (const Placement& at : placed)
            for (const Primitive& p : scene.meshes[static_cast<size_t>(at.mesh)].primitives) {
                hash = hashBytes(&at.world, sizeof(at.world), hash);
                hash = hashBytes(p.position.data(), p.position.size() * sizeof(p.position[0]), hash);
                hash = hashBytes(p.indices.data(), p.indices.size() * sizeof(p.indices[0]), hash);
            }
        return hash;
    };
    source.read = [&scene, placed](const lod::CurveSource::Take& take) -> Result<void> {
        for (const Placement& at : placed) STIPPLE_TRY(take(flattenCurves(scene, {at})));
        return placed.empty() ? take(flattenCurves(scene, {})) : Result<void>();
    };
    return source;
}

}  // namespace stipple::scene
