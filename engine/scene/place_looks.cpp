#include "engine/scene/place_looks.h"

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
        if (!image || image->rgba.empty()) return glm::vec4(1);
        const float texels = std::sqrt(static_cast<float>(image->width) * static_cast<float>(image->height) *
                                       std::abs(glm::determinant(glm::mat2(place))));
        return lookup(*image, *texture, glm::vec2(place * glm::vec3(uv, 1)), side * texels, isColour);
    }
};

struct Look {
    glm::vec3 base{1}, emissive{0};
    Layer colour, light, normal;
    float normalScale = 1;
};

Layer layerOf(const Scene& scene, const std::vector<DecodedImage>& images, const Material& m, const TextureUse& use) {
    const TextureUse leading = leadingUse(m);
    if (!isOnLeading(scene, use, leading)) return {};
    const Texture& texture = scene.textures[static_cast<size_t>(use.texture)];
    const bool isOwn = use.transform == leading.transform || glm::determinant(leading.transform) == 0;
    return {&images[static_cast<size_t>(texture.image)], &texture,
            isOwn ? glm::mat3(1) : use.transform * glm::inverse(leading.transform)};
}

}  // namespace

lod::PlaceLooks placeLooks(const Scene& scene, const std::vector<DecodedImage>& images) {
    std::vector<Look> looks;
    for (const Material& m : scene.materials)
        looks.push_back({glm::vec3(m.baseColour), m.emissive, layerOf(scene, images, m, m.baseColourTexture),
                         layerOf(scene, images, m, m.emissiveTexture), layerOf(scene, images, m, m.normalTexture),
                         m.normalScale});
    return [looks = std::move(looks)](uint32_t surface, const glm::vec2& uv, float side) {
        lod::PlaceLook out;
        const size_t material = surface & shared::kSurfaceMaterialMask;
        if (material >= looks.size()) return out;
        const Look& look = looks[material];
        out.colour = look.base * glm::vec3(look.colour.at(uv, side, true));
        if (look.emissive != glm::vec3(0)) out.colour += look.emissive * glm::vec3(look.light.at(uv, side, true));
        if (!look.normal.image || look.normal.image->rgba.empty()) return out;
        const glm::vec3 n = 2.0f * glm::vec3(look.normal.at(uv, side, false)) - 1.0f;
        out.normal = {n.x * look.normalScale, n.y * look.normalScale, n.z};
        return out;
    };
}

bool hasTextures(const Scene& scene) {
    for (const Material& m : scene.materials)
        if (m.baseColourTexture.texture >= 0 || m.normalTexture.texture >= 0 || m.emissiveTexture.texture >= 0)
            return true;
    return false;
}

}  // namespace stipple::scene
