// Materials, textures, images, cameras, lights, and where extensions may stand. Without any of it the shape is still
// there: what is wrong here is passed over, and the reader takes only what is whole.
#include <fmt/format.h>

#include <map>
#include <set>

#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

/// Where the objects of an extension may stand: in what kind of object.
const std::map<std::string, std::set<std::string>>& places() {
    static const std::set<std::string> material{"materials"};
    static const std::map<std::string, std::set<std::string>> all{
        {"KHR_lights_punctual", {"root", "nodes"}},
        {"KHR_texture_transform", {"textureInfo"}},
        {"EXT_mesh_gpu_instancing", {"nodes"}},
        {"EXT_meshopt_compression", {"bufferViews", "buffers"}},
        {"KHR_meshopt_compression", {"bufferViews", "buffers"}},
        {"KHR_mesh_quantization", {}},
        {"KHR_draco_mesh_compression", {"primitives"}},
        {"KHR_materials_unlit", material},
        {"KHR_materials_anisotropy", material},
        {"KHR_materials_clearcoat", material},
        {"KHR_materials_dispersion", material},
        {"KHR_materials_emissive_strength", material},
        {"KHR_materials_ior", material},
        {"KHR_materials_iridescence", material},
        {"KHR_materials_pbrSpecularGlossiness", material},
        {"KHR_materials_sheen", material},
        {"KHR_materials_specular", material},
        {"KHR_materials_transmission", material},
        {"KHR_materials_volume", material},
        {"KHR_materials_variants", {"root", "primitives"}},
        {"KHR_animation_pointer", {"target"}},
        {"EXT_texture_webp", {"textures"}},
        {"KHR_texture_basisu", {"textures"}},
        {"KHR_node_visibility", {"nodes"}},
        {"STIPPLE_store", {"nodes"}}};
    return all;
}

/// Walks every object that has extensions. `kind`: the array it is an item of, or what it is.
void walk(const json& value, const std::string& kind, const std::string& path, const json& root, Problems& p) {
    if (value.is_array()) {
        for (size_t i = 0; i < value.size(); ++i) walk(value[i], kind, fmt::format("{}/{}", path, i), root, p);
        return;
    }
    if (!value.is_object()) return;
    for (const auto& [key, member] : value.items()) {
        if (key == "extras") continue;
        if (key == "extensions") {
            if (!member.is_object() || member.empty()) sayHarmless(p, path, "'extensions' is empty");
            for (const auto& [name, object] : member.items()) {
                const auto place = places().find(name);
                if (place != places().end() && place->second.count(kind) == 0)
                    sayHarmless(p, path + "/extensions", fmt::format("{} does not belong here", name));
                walk(object, name, below(path + "/extensions", name), root, p);
            }
            continue;
        }
        const bool isTexture = member.is_object() && member.contains("index");
        walk(member, isTexture ? "textureInfo" : key, below(path, key), root, p);
    }
}

void checkUnique(const json& root, Problems& p) {
    const json variants = root.value("/extensions/KHR_materials_variants/variants"_json_pointer, json::array());
    for (size_t m = 0; m < arrayOf(root, "meshes").size(); ++m)
        for (const json& primitive : root["meshes"][m]["primitives"]) {
            const json& has = extensionOf(primitive, "KHR_materials_variants");
            const json mappings = has.is_object() ? has.value("mappings", json::array()) : json::array();
            std::set<std::string> seen;
            for (const json& mapping : mappings)
                for (const json& variant : mapping.value("variants", json::array())) {
                    if (!seen.insert(variant.dump()).second)
                        sayHarmless(p, fmt::format("/meshes/{}", m),
                                    fmt::format("maps material variant {} twice", variant.dump()));
                    if (!variant.is_number_unsigned() || variant.get<size_t>() >= variants.size())
                        sayHarmless(p, fmt::format("/meshes/{}", m), "maps a material variant that is not there");
                }
        }
}

void checkImages(const json& root, Problems& p) {
    const json& images = arrayOf(root, "images");
    static const std::set<std::string> plain{"image/png", "image/jpeg"};
    for (size_t i = 0; i < images.size(); ++i) {
        const json& image = images[i];
        const std::string path = fmt::format("/images/{}", i);
        if (image.contains("uri") == image.contains("bufferView"))
            sayHarmless(p, path, "has either a 'uri' or a 'bufferView'");
        if (image.contains("bufferView") && !image.contains("mimeType"))
            sayHarmless(p, path, "'bufferView' without 'mimeType'");
        if (image.contains("bufferView") &&
            root["bufferViews"][image["bufferView"].get<size_t>()].contains("byteStride"))
            sayHarmless(p, path, "its buffer view has a 'byteStride'");
        const std::string mime = image.value("mimeType", "");
        const bool enabled = (mime == "image/webp" && listed(root, "extensionsUsed", "EXT_texture_webp")) ||
                             (mime == "image/ktx2" && listed(root, "extensionsUsed", "KHR_texture_basisu"));
        if (!mime.empty() && plain.count(mime) == 0 && !enabled)
            sayHarmless(p, path, fmt::format("'{}' is not an image type of glTF", mime));
        const std::string uri = image.value("uri", "");
        if (uri.rfind("data:", 0) == 0) {
            const std::string type = uri.substr(5, uri.find_first_of(";,") - 5);
            if (!mime.empty() && mime != type)
                sayHarmless(p, path, fmt::format("is '{}' by one account and '{}' by the other", mime, type));
            const bool isWebp = type == "image/webp" && listed(root, "extensionsUsed", "EXT_texture_webp");
            const bool isKtx = type == "image/ktx2" && listed(root, "extensionsUsed", "KHR_texture_basisu");
            if (plain.count(type) == 0 && !isWebp && !isKtx)
                sayHarmless(p, path, fmt::format("'{}' is not an image type of glTF", type));
        }
    }
    const json& buffers = arrayOf(root, "buffers");
    for (size_t b = 0; b < buffers.size(); ++b) {
        const std::string uri = buffers[b].value("uri", "");
        if (uri.rfind("data:", 0) != 0) continue;
        const std::string type = uri.substr(5, uri.find_first_of(";,") - 5);
        if (uri.find(";;") < uri.find(','))
            sayHarmless(p, fmt::format("/buffers/{}", b), "its data URI has an empty parameter");
        if (type != "application/octet-stream" && type != "application/gltf-buffer")
            sayHarmless(p, fmt::format("/buffers/{}", b),
                        fmt::format("'{}' is not a buffer type of glTF", type.substr(0, 60)));
    }
    const json& textures = arrayOf(root, "textures");
    for (size_t t = 0; t < textures.size(); ++t) {
        if (!textures[t].contains("source")) continue;
        const json& image = images[textures[t]["source"].get<size_t>()];
        const std::string mime = image.value("mimeType", "");
        if (!mime.empty() && plain.count(mime) == 0)
            sayHarmless(p, fmt::format("/textures/{}", t), fmt::format("its image is '{}'", mime));
    }
}

}  // namespace

void checkMaterialsAndExtensions(const json& root, Problems& p) {
    for (const json& name : arrayOf(root, "extensionsRequired"))
        if (!listed(root, "extensionsUsed", name.get<std::string>()))
            sayHarmless(p, "/extensionsRequired",
                        fmt::format("'{}' is not in 'extensionsUsed'", name.get<std::string>()));
    for (const char* name : {"KHR_mesh_quantization", "KHR_materials_volume_needs"})
        if (listed(root, "extensionsUsed", name) && !listed(root, "extensionsRequired", name) &&
            name == std::string("KHR_mesh_quantization"))
            sayHarmless(p, "/extensionsUsed", "KHR_mesh_quantization must also be in 'extensionsRequired'");
    walk(root, "root", "", root, p);
    checkUnique(root, p);
    checkImages(root, p);
    const json& cameras = arrayOf(root, "cameras");
    for (size_t c = 0; c < cameras.size(); ++c) {
        const auto type = cameras[c]["type"].get<std::string>();
        const std::string path = fmt::format("/cameras/{}", c);
        if (!cameras[c].contains(type) || (cameras[c].contains("perspective") && cameras[c].contains("orthographic"))) {
            sayHarmless(p, path, fmt::format("is {}, but has not just the properties of that", type));
            continue;
        }
        const json& of = cameras[c][type];
        if (of.contains("zfar") && !(of["zfar"].get<double>() > of["znear"].get<double>()))
            sayHarmless(p, path, "'zfar' is not beyond 'znear'");
        if (type == "orthographic" && (of["xmag"] == 0 || of["ymag"] == 0))
            sayHarmless(p, path, "'xmag' or 'ymag' is 0");
    }
    const json lights = root.value("/extensions/KHR_lights_punctual/lights"_json_pointer, json::array());
    for (size_t l = 0; l < lights.size(); ++l) {
        const json& light = lights[l];
        if (!light.is_object()) continue;
        const std::string path = fmt::format("/extensions/KHR_lights_punctual/lights/{}", l);
        if (light.value("type", "") == "spot" && !light.contains("spot"))
            sayHarmless(p, path, "a spot light lacks 'spot'");
        if (!light.contains("spot") || !light["spot"].is_object()) continue;
        if (light["spot"].value("innerConeAngle", 0.0) >= light["spot"].value("outerConeAngle", 0.7853981633974483))
            sayHarmless(p, path, "its inner cone is not inside its outer cone");
    }
    for (size_t n = 0; n < arrayOf(root, "nodes").size(); ++n) {
        const json& at = extensionOf(root["nodes"][n], "KHR_lights_punctual");
        if (at.is_null()) continue;
        if (!at.contains("light") || !at["light"].is_number_unsigned() || at["light"].get<size_t>() >= lights.size())
            sayHarmless(p, fmt::format("/nodes/{}", n), "refers to a light that is not there");
    }
}

}  // namespace stipple::scene::gltf
