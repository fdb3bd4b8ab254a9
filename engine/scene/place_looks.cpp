#include "engine/scene/place_looks.h"

#include <algorithm>
#include <cmath>

#include "engine/scene/triangles.h"

namespace stipple::scene {
namespace {

/// A texture of a material as it lies on the vertices' own coordinates.
struct Layer {
    const DecodedImage* image = nullptr;
    const Texture* texture = nullptr;
    glm::mat3 place{1};

    glm::vec4 at(const glm::vec2& uv, float side, bool isColour) const {
        if (!isThere()) return glm::vec4(1);
        return lookup(*image, *texture, glm::vec2(place * glm::vec3(uv, 1)), side * texels(), isColour);
    }
    bool isThere() const { return image != nullptr && !image->rgba.empty(); }
    /// Along a unit of texture coordinates, the mean of both.
    float texels() const {
        if (!isThere()) return 0;
        return std::sqrt(static_cast<float>(image->width) * static_cast<float>(image->height) *
                         std::abs(glm::determinant(glm::mat2(place))));
    }
};

struct Look {
    glm::vec3 base{1}, emissive{0};
    Layer colour, light, normal, finish;
    float normalScale = 1, roughness = 1, metallic = 0;
    uint8_t number = 0;
    bool isUnlit = false;
};

Layer layerOf(const Scene& scene, const std::vector<DecodedImage>& images, const Material& m, const TextureUse& use) {
    const TextureUse leading = leadingUse(m);
    if (!isOnLeading(scene, use, leading)) return {};
    const Texture& texture = scene.textures[static_cast<size_t>(use.texture)];
    const bool isOwn = use.transform == leading.transform || glm::determinant(leading.transform) == 0;
    return {&images[static_cast<size_t>(texture.image)], &texture,
            isOwn ? glm::mat3(1) : use.transform * glm::inverse(leading.transform)};
}

/// Of each material, and of none: do the triangles of visible nodes have it?
std::vector<bool> usedMaterials(const Scene& scene, const std::vector<Placement>& placed) {
    std::vector<bool> isUsed(scene.materials.size() + 1, false);
    for (const Placement& at : placed)
        for (const Primitive& p : scene.meshes[static_cast<size_t>(at.mesh)].primitives)
            if (p.kind == PrimitiveKind::triangles)
                isUsed[p.material < 0 ? scene.materials.size() : static_cast<size_t>(p.material)] = true;
    return isUsed;
}

}  // namespace

bool MaterialList::hasMixedOptics() const {
    return std::any_of(list.begin(), list.end(), [&](const auto& m) { return !(m.optics == list.front().optics); });
}

MaterialList materialList(const Scene& scene) {
    const std::vector<Placement> placed = placements(scene);
    const std::vector<bool> isUsed = usedMaterials(scene, placed);
    const std::vector<lod::Optics> optics = surfaceOptics(scene, placed);
    MaterialList out;
    std::vector<lod::PointMaterial> all;
    for (size_t k = 0; k <= scene.materials.size(); ++k) {
        lod::PointMaterial m;
        if (k < scene.materials.size()) {
            const Material& from = scene.materials[k];
            m = {from.roughness, from.metallic, optics.empty() ? lod::Optics{} : optics[k]};
            out.isGrid =
                out.isGrid || (isUsed[k] && isOnLeading(scene, from.metallicRoughnessTexture, leadingUse(from)));
        }
        all.push_back(m);
        if (isUsed[k] && std::find(out.list.begin(), out.list.end(), m) == out.list.end()) out.list.push_back(m);
    }
    out.isGrid = out.isGrid || out.list.size() > lod::kMostPointMaterials;
    if (out.isGrid) out.list = lod::materialGrid();
    for (const lod::PointMaterial& m : all) {
        const auto known = std::find(out.list.begin(), out.list.end(), m);
        out.numbers.push_back(out.isGrid                ? lod::gridIndex(double{m.roughness}, double{m.metallic})
                              : known == out.list.end() ? uint8_t{0}
                                                        : static_cast<uint8_t>(known - out.list.begin()));
    }
    return out;
}

lod::PlaceLooks placeLooks(const Scene& scene, const std::vector<DecodedImage>& images) {
    const MaterialList materials = materialList(scene);
    std::vector<Look> looks;
    for (const Material& m : scene.materials)
        looks.push_back({glm::vec3(m.baseColour), m.emissive, layerOf(scene, images, m, m.baseColourTexture),
                         layerOf(scene, images, m, m.emissiveTexture), layerOf(scene, images, m, m.normalTexture),
                         layerOf(scene, images, m, m.metallicRoughnessTexture), m.normalScale, m.roughness, m.metallic,
                         materials.numbers[looks.size()], m.isUnlit});
    return
        [looks = std::move(looks), none = materials.numbers.back()](uint32_t surface, const glm::vec2& uv, float side) {
            lod::PlaceLook out;
            const size_t material = surface & shared::kSurfaceMaterialMask;
            out.material = none;
            if (material >= looks.size()) return out;
            const Look& look = looks[material];
            out.material = look.number;
            if (look.finish.image != nullptr && !look.finish.image->rgba.empty()) {
                const glm::vec4 finish = look.finish.at(uv, side, false);
                out.material = lod::gridIndex(double{look.roughness * finish.g}, double{look.metallic * finish.b});
            }
            out.colour = look.base * glm::vec3(look.colour.at(uv, side, true));
            out.isUnlit = look.isUnlit;
            if (look.emissive != glm::vec3(0) && !look.isUnlit)
                out.emission = look.emissive * glm::vec3(look.light.at(uv, side, true));
            if (!look.normal.image || look.normal.image->rgba.empty()) return out;
            const glm::vec3 n = 2.0f * glm::vec3(look.normal.at(uv, side, false)) - 1.0f;
            out.normal = {n.x * look.normalScale, n.y * look.normalScale, n.z};
            return out;
        };
}

lod::TextureDetail textureDetail(const Scene& scene, const std::vector<DecodedImage>& images) {
    lod::TextureDetail out;
    out.hasLight = hasLight(scene);
    const std::vector<bool> isUsed = usedMaterials(scene, placements(scene));
    std::vector<float> texels;
    for (size_t k = 0; k < scene.materials.size(); ++k) {
        const Material& m = scene.materials[k];
        float most = 0;
        for (const TextureUse* use :
             {&m.baseColourTexture, &m.emissiveTexture, &m.normalTexture, &m.metallicRoughnessTexture})
            most = std::max(most, layerOf(scene, images, m, *use).texels());
        texels.push_back(most);
        if (!isUsed[k]) continue;
        out.hasNormals = out.hasNormals || layerOf(scene, images, m, m.normalTexture).isThere();
        out.hasMaterials = out.hasMaterials || layerOf(scene, images, m, m.metallicRoughnessTexture).isThere();
    }
    if (std::none_of(texels.begin(), texels.end(), [](float t) { return t > 0; })) return out;
    out.texels = [texels](uint32_t surface) {
        const size_t m = surface & shared::kSurfaceMaterialMask;
        return m < texels.size() ? texels[m] : 0.0f;
    };
    return out;
}

bool hasLight(const Scene& scene) {
    const std::vector<bool> isUsed = usedMaterials(scene, placements(scene));
    for (size_t k = 0; k < scene.materials.size(); ++k)
        if (isUsed[k] && (scene.materials[k].isUnlit || scene.materials[k].emissive != glm::vec3(0))) return true;
    return false;
}

bool isAllUnlit(const Scene& scene) {
    const std::vector<bool> isUsed = usedMaterials(scene, placements(scene));
    for (size_t k = 0; k < isUsed.size(); ++k)
        if (isUsed[k] && (k == scene.materials.size() || !scene.materials[k].isUnlit)) return false;
    return true;
}

bool hasTextures(const Scene& scene) {
    for (const Material& m : scene.materials)
        for (const TextureUse* use :
             {&m.baseColourTexture, &m.normalTexture, &m.emissiveTexture, &m.metallicRoughnessTexture})
            if (use->texture >= 0) return true;
    return false;
}

}  // namespace stipple::scene
