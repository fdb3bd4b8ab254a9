#include "engine/scene/gltf/looks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/scene/gltf/json_tools.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

TextureUse textureUse(const json& parent, const char* name) {
    TextureUse use;
    if (!parent.contains(name)) return use;
    const json& info = parent[name];
    use.texture = info["index"].get<int>();
    use.uvSet = info.value("texCoord", 0);
    const json& transform = extensionOf(info, "KHR_texture_transform");
    if (!transform.is_object()) return use;
    use.uvSet = transform.value("texCoord", use.uvSet);
    const auto offset = transform.contains("offset") ? vectorOf<glm::vec2>(transform["offset"]) : glm::vec2(0);
    const auto scale = transform.contains("scale") ? vectorOf<glm::vec2>(transform["scale"]) : glm::vec2(1);
    const float r = transform.value("rotation", 0.0f), cosine = std::cos(r), sine = std::sin(r);
    if (!std::isfinite(offset.x + offset.y + scale.x + scale.y + sine)) return use;  // beyond what floats hold
    // translation * rotation * scale (KHR_texture_transform, "Overview")
    use.transform =
        glm::mat3(cosine * scale.x, -sine * scale.x, 0, sine * scale.y, cosine * scale.y, 0, offset.x, offset.y, 1);
    return use;
}

/// KHR_materials_transmission, _ior, _volume, _specular.
lod::Optics opticsOf(const json& material) {
    const auto number = [&](const char* extension, const char* name, float without) {
        const json& of = extensionOf(material, extension);
        const float value = of.is_object() ? of.value(name, without) : without;
        return std::isfinite(value) ? value : without;
    };
    const auto colour = [&](const char* extension, const char* name) {
        const json& of = extensionOf(material, extension);
        return of.is_object() && of.contains(name) ? vectorOf<glm::vec3>(of[name]) : glm::vec3(1);
    };
    lod::Optics o;
    o.transmission = number("KHR_materials_transmission", "transmissionFactor", 0);
    o.ior = number("KHR_materials_ior", "ior", 1.5f);
    o.thickness = number("KHR_materials_volume", "thicknessFactor", 0);
    o.attenuationDistance = number("KHR_materials_volume", "attenuationDistance", 0);
    o.attenuationColour = colour("KHR_materials_volume", "attenuationColor");
    o.specular = number("KHR_materials_specular", "specularFactor", 1);
    o.specularColour = colour("KHR_materials_specular", "specularColorFactor");
    return o.isPossible() ? o : lod::Optics{};
}

/// What of these extensions is not drawn.
void noteOpticalTextures(const json& root, Scene& scene) {
    size_t textured = 0;
    for (const json& j : arrayOf(root, "materials"))
        for (const auto& [extension, texture] : {std::pair{"KHR_materials_transmission", "transmissionTexture"},
                                                 {"KHR_materials_volume", "thicknessTexture"},
                                                 {"KHR_materials_specular", "specularTexture"},
                                                 {"KHR_materials_specular", "specularColorTexture"}})
            textured += extensionOf(j, extension).is_object() && extensionOf(j, extension).contains(texture) ? 1 : 0;
    if (textured > 0)
        scene.notes.push_back(fmt::format(
            "{} of transmission, thickness or specular light {} left out: what they vary is even",
            textured == 1 ? "a texture" : fmt::format("{} textures", textured), textured == 1 ? "is" : "are"));
}

void readMaterials(const json& root, Scene& scene) {
    for (const json& j : arrayOf(root, "materials")) {
        Material m;
        m.name = j.value("name", "");
        static const json none = json::object();
        const json& pbr = j.contains("pbrMetallicRoughness") ? j["pbrMetallicRoughness"] : none;
        if (pbr.contains("baseColorFactor")) m.baseColour = vectorOf<glm::vec4>(pbr["baseColorFactor"]);
        m.metallic = pbr.value("metallicFactor", 1.0f);
        m.roughness = pbr.value("roughnessFactor", 1.0f);
        m.baseColourTexture = textureUse(pbr, "baseColorTexture");
        m.metallicRoughnessTexture = textureUse(pbr, "metallicRoughnessTexture");
        m.normalTexture = textureUse(j, "normalTexture");
        m.occlusionTexture = textureUse(j, "occlusionTexture");
        m.emissiveTexture = textureUse(j, "emissiveTexture");
        if (j.contains("normalTexture")) m.normalScale = j["normalTexture"].value("scale", 1.0f);
        if (j.contains("occlusionTexture")) m.occlusionStrength = j["occlusionTexture"].value("strength", 1.0f);
        if (j.contains("emissiveFactor")) m.emissive = vectorOf<glm::vec3>(j["emissiveFactor"]);
        m.emissive *= extensionOf(j, "KHR_materials_emissive_strength").is_object()
                          ? extensionOf(j, "KHR_materials_emissive_strength").value("emissiveStrength", 1.0f)
                          : 1.0f;
        const std::string alpha = j.value("alphaMode", "OPAQUE");
        m.alphaMode = alpha == "MASK" ? AlphaMode::mask : alpha == "BLEND" ? AlphaMode::blend : AlphaMode::opaque;
        m.alphaCutoff = j.value("alphaCutoff", 0.5f);
        m.isDoubleSided = j.value("doubleSided", false);
        m.isUnlit = extensionOf(j, "KHR_materials_unlit").is_object();
        m.optics = opticsOf(j);
        m.optics.blends = m.alphaMode == AlphaMode::blend;
        scene.materials.push_back(std::move(m));
    }
    noteOpticalTextures(root, scene);
    const auto blended = std::count_if(scene.materials.begin(), scene.materials.end(),
                                       [](const Material& m) { return m.alphaMode == AlphaMode::blend; });
    if (blended > 0)
        scene.notes.push_back(fmt::format(
            "{} of {} materials {} transparent (alphaMode BLEND): of each body the nearest of their surfaces "
            "is seen, over what is behind the body; textures that are cut out stay so",
            blended, scene.materials.size(), blended == 1 ? "is" : "are"));
}

/// Textures of a GPU's own formats in a container; by what stands at its beginning (KTX 2.0, 3.1).
bool isKtx2(const std::vector<uint8_t>& bytes) {
    static constexpr std::array<uint8_t, 12> kHead{0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, '\r', '\n', 0x1a, '\n'};
    return bytes.size() >= kHead.size() && std::equal(kHead.begin(), kHead.end(), bytes.begin());
}

Result<void> readImages(const json& root, Buffers& buffers, Scene& scene) {
    const json& images = arrayOf(root, "images");
    std::vector<bool> isKtx(images.size(), false);
    for (size_t i = 0; i < images.size(); ++i) {
        EncodedImage image;
        image.name = images[i].value("name", images[i].value("uri", "").substr(0, 80));
        if (auto bytes = buffers.image(i)) {
            STIPPLE_TRY(buffers.claim(bytes->size(), "its pictures"));
            isKtx[i] = isKtx2(*bytes);
            if (!isKtx[i]) image.bytes = std::move(*bytes);
        } else if (bytes.error().kind == ErrorKind::budget) {
            return tl::unexpected(bytes.error());
        } else {
            scene.notes.push_back(fmt::format("a texture cannot be read and is left out: {}", bytes.error().line()));
        }
        scene.images.push_back(std::move(image));
    }
    const auto isThere = [&](int image) {
        return image >= 0 && image < static_cast<int>(images.size()) &&
               !scene.images[static_cast<size_t>(image)].bytes.empty();
    };
    const auto wrap = [](int code) {
        return code == 33071 ? Wrap::clamp : code == 33648 ? Wrap::mirror : Wrap::repeat;
    };
    for (const json& j : arrayOf(root, "textures")) {
        Texture t;
        t.image = j.value("source", -1);
        if (const json& webp = extensionOf(j, "EXT_texture_webp"); webp.is_object() && t.image < 0)
            t.image = webp.value("source", -1);
        const json& basis = extensionOf(j, "KHR_texture_basisu");
        const int shown = t.image >= 0 || !basis.is_object() ? t.image : basis.value("source", -1);
        if (shown >= 0 && shown < static_cast<int>(images.size()) && isKtx[static_cast<size_t>(shown)])
            scene.notes.push_back(
                fmt::format("texture {} is KTX2 (Basis), which is not read: drawn without it", scene.textures.size()));
        if (!isThere(t.image)) t.image = -1;
        if (j.contains("sampler")) {
            const json& sampler = root["samplers"][j["sampler"].get<size_t>()];
            t.wrapU = wrap(sampler.value("wrapS", 10497));
            t.wrapV = wrap(sampler.value("wrapT", 10497));
        }
        scene.textures.push_back(t);
    }
    return {};
}

void readLightsAndCameras(const json& root, Scene& scene) {
    const json& punctual = extensionOf(root, "KHR_lights_punctual");
    for (const json& j : punctual.is_object() ? punctual["lights"] : json::array()) {
        Light light;
        const std::string type = j.value("type", "point");
        light.kind = type == "directional" ? LightKind::directional
                     : type == "spot"      ? LightKind::spot
                                           : LightKind::point;
        if (j.contains("color")) light.colour = vectorOf<glm::vec3>(j["color"]);
        light.intensity = j.value("intensity", 1.0f);
        light.range = j.value("range", 0.0f);
        if (j.contains("spot")) {
            light.innerCone = j["spot"].value("innerConeAngle", 0.0f);
            light.outerCone = j["spot"].value("outerConeAngle", 0.7853982f);
        }
        scene.lights.push_back(light);
    }
    for (const json& j : arrayOf(root, "cameras")) {
        SceneCamera camera;
        camera.isOrthographic = j["type"] == "orthographic";
        const auto type = j["type"].get<std::string>();
        if (!j.contains(type)) {
            scene.cameras.push_back(camera);
            continue;
        }
        const json& of = j[type];
        camera.nearPlane = of["znear"].get<double>();
        if (camera.isOrthographic) {  // (negative ones would mirror, which glTF advises against)
            camera.width = 2 * std::abs(of["xmag"].get<double>());
            camera.height = 2 * std::abs(of["ymag"].get<double>());
            camera.farPlane = of.value("zfar", 0.0);
        } else {
            camera.fovDegrees = glm::degrees(of["yfov"].get<double>());
        }
        scene.cameras.push_back(camera);
    }
}

}  // namespace

Result<void> readLooks(const Container& container, Buffers& buffers, Scene& scene) {
    const json& root = container.json;
    readMaterials(root, scene);
    STIPPLE_TRY(readImages(root, buffers, scene));
    readLightsAndCameras(root, scene);
    return {};
}

}  // namespace stipple::scene::gltf
