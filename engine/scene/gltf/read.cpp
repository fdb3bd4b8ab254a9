// From a checked glTF file to a Scene.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/base/file.h"
#include "engine/base/numbers.h"
#include "engine/scene/gltf/check.h"
#include "engine/scene/gltf/effects.h"
#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/looks.h"
#include "engine/scene/scene_bytes.h"

namespace stipple::scene {
namespace {

using gltf::arrayOf;
using gltf::extensionOf;
using gltf::vectorOf;
using nlohmann::json;

/// Of an instance until it is placed, rounded up (about 250 bytes were seen).
constexpr uint64_t kInstanceBytes = 512;

class Reader {
  public:
    Reader(const gltf::Container& c, gltf::Buffers& buffers, const ReadSettings& settings)
        : c_(c), root_(c.json), buffers_(buffers), settings_(settings) {}

    Result<Scene> read() {
        scene_.path = c_.path;
        STIPPLE_TRY(gltf::readLooks(c_, buffers_, scene_));
        for (const json& mesh : arrayOf(root_, "meshes")) {
            Mesh m;
            m.name = mesh.value("name", "");
            for (const json& primitive : mesh["primitives"]) STIPPLE_TRY(readPrimitive(primitive, m));
            scene_.meshes.push_back(std::move(m));
        }
        STIPPLE_TRY(readNodes());
        gltf::readEffects(root_, scene_);
        for (const char* left : {"animations", "skins"})
            if (!arrayOf(root_, left).empty())
                scene_.notes.push_back(fmt::format("{} are left out: {} of them", left, root_[left].size()));
        return std::move(scene_);
    }

  private:
    /// `fill`: what is not there, or no number.
    template <typename V>
    Result<std::vector<V>> vectors(const json& attributes, const std::string& name, int components, float fill,
                                   bool keepsNan = false) {
        std::vector<V> out;
        if (!attributes.contains(name)) return out;
        const json& accessor = root_["accessors"][attributes[name].get<size_t>()];
        const auto count = accessor["count"].get<size_t>();
        STIPPLE_ASSIGN(const std::vector<double> values, buffers_.values(attributes[name].get<size_t>()));
        if (count == 0) return out;
        STIPPLE_TRY(buffers_.claim(count * sizeof(V), "its vertices"));
        const auto has = static_cast<int>(values.size() / count);
        out.resize(count, V(fill));
        for (size_t i = 0; i < count; ++i)
            for (int k = 0; k < std::min(components, has); ++k) {
                const auto value = static_cast<float>(values[i * static_cast<size_t>(has) + static_cast<size_t>(k)]);
                if (std::isfinite(value) || keepsNan) out[i][k] = value;
            }
        return out;
    }

    /// An attribute beside the positions: as many, or none.
    template <typename V>
    Result<std::vector<V>> beside(const Primitive& p, const json& attributes, const std::string& name, int components,
                                  float fill) {
        STIPPLE_ASSIGN(std::vector<V> out, vectors<V>(attributes, name, components, fill));
        if (out.size() < p.position.size() && !out.empty()) {
            scene_.notes.push_back(
                fmt::format("{} is left out: {} of {} vertices have it", name, out.size(), p.position.size()));
            return std::vector<V>();
        }
        if (!out.empty()) out.resize(p.position.size());
        return out;
    }

    Result<void> readPrimitive(const json& j, Mesh& mesh) {
        const json& attributes = j["attributes"];
        if (!attributes.contains("POSITION")) {
            scene_.notes.push_back(fmt::format("mesh '{}': a primitive without positions is left out", mesh.name));
            return {};
        }
        Primitive p;
        STIPPLE_ASSIGN(p.position, vectors<glm::vec3>(attributes, "POSITION", 3, 0, true));
        STIPPLE_ASSIGN(p.normal, beside<glm::vec3>(p, attributes, "NORMAL", 3, 0));
        STIPPLE_ASSIGN(p.tangent, beside<glm::vec4>(p, attributes, "TANGENT", 4, 1));
        STIPPLE_ASSIGN(p.colour, beside<glm::vec4>(p, attributes, "COLOR_0", 4, 1));
        STIPPLE_ASSIGN(const auto radii, beside<glm::vec1>(p, attributes, "_RADIUS", 1, 0));
        for (const glm::vec1& r : radii) p.radius.push_back(r.x);
        constexpr int kMostSets = 16;
        for (int set = 0; set < kMostSets; ++set) {
            const std::string name = fmt::format("TEXCOORD_{}", set);
            if (!attributes.contains(name)) continue;
            p.uv.resize(static_cast<size_t>(set) + 1);
            STIPPLE_ASSIGN(p.uv.back(), beside<glm::vec2>(p, attributes, name, 2, 0));
        }
        STIPPLE_TRY(buffers_.claim(p.uv.size() * p.position.size() * sizeof(glm::vec2), "its vertices"));
        for (auto& uv : p.uv) uv.resize(p.position.size(), glm::vec2(0));  // sets that are not there
        p.material = j.value("material", -1);
        std::vector<uint32_t> order;
        if (j.contains("indices")) {
            STIPPLE_ASSIGN(order, buffers_.indices(j["indices"].get<size_t>()));
        } else {
            order.resize(p.position.size());
            for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<uint32_t>(i);
        }
        const int mode = j.value("mode", 4);
        constexpr uint64_t kUnrolled = 3;  // of a strip
        STIPPLE_TRY(buffers_.claim(order.size() * sizeof(order[0]) * (mode > 4 ? kUnrolled : 2), "its indices"));
        unroll(order, mode, p);
        dropBroken(p, mesh.name);
        if (j.contains("targets"))
            scene_.notes.push_back(fmt::format("mesh '{}': morph targets are left out", mesh.name));
        mesh.primitives.push_back(std::move(p));
        return {};
    }

    /// Elements whose vertices are not there or are no numbers.
    void dropBroken(Primitive& p, const std::string& name) {
        const size_t corners = p.kind == PrimitiveKind::points ? 1 : p.kind == PrimitiveKind::lines ? 2 : 3;
        const auto isGood = [&](uint32_t i) { return i < p.position.size() && isFinite(p.position[i]); };
        size_t kept = 0;
        for (size_t i = 0; i + corners <= p.indices.size(); i += corners) {
            bool good = true;
            for (size_t k = 0; k < corners; ++k) good = good && isGood(p.indices[i + k]);
            if (!good) continue;
            for (size_t k = 0; k < corners; ++k) p.indices[kept++] = p.indices[i + k];
        }
        if (kept < p.indices.size() / corners * corners)
            scene_.notes.push_back(
                fmt::format("mesh '{}': {} of {} elements refer to vertices that are not there or no "
                            "numbers, and are left out",
                            name, p.indices.size() / corners - kept / corners, p.indices.size() / corners));
        p.indices.resize(kept);
        for (glm::vec3& v : p.position)  // nobody refers to those any more
            if (!isFinite(v)) v = glm::vec3(0);
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
            for (int column = 0; column < 4; ++column) m[column][3] = column == 3 ? 1 : 0;
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
        for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"}) {  // each becomes a placed thing
            if (!attributes.contains(name)) continue;
            const auto count = root_["accessors"][attributes[name].get<size_t>()]["count"].get<uint64_t>();
            STIPPLE_TRY(buffers_.claim(count > UINT64_MAX / kInstanceBytes ? UINT64_MAX : count * kInstanceBytes,
                                       fmt::format("node '{}' with {} instances", node.name, count)));
            break;
        }
        STIPPLE_ASSIGN(const auto translations, vectors<glm::vec3>(attributes, "TRANSLATION", 3, 0));
        STIPPLE_ASSIGN(const auto rotations, vectors<glm::vec4>(attributes, "ROTATION", 4, 0));
        STIPPLE_ASSIGN(const auto scales, vectors<glm::vec3>(attributes, "SCALE", 3, 1));
        const size_t count = std::max({translations.size(), rotations.size(), scales.size()});
        for (const size_t n : {translations.size(), rotations.size(), scales.size()})
            if (n != 0 && n != count)
                return fail(ErrorKind::input, "attributes of instances differ in their number", c_.path);
        const auto has = [&](const char* name) { return attributes.contains(name); };
        if (count == 0 && (has("TRANSLATION") || has("ROTATION") || has("SCALE"))) {  // none, and not itself either
            node.mesh = -1;
            node.store.clear();
        }
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

    /// Nodes that the default scene begins with (all that are nobody's children, where there is none); second: those
    /// of them that also stand below another.
    std::array<std::vector<size_t>, 2> rootNodes() const {
        const json& nodes = arrayOf(root_, "nodes");
        std::vector<bool> isChild(nodes.size(), false);
        for (const json& n : nodes)
            for (const json& child : n.value("children", json::array())) isChild[child.get<size_t>()] = true;
        std::array<std::vector<size_t>, 2> roots;
        const json& scenes = arrayOf(root_, "scenes");
        if (!scenes.empty()) {
            const json list = scenes[root_.value("scene", size_t{0})].value("nodes", json::array());
            for (const json& n : list) roots[isChild[n.get<size_t>()] ? 1 : 0].push_back(n.get<size_t>());
        } else {
            for (size_t i = 0; i < nodes.size(); ++i)
                if (!isChild[i]) roots[0].push_back(i);
        }
        return roots;
    }

    /// The nodes, parents first; no recursion, however deep it goes. Each is taken once.
    Result<void> readNodes() {
        const json& nodes = arrayOf(root_, "nodes");
        std::vector<bool> isTaken(nodes.size(), false);
        for (const std::vector<size_t>& starts : rootNodes()) STIPPLE_TRY(readNodesFrom(starts, nodes, isTaken));
        return {};
    }

    Result<void> readNodesFrom(const std::vector<size_t>& starts, const json& nodes, std::vector<bool>& isTaken) {
        std::vector<std::pair<size_t, int>> open;
        open.reserve(starts.size());
        for (const size_t start : starts) open.emplace_back(start, -1);
        for (size_t at = 0; at < open.size(); ++at) {
            const auto [index, parent] = open[at];
            if (isTaken[index]) continue;
            isTaken[index] = true;
            const json& j = nodes[index];
            Node node;
            node.name = j.value("name", "");
            node.local = localOf(j);
            node.parent = parent;
            node.mesh = j.value("mesh", -1);
            node.camera = j.value("camera", -1);
            if (const json& light = extensionOf(j, "KHR_lights_punctual"); light.is_object()) {
                const auto which = light.contains("light") && light["light"].is_number_unsigned()
                                       ? light["light"].get<uint64_t>()
                                       : UINT64_MAX;
                node.light = which < scene_.lights.size() ? static_cast<int>(which) : -1;
            }
            if (const json& store = extensionOf(j, "STIPPLE_store"); store.is_object()) {
                const auto uri = store["uri"].get<std::string>();
                if (c_.resolve) {  // (a store is read bit by bit as it is drawn)
                    scene_.notes.push_back(fmt::format(
                        "node '{}' places the store '{}', which is read from a file only: left out", node.name, uri));
                } else {
                    STIPPLE_ASSIGN(node.store, fileOfScene(c_.folder, uri, settings_));
                }
            }
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
    const ReadSettings& settings_;
    Scene scene_;
};

}  // namespace

Result<Scene> readGltf(const std::string& path, const ReadSettings& settings) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    return readGltf(file, settings, {});
}

Result<Scene> readGltf(const ByteSource& file, const ReadSettings& settings, const Resolve& resolve) {
    const std::string& path = file.path();
    try {
        STIPPLE_ASSIGN(gltf::Container c, gltf::readContainer(file, settings.memoryBytes));
        c.resolve = resolve;
        gltf::Buffers buffers(c, settings);
        STIPPLE_ASSIGN(const std::vector<std::string> passedOver, gltf::requireGood(c, buffers, settings.isStrict));
        STIPPLE_ASSIGN(Scene scene, Reader(c, buffers, settings).read());
        if (!passedOver.empty())
            scene.notes.push_back(fmt::format(
                "the file is not quite glTF 2.0: faults passed over: {}{}, the first: {}", passedOver.size(),
                passedOver.size() >= gltf::kMostProblems / 2 ? " or more" : "", passedOver[0]));
        return scene;
    } catch (const json::exception&) {  // a property of a type that no check expected
        return fail(ErrorKind::input, "holds a property of a type that glTF does not have", path,
                    "the file is not valid glTF 2.0");
    } catch (const std::bad_alloc&) {
        return fail(ErrorKind::budget, "does not fit in memory", path, "close other programs, or split the scene");
    }
}

}  // namespace stipple::scene
