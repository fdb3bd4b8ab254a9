// From a checked glTF file to a Scene.
#include <fmt/format.h>

#include <filesystem>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/scene/gltf/check.h"
#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/scene.h"

namespace stipple::scene {
namespace {

using gltf::arrayOf;
using gltf::extensionOf;
using nlohmann::json;

template <typename V>
V vectorOf(const json& array) {
    V v;
    for (size_t i = 0; i < array.size(); ++i) v[static_cast<int>(i)] = array[i].get<typename V::value_type>();
    return v;
}

class Reader {
  public:
    Reader(const gltf::Container& c, gltf::Buffers& buffers) : c_(c), root_(c.json), buffers_(buffers) {}

    Result<Scene> read() {
        scene_.path = c_.path;
        readMaterials();
        STIPPLE_TRY(readImages());
        readLightsAndCameras();
        for (const json& mesh : arrayOf(root_, "meshes")) {
            Mesh m;
            m.name = mesh.value("name", "");
            for (const json& primitive : mesh["primitives"]) STIPPLE_TRY(readPrimitive(primitive, m));
            scene_.meshes.push_back(std::move(m));
        }
        STIPPLE_TRY(readNodes());
        for (const char* left : {"animations", "skins"})
            if (!arrayOf(root_, left).empty())
                scene_.notes.push_back(fmt::format("{} are left out: {} of them", left, root_[left].size()));
        return std::move(scene_);
    }

  private:
    TextureUse textureUse(const json& parent, const char* name) const {
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
        // translation * rotation * scale (KHR_texture_transform, "Overview")
        use.transform =
            glm::mat3(cosine * scale.x, -sine * scale.x, 0, sine * scale.y, cosine * scale.y, 0, offset.x, offset.y, 1);
        return use;
    }

    void readMaterials() {
        for (const json& j : arrayOf(root_, "materials")) {
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
            scene_.materials.push_back(std::move(m));
        }
    }

    Result<void> readImages() {
        const json& images = arrayOf(root_, "images");
        for (size_t i = 0; i < images.size(); ++i) {
            EncodedImage image;
            image.name = images[i].value("name", images[i].value("uri", "").substr(0, 80));
            STIPPLE_ASSIGN(image.bytes, buffers_.image(i));
            scene_.images.push_back(std::move(image));
        }
        const auto wrap = [](int code) {
            return code == 33071 ? Wrap::clamp : code == 33648 ? Wrap::mirror : Wrap::repeat;
        };
        for (const json& j : arrayOf(root_, "textures")) {
            Texture t;
            t.image = j.value("source", -1);
            if (const json& webp = extensionOf(j, "EXT_texture_webp"); webp.is_object() && t.image < 0)
                t.image = webp.value("source", -1);
            if (j.contains("sampler")) {
                const json& sampler = root_["samplers"][j["sampler"].get<size_t>()];
                t.wrapU = wrap(sampler.value("wrapS", 10497));
                t.wrapV = wrap(sampler.value("wrapT", 10497));
            }
            scene_.textures.push_back(t);
        }
        return {};
    }

    void readLightsAndCameras() {
        const json& punctual = extensionOf(root_, "KHR_lights_punctual");
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
            scene_.lights.push_back(light);
        }
        for (const json& j : arrayOf(root_, "cameras")) {
            SceneCamera camera;
            camera.isOrthographic = j["type"] == "orthographic";
            const json& of = j[j["type"].get<std::string>()];
            camera.nearPlane = of["znear"].get<double>();
            if (camera.isOrthographic)
                camera.height = 2 * of["ymag"].get<double>();
            else
                camera.fovDegrees = glm::degrees(of["yfov"].get<double>());
            scene_.cameras.push_back(camera);
        }
    }

    template <typename V>
    Result<std::vector<V>> vectors(const json& attributes, const std::string& name, int components, float fill) {
        std::vector<V> out;
        if (!attributes.contains(name)) return out;
        STIPPLE_ASSIGN(const std::vector<double> values, buffers_.values(attributes[name].get<size_t>()));
        const json& accessor = root_["accessors"][attributes[name].get<size_t>()];
        const auto count = accessor["count"].get<size_t>();
        const auto has = static_cast<int>(values.size() / count);
        out.resize(count);
        for (size_t i = 0; i < count; ++i)
            for (int k = 0; k < components; ++k)
                out[i][k] =
                    k < has ? static_cast<float>(values[i * static_cast<size_t>(has) + static_cast<size_t>(k)]) : fill;
        return out;
    }

    Result<void> readPrimitive(const json& j, Mesh& mesh) {
        const json& attributes = j["attributes"];
        if (!attributes.contains("POSITION")) {
            scene_.notes.push_back(fmt::format("mesh '{}': a primitive without positions is left out", mesh.name));
            return {};
        }
        Primitive p;
        STIPPLE_ASSIGN(p.position, vectors<glm::vec3>(attributes, "POSITION", 3, 0));
        STIPPLE_ASSIGN(p.normal, vectors<glm::vec3>(attributes, "NORMAL", 3, 0));
        STIPPLE_ASSIGN(p.tangent, vectors<glm::vec4>(attributes, "TANGENT", 4, 1));
        STIPPLE_ASSIGN(p.colour, vectors<glm::vec4>(attributes, "COLOR_0", 4, 1));
        STIPPLE_ASSIGN(const auto radii, vectors<glm::vec1>(attributes, "_RADIUS", 1, 0));
        for (const glm::vec1& r : radii) p.radius.push_back(r.x);
        for (int set = 0; attributes.contains(fmt::format("TEXCOORD_{}", set)); ++set) {
            STIPPLE_ASSIGN(std::vector<glm::vec2> uv,
                           vectors<glm::vec2>(attributes, fmt::format("TEXCOORD_{}", set), 2, 0));
            p.uv.push_back(std::move(uv));
        }
        p.material = j.value("material", -1);
        std::vector<uint32_t> order(p.position.size());
        for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<uint32_t>(i);
        if (j.contains("indices")) {
            STIPPLE_ASSIGN(order, buffers_.indices(j["indices"].get<size_t>()));
        }
        unroll(order, j.value("mode", 4), p);
        if (j.contains("targets"))
            scene_.notes.push_back(fmt::format("mesh '{}': morph targets are left out", mesh.name));
        mesh.primitives.push_back(std::move(p));
        return {};
    }

    /// glTF 2.0, 3.7.2.1: modes 0 to 6.
    static void unroll(const std::vector<uint32_t>& order, int mode, Primitive& p) {
        const size_t n = order.size();
        p.kind = mode == 0 ? PrimitiveKind::points : mode <= 3 ? PrimitiveKind::lines : PrimitiveKind::triangles;
        const auto add = [&](std::initializer_list<size_t> at) {
            for (const size_t i : at) p.indices.push_back(order[i]);
        };
        switch (mode) {
            case 0:
                p.indices = order;
                break;
            case 1:
                for (size_t i = 0; i + 2 <= n; i += 2) add({i, i + 1});
                break;
            case 2:
            case 3:
                for (size_t i = 0; i + 2 <= n; ++i) add({i, i + 1});
                if (mode == 2 && n > 2) add({n - 1, 0});
                break;
            case 5:
                for (size_t i = 0; i + 3 <= n; ++i) i % 2 == 0 ? add({i, i + 1, i + 2}) : add({i + 1, i, i + 2});
                break;
            case 6:
                for (size_t i = 1; i + 2 <= n; ++i) add({i, i + 1, 0});
                break;
            default:
                for (size_t i = 0; i + 3 <= n; i += 3) add({i, i + 1, i + 2});
                break;
        }
    }

    static glm::dmat4 localOf(const json& j) {
        if (j.contains("matrix")) {
            glm::dmat4 m;
            for (int k = 0; k < 16; ++k) m[k / 4][k % 4] = j["matrix"][static_cast<size_t>(k)].get<double>();
            return m;
        }
        glm::dmat4 m(1);
        if (j.contains("translation")) m = glm::translate(m, vectorOf<glm::dvec3>(j["translation"]));
        if (j.contains("rotation")) {
            const auto q = vectorOf<glm::dvec4>(j["rotation"]);
            m *= glm::mat4_cast(glm::normalize(glm::dquat(q.w, q.x, q.y, q.z)));
        }
        if (j.contains("scale")) m = glm::scale(m, vectorOf<glm::dvec3>(j["scale"]));
        return m;
    }

    Result<void> readInstances(const json& extension, Node& node) {
        if (!extension.is_object()) return {};
        const json& attributes = extension["attributes"];
        STIPPLE_ASSIGN(const auto translations, vectors<glm::vec3>(attributes, "TRANSLATION", 3, 0));
        STIPPLE_ASSIGN(const auto rotations, vectors<glm::vec4>(attributes, "ROTATION", 4, 0));
        STIPPLE_ASSIGN(const auto scales, vectors<glm::vec3>(attributes, "SCALE", 3, 1));
        const size_t count = std::max({translations.size(), rotations.size(), scales.size()});
        for (const size_t n : {translations.size(), rotations.size(), scales.size()})
            if (n != 0 && n != count)
                return fail(ErrorKind::input, "attributes of instances differ in their number", c_.path);
        for (size_t i = 0; i < count; ++i) {
            glm::dmat4 m(1);
            if (!translations.empty()) m = glm::translate(m, glm::dvec3(translations[i]));
            if (!rotations.empty()) {
                const glm::dquat q(rotations[i].w, rotations[i].x, rotations[i].y, rotations[i].z);
                m *= glm::mat4_cast(glm::length(q) > 0 ? glm::normalize(q) : glm::dquat(1, 0, 0, 0));
            }
            if (!scales.empty()) m = glm::scale(m, glm::dvec3(scales[i]));
            node.instances.push_back(m);
        }
        return {};
    }

    /// The nodes of the default scene (of all, where there is none), parents first; no recursion, however deep it goes.
    Result<void> readNodes() {
        const json& nodes = arrayOf(root_, "nodes");
        std::vector<std::pair<size_t, int>> open;
        const json& scenes = arrayOf(root_, "scenes");
        if (!scenes.empty()) {
            const json list = scenes[root_.value("scene", size_t{0})].value("nodes", json::array());
            for (const json& n : list) open.emplace_back(n.get<size_t>(), -1);
        } else {
            std::vector<bool> isChild(nodes.size(), false);
            for (const json& n : nodes)
                for (const json& child : n.value("children", json::array())) isChild[child.get<size_t>()] = true;
            for (size_t i = 0; i < nodes.size(); ++i)
                if (!isChild[i]) open.emplace_back(i, -1);
        }
        for (size_t at = 0; at < open.size(); ++at) {
            const auto [index, parent] = open[at];
            const json& j = nodes[index];
            Node node;
            node.name = j.value("name", "");
            node.local = localOf(j);
            node.parent = parent;
            node.mesh = j.value("mesh", -1);
            node.camera = j.value("camera", -1);
            if (const json& light = extensionOf(j, "KHR_lights_punctual"); light.is_object())
                node.light = light["light"].get<int>();
            if (const json& store = extensionOf(j, "STIPPLE_store"); store.is_object())
                node.store = (std::filesystem::path(c_.folder) / store["uri"].get<std::string>()).string();
            if (const json& visible = extensionOf(j, "KHR_node_visibility"); visible.is_object())
                node.isVisible = visible.value("visible", true);
            STIPPLE_TRY(readInstances(extensionOf(j, "EXT_mesh_gpu_instancing"), node));
            if (glm::determinant(node.local) == 0)
                scene_.notes.push_back(fmt::format("node '{}' has no extent along some axis", node.name));
            for (const json& child : j.value("children", json::array()))
                open.emplace_back(child.get<size_t>(), static_cast<int>(scene_.nodes.size()));
            scene_.nodes.push_back(std::move(node));
        }
        return {};
    }

    const gltf::Container& c_;
    const json& root_;
    gltf::Buffers& buffers_;
    Scene scene_;
};

}  // namespace

Result<Scene> readGltf(const std::string& path, bool repair) {
    STIPPLE_ASSIGN(const gltf::Container c, gltf::readContainer(path));
    gltf::Buffers buffers(c);
    try {  // a property of a type that no check expected ends here
        STIPPLE_ASSIGN(const std::vector<std::string> passedOver, gltf::requireGood(c, buffers, repair));
        STIPPLE_ASSIGN(Scene scene, Reader(c, buffers).read());
        if (!passedOver.empty())
            scene.notes.push_back(
                fmt::format("{} faults passed over (50: or more), the first at {}", passedOver.size(), passedOver[0]));
        return scene;
    } catch (const std::exception& e) {
        return fail(ErrorKind::input, fmt::format("is not what glTF expects: {}", e.what()), path,
                    "the file is not valid glTF 2.0");
    }
}

}  // namespace stipple::scene
