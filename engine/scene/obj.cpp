// Wavefront OBJ with MTL materials, by tinyobjloader; only what it gives is checked, since it believes its input.
#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <tuple>

#include "engine/base/file.h"
#include "engine/scene/scene.h"

namespace stipple::scene {
namespace {

constexpr uint64_t kMostImageBytes = uint64_t{1} << 30;

/// An image beside the file; missing ones are noted and count as white.
int addImage(const std::string& folder, std::string name, Scene& scene, std::map<std::string, int>& known) {
    if (name.empty()) return -1;
    for (char& c : name)
        if (c == '\\') c = '/';  // written on other systems
    if (const auto found = known.find(name); found != known.end()) return found->second;
    EncodedImage image;
    image.name = name;
    const auto file = InputFile::open((std::filesystem::path(folder) / name).string());
    if (file && file->sizeBytes() <= kMostImageBytes) {
        image.bytes.resize(file->sizeBytes());
        if (!file->readAt(0, image.bytes.data(), image.bytes.size())) image.bytes.clear();
    }
    if (image.bytes.empty()) {
        scene.notes.push_back(fmt::format("texture '{}' cannot be read and counts as white", name));
        return known[name] = -1;
    }
    scene.images.push_back(std::move(image));
    scene.textures.push_back({static_cast<int>(scene.images.size()) - 1, Wrap::repeat, Wrap::repeat});
    return known[name] = static_cast<int>(scene.textures.size()) - 1;
}

/// OBJ colours are sRGB by custom; materials here are linear.
float linear(float s) { return s <= 0.04045f ? s / 12.92f : std::pow((s + 0.055f) / 1.055f, 2.4f); }

Material materialOf(const tinyobj::material_t& m, int texture) {
    Material out;
    out.name = m.name;
    for (int c = 0; c < 3; ++c) {
        out.baseColour[c] = texture >= 0 ? 1.0f : linear(std::isfinite(m.diffuse[c]) ? m.diffuse[c] : 1.0f);
        out.emissive[c] = linear(std::isfinite(m.emission[c]) ? m.emission[c] : 0.0f);
    }
    out.metallic = 0;
    out.roughness = 1;
    out.baseColourTexture.texture = texture;
    // v grows upwards in OBJ and downwards in glTF and here.
    out.baseColourTexture.transform = glm::mat3(1, 0, 0, 0, -1, 0, 0, 1, 1);
    if (!m.alpha_texname.empty() || m.dissolve < 1) out.alphaMode = AlphaMode::mask;
    out.baseColour.a = std::isfinite(m.dissolve) ? m.dissolve : 1.0f;
    return out;
}

}  // namespace

Result<Scene> readObj(const std::string& path) {
    STIPPLE_TRY(InputFile::open(path));  // its error says more
    tinyobj::ObjReaderConfig config;
    config.triangulate = true;
    config.vertex_color = true;
    tinyobj::ObjReader reader;
    if (!reader.ParseFromFile(path, config)) {
        const std::string& text = reader.Error();
        return fail(ErrorKind::input, "is not a readable OBJ: " + text.substr(0, text.find('\n')), path);
    }
    Scene scene;
    scene.path = path;
    const std::string folder = std::filesystem::path(path).parent_path().string();
    std::map<std::string, int> images;
    for (const tinyobj::material_t& m : reader.GetMaterials())
        scene.materials.push_back(materialOf(m, addImage(folder, m.diffuse_texname, scene, images)));
    const tinyobj::attrib_t& a = reader.GetAttrib();
    const auto positions = static_cast<int>(a.vertices.size() / 3), normals = static_cast<int>(a.normals.size() / 3),
               uvs = static_cast<int>(a.texcoords.size() / 2);
    uint64_t dropped = 0;
    Mesh mesh;
    for (const tinyobj::shape_t& shape : reader.GetShapes()) {
        std::map<int, Primitive> byMaterial;
        for (size_t f = 0; f * 3 + 3 <= shape.mesh.indices.size(); ++f) {
            bool good = f >= shape.mesh.num_face_vertices.size() || shape.mesh.num_face_vertices[f] == 3;
            for (size_t k = 0; k < 3; ++k) {
                const int v = shape.mesh.indices[f * 3 + k].vertex_index;
                good = good && v >= 0 && v < positions;
                for (size_t c = 0; good && c < 3; ++c) good = std::isfinite(a.vertices[3 * static_cast<size_t>(v) + c]);
            }
            if (!good) {
                ++dropped;
                continue;
            }
            int material = f < shape.mesh.material_ids.size() ? shape.mesh.material_ids[f] : -1;
            if (material >= static_cast<int>(scene.materials.size())) material = -1;
            Primitive& p = byMaterial[material];
            p.material = material;
            if (p.uv.empty()) p.uv.resize(1);
            for (size_t k = 0; k < 3; ++k) {
                const tinyobj::index_t& i = shape.mesh.indices[f * 3 + k];
                const auto v = static_cast<size_t>(i.vertex_index);
                p.indices.push_back(static_cast<uint32_t>(p.position.size()));
                p.position.emplace_back(a.vertices[3 * v], a.vertices[3 * v + 1], a.vertices[3 * v + 2]);
                const bool hasNormal = i.normal_index >= 0 && i.normal_index < normals;
                const auto n = static_cast<size_t>(hasNormal ? i.normal_index : 0) * 3;
                p.normal.push_back(hasNormal ? glm::vec3(a.normals[n], a.normals[n + 1], a.normals[n + 2])
                                             : glm::vec3(0));
                const bool hasUv = i.texcoord_index >= 0 && i.texcoord_index < uvs;
                const auto t = static_cast<size_t>(hasUv ? i.texcoord_index : 0) * 2;
                p.uv[0].push_back(hasUv ? glm::vec2(a.texcoords[t], a.texcoords[t + 1]) : glm::vec2(0));
                if (a.colors.size() == a.vertices.size())
                    p.colour.emplace_back(linear(a.colors[3 * v]), linear(a.colors[3 * v + 1]),
                                          linear(a.colors[3 * v + 2]), 1);
            }
        }
        for (auto& [material, primitive] : byMaterial) mesh.primitives.push_back(std::move(primitive));
    }
    if (dropped > 0)
        scene.notes.push_back(fmt::format("{} faces refer to vertices that are not there or no numbers", dropped));
    if (!reader.Warning().empty()) scene.notes.push_back(reader.Warning().substr(0, reader.Warning().find('\n')));
    if (mesh.primitives.empty()) return fail(ErrorKind::input, "holds no faces", path);
    scene.meshes.push_back(std::move(mesh));
    Node node;
    node.mesh = 0;
    scene.nodes.push_back(node);
    return scene;
}

}  // namespace stipple::scene
