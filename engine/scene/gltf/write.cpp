// Scenes out: glTF 2.0 through tinygltf. Vertex data as floats and 32-bit indices in one buffer.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "engine/base/file.h"
#include "engine/scene/gltf/effects.h"
#include "engine/scene/scene.h"

// The library is compiled elsewhere; its header is not clean of warnings.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop

namespace stipple::scene {
namespace {

class Writer {
  public:
    explicit Writer(const Scene& scene) : scene_(scene) {
        model_.asset.version = "2.0";
        model_.asset.generator = "stipple";
        model_.buffers.resize(1);
    }

    tinygltf::Model take() {
        for (const EncodedImage& image : scene_.images) addImage(image);
        for (const Texture& t : scene_.textures) addTexture(t);
        for (const Material& m : scene_.materials) addMaterial(m);
        findOrigins();
        for (size_t m = 0; m < scene_.meshes.size(); ++m) addMesh(scene_.meshes[m], origins_[m]);
        for (const SceneCamera& c : scene_.cameras) addCamera(c);
        for (const Light& l : scene_.lights) addLight(l);
        tinygltf::Scene root;
        for (size_t n = 0; n < scene_.nodes.size(); ++n) {
            addNode(scene_.nodes[n]);
            const int parent = scene_.nodes[n].parent;
            if (parent < 0)
                root.nodes.push_back(static_cast<int>(n));
            else
                model_.nodes[static_cast<size_t>(parent)].children.push_back(static_cast<int>(n));
        }
        addMoved();
        if (const nlohmann::json asked = gltf::effectsAsJson(scene_.effects); !asked.is_null())
            root.extras = Value(Value::Object{{"stipple", valueOf(asked)}});
        model_.scenes.push_back(root);
        model_.defaultScene = 0;
        std::sort(model_.extensionsUsed.begin(), model_.extensionsUsed.end());
        return std::move(model_);
    }

  private:
    using Value = tinygltf::Value;
    static Value numbers(const double* v, size_t n) {
        Value::Array a;
        for (size_t i = 0; i < n; ++i) a.emplace_back(v[i]);
        return Value(a);
    }
    static Value valueOf(const nlohmann::json& j) {
        if (j.is_string()) return Value(j.get<std::string>());
        if (j.is_number()) return Value(j.get<double>());
        Value::Array list;
        Value::Object object;
        for (const auto& [key, member] : j.items()) {
            list.push_back(valueOf(member));
            object.emplace(key, list.back());
        }
        return j.is_array() ? Value(list) : Value(object);
    }
    static std::vector<double> doubles(const glm::vec3& v) { return {v.x, v.y, v.z}; }
    void use(const char* extension) {
        if (std::find(model_.extensionsUsed.begin(), model_.extensionsUsed.end(), extension) ==
            model_.extensionsUsed.end())
            model_.extensionsUsed.emplace_back(extension);
    }

    int addView(const void* data, size_t bytes, int target) {
        auto& out = model_.buffers[0].data;
        out.resize((out.size() + 3) / 4 * 4);
        tinygltf::BufferView view;
        view.buffer = 0;
        view.byteOffset = out.size();
        view.byteLength = bytes;
        view.target = target;
        const auto* from = static_cast<const uint8_t*>(data);
        out.insert(out.end(), from, from + bytes);
        model_.bufferViews.push_back(view);
        return static_cast<int>(model_.bufferViews.size()) - 1;
    }
    template <typename T>
    int addFloats(const std::vector<T>& values, int type, bool isPosition = false,
                  int target = TINYGLTF_TARGET_ARRAY_BUFFER) {
        constexpr size_t n = sizeof(T) / sizeof(float);
        tinygltf::Accessor a;
        a.bufferView = addView(values.data(), values.size() * sizeof(T), target);
        a.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
        a.count = values.size();
        a.type = type;
        if (isPosition)
            for (int c = 0; c < static_cast<int>(n); ++c) {
                double lo = 3e38, hi = -3e38;
                for (const T& v : values) {
                    lo = std::min(lo, static_cast<double>(v[c]));
                    hi = std::max(hi, static_cast<double>(v[c]));
                }
                a.minValues.push_back(lo);
                a.maxValues.push_back(hi);
            }
        model_.accessors.push_back(a);
        return static_cast<int>(model_.accessors.size()) - 1;
    }

    void addImage(const EncodedImage& image) {
        tinygltf::Image out;
        out.name = image.name;
        const bool isPng = image.bytes.size() > 4 && image.bytes[1] == 'P';
        out.mimeType = isPng ? "image/png" : "image/jpeg";
        out.bufferView = addView(image.bytes.data(), image.bytes.size(), 0);
        model_.images.push_back(out);
    }
    void addTexture(const Texture& t) {
        const auto wrap = [](Wrap w) {
            return w == Wrap::repeat   ? TINYGLTF_TEXTURE_WRAP_REPEAT
                   : w == Wrap::mirror ? TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT
                                       : TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
        };
        tinygltf::Sampler sampler;
        sampler.wrapS = wrap(t.wrapU);
        sampler.wrapT = wrap(t.wrapV);
        model_.samplers.push_back(sampler);
        tinygltf::Texture out;
        out.sampler = static_cast<int>(model_.samplers.size()) - 1;
        out.source = t.image;
        model_.textures.push_back(out);
    }
    template <typename Info>
    static void setTexture(const TextureUse& use, Info& out) {
        out.index = use.texture;
        out.texCoord = use.uvSet;
    }
    void addMaterial(const Material& m) {
        tinygltf::Material out;
        out.name = m.name;
        auto& pbr = out.pbrMetallicRoughness;
        pbr.baseColorFactor = {m.baseColour.r, m.baseColour.g, m.baseColour.b, m.baseColour.a};
        pbr.metallicFactor = m.metallic;
        pbr.roughnessFactor = m.roughness;
        setTexture(m.baseColourTexture, pbr.baseColorTexture);
        setTexture(m.metallicRoughnessTexture, pbr.metallicRoughnessTexture);
        setTexture(m.normalTexture, out.normalTexture);
        out.normalTexture.scale = m.normalScale;
        setTexture(m.occlusionTexture, out.occlusionTexture);
        out.occlusionTexture.strength = m.occlusionStrength;
        setTexture(m.emissiveTexture, out.emissiveTexture);
        out.emissiveFactor = doubles(m.emissive);
        out.alphaMode = m.alphaMode == AlphaMode::opaque ? "OPAQUE" : m.alphaMode == AlphaMode::mask ? "MASK" : "BLEND";
        out.alphaCutoff = m.alphaCutoff;
        out.doubleSided = m.isDoubleSided;
        if (m.isUnlit) {
            use("KHR_materials_unlit");
            out.extensions["KHR_materials_unlit"] = Value(Value::Object{});
        }
        addOptics(m.optics, out);
        model_.materials.push_back(out);
    }
    /// As extensions, where they are not those of every material.
    void addOptics(const lod::Optics& o, tinygltf::Material& out) {
        const lod::Optics usual;
        const auto list = [](const glm::vec3& v) {
            return Value(Value::Array{Value(double{v.x}), Value(double{v.y}), Value(double{v.z})});
        };
        const auto add = [&](const char* name, Value::Object values) {
            use(name);
            out.extensions[name] = Value(std::move(values));
        };
        if (o.transmission > 0)
            add("KHR_materials_transmission", {{"transmissionFactor", Value(double{o.transmission})}});
        if (o.ior != usual.ior) add("KHR_materials_ior", {{"ior", Value(double{o.ior})}});
        if (o.thickness > 0) {
            Value::Object volume{{"thicknessFactor", Value(double{o.thickness})},
                                 {"attenuationColor", list(o.attenuationColour)}};
            if (o.attenuationDistance > 0) volume["attenuationDistance"] = Value(double{o.attenuationDistance});
            add("KHR_materials_volume", std::move(volume));
        }
        if (o.specular != usual.specular || o.specularColour != usual.specularColour)
            add("KHR_materials_specular",
                {{"specularFactor", Value(double{o.specular})}, {"specularColorFactor", list(o.specularColour)}});
    }
    /// Vertices are floats in the file, and the matrices of nodes doubles: meshes that have more digits than floats are
    /// written around zero, below nodes that move them back. (Instances are floats, too: their meshes stay.)
    void findOrigins() {
        origins_.assign(scene_.meshes.size(), glm::dvec3(0));
        for (size_t m = 0; m < scene_.meshes.size(); ++m) {
            Box box;
            bool isFiner = false;
            for (const Primitive& p : scene_.meshes[m].primitives) {
                isFiner = isFiner || !p.rest.empty();
                for (size_t i = 0; i < p.position.size(); ++i) box.add(p.at(i));
            }
            if (isFiner && !box.isEmpty()) origins_[m] = glm::round(0.5 * (box.least + box.greatest));
        }
        for (const Node& n : scene_.nodes)
            if (n.mesh >= 0 && !n.instances.empty()) origins_[static_cast<size_t>(n.mesh)] = glm::dvec3(0);
    }
    /// A node below each that shows a mesh around zero.
    void addMoved() {
        for (size_t n = 0; n < scene_.nodes.size(); ++n) {
            const int mesh = scene_.nodes[n].mesh;
            if (mesh < 0 || origins_[static_cast<size_t>(mesh)] == glm::dvec3(0)) continue;
            const glm::dvec3& to = origins_[static_cast<size_t>(mesh)];
            tinygltf::Node out;
            out.mesh = mesh;
            out.translation = {to.x, to.y, to.z};
            model_.nodes[n].mesh = -1;
            model_.nodes[n].children.push_back(static_cast<int>(model_.nodes.size()));
            model_.nodes.push_back(out);
        }
    }
    static std::vector<glm::vec3> positionsFrom(const Primitive& p, const glm::dvec3& origin) {
        if (origin == glm::dvec3(0)) return p.position;
        std::vector<glm::vec3> out;
        out.reserve(p.position.size());
        for (size_t i = 0; i < p.position.size(); ++i) out.emplace_back(p.at(i) - origin);
        return out;
    }

    void addMesh(const Mesh& m, const glm::dvec3& origin) {
        tinygltf::Mesh out;
        out.name = m.name;
        for (const Primitive& p : m.primitives) {
            tinygltf::Primitive q;
            q.mode = p.kind == PrimitiveKind::points  ? TINYGLTF_MODE_POINTS
                     : p.kind == PrimitiveKind::lines ? TINYGLTF_MODE_LINE
                                                      : TINYGLTF_MODE_TRIANGLES;
            q.material = p.material;
            q.attributes["POSITION"] = addFloats(positionsFrom(p, origin), TINYGLTF_TYPE_VEC3, true);
            if (!p.normal.empty()) q.attributes["NORMAL"] = addFloats(p.normal, TINYGLTF_TYPE_VEC3);
            if (!p.tangent.empty()) q.attributes["TANGENT"] = addFloats(p.tangent, TINYGLTF_TYPE_VEC4);
            if (!p.colour.empty()) q.attributes["COLOR_0"] = addFloats(p.colour, TINYGLTF_TYPE_VEC4);
            if (!p.radius.empty())
                q.attributes["_RADIUS"] =
                    addFloats(std::vector<glm::vec1>(p.radius.begin(), p.radius.end()), TINYGLTF_TYPE_SCALAR);
            for (size_t s = 0; s < p.uv.size(); ++s)
                if (!p.uv[s].empty())
                    q.attributes[fmt::format("TEXCOORD_{}", s)] = addFloats(p.uv[s], TINYGLTF_TYPE_VEC2);
            tinygltf::Accessor a;
            a.bufferView = addView(p.indices.data(), p.indices.size() * 4, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
            a.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
            a.count = p.indices.size();
            a.type = TINYGLTF_TYPE_SCALAR;
            model_.accessors.push_back(a);
            q.indices = static_cast<int>(model_.accessors.size()) - 1;
            out.primitives.push_back(q);
        }
        model_.meshes.push_back(out);
    }
    void addCamera(const SceneCamera& c) {
        tinygltf::Camera out;
        out.type = c.isOrthographic ? "orthographic" : "perspective";
        out.perspective.yfov = c.fovDegrees * 3.14159265358979323846 / 180;
        out.perspective.znear = c.nearPlane;
        out.orthographic.xmag = 0.5 * c.width;
        out.orthographic.ymag = 0.5 * c.height;
        out.orthographic.znear = c.nearPlane;
        out.orthographic.zfar = c.farPlane > c.nearPlane ? c.farPlane : 1e6;
        model_.cameras.push_back(out);
    }
    void addLight(const Light& l) {
        use("KHR_lights_punctual");
        tinygltf::Light out;
        out.type = l.kind == LightKind::directional ? "directional" : l.kind == LightKind::point ? "point" : "spot";
        out.color = doubles(l.colour);
        out.intensity = l.intensity;
        if (l.range > 0) out.range = l.range;
        if (l.kind == LightKind::spot) {
            out.spot.innerConeAngle = l.innerCone;
            out.spot.outerConeAngle = l.outerCone;
        }
        model_.lights.push_back(out);
    }

    /// Translation, rotation (x, y, z, w) and scale of an affine matrix; shear is lost.
    static void decompose(const glm::dmat4& m, glm::vec3& t, glm::vec4& r, glm::vec3& s) {
        t = glm::vec3(m[3]);
        glm::dmat3 a(m);
        glm::dvec3 scale(glm::length(a[0]), glm::length(a[1]), glm::length(a[2]));
        if (glm::determinant(a) < 0) scale.x = -scale.x;
        for (int c = 0; c < 3; ++c) a[c] /= scale[c] != 0 ? scale[c] : 1;
        // The largest of the four components first (Shepperd 1978).
        const std::array<double, 4> four{a[0][0] - a[1][1] - a[2][2], a[1][1] - a[0][0] - a[2][2],
                                         a[2][2] - a[0][0] - a[1][1], a[0][0] + a[1][1] + a[2][2]};
        const auto k = static_cast<size_t>(std::max_element(four.begin(), four.end()) - four.begin());
        const double big = 0.5 * std::sqrt(std::max(0.0, four.at(k) + 1)), f = 0.25 / big;
        const double x = (a[1][2] - a[2][1]) * f, y = (a[2][0] - a[0][2]) * f, z = (a[0][1] - a[1][0]) * f,
                     xy = (a[0][1] + a[1][0]) * f, xz = (a[0][2] + a[2][0]) * f, yz = (a[1][2] + a[2][1]) * f;
        r = k == 0   ? glm::vec4(big, xy, xz, x)
            : k == 1 ? glm::vec4(xy, big, yz, y)
            : k == 2 ? glm::vec4(xz, yz, big, z)
                     : glm::vec4(x, y, z, big);
        s = glm::vec3(scale);
    }

    void addNode(const Node& n) {
        tinygltf::Node out;
        out.name = n.name;
        out.mesh = n.mesh;
        out.camera = n.camera;
        if (n.local != glm::dmat4(1))
            for (int c = 0; c < 4; ++c)
                for (int r = 0; r < 4; ++r) out.matrix.push_back(n.local[c][r]);
        if (n.light >= 0) {
            Value::Object light;
            light["light"] = Value(n.light);
            out.extensions["KHR_lights_punctual"] = Value(light);
        }
        if (!n.store.empty()) {
            use("STIPPLE_store");
            Value::Object store;
            store["uri"] = Value(n.store);
            out.extensions["STIPPLE_store"] = Value(store);
        }
        if (!n.isVisible) {
            use("KHR_node_visibility");
            Value::Object visibility;
            visibility["visible"] = Value(false);
            out.extensions["KHR_node_visibility"] = Value(visibility);
        }
        if (!n.instances.empty()) addInstances(n, out);
        model_.nodes.push_back(out);
    }
    void addInstances(const Node& n, tinygltf::Node& out) {
        use("EXT_mesh_gpu_instancing");
        std::vector<glm::vec3> translation(n.instances.size()), scale(n.instances.size());
        std::vector<glm::vec4> rotation(n.instances.size());
        for (size_t i = 0; i < n.instances.size(); ++i)
            decompose(n.instances[i], translation[i], rotation[i], scale[i]);
        Value::Object attributes, extension;
        attributes["TRANSLATION"] = Value(addFloats(translation, TINYGLTF_TYPE_VEC3, false, 0));
        attributes["ROTATION"] = Value(addFloats(rotation, TINYGLTF_TYPE_VEC4, false, 0));
        attributes["SCALE"] = Value(addFloats(scale, TINYGLTF_TYPE_VEC3, false, 0));
        extension["attributes"] = Value(attributes);
        out.extensions["EXT_mesh_gpu_instancing"] = Value(extension);
    }

    const Scene& scene_;
    std::vector<glm::dvec3> origins_;  ///< of each mesh: what its vertices are counted from in the file
    tinygltf::Model model_;
};

}  // namespace

Result<void> writeGltf(const Scene& scene, const std::string& path) {
    const std::string extension = std::filesystem::path(path).extension().string();
    if (extension != ".glb" && extension != ".gltf")
        return fail(ErrorKind::usage, "scenes are written as .glb or .gltf", path);
    tinygltf::Model model = Writer(scene).take();
    if (extension == ".glb" && model.buffers[0].data.size() > 0xf0000000u)
        return fail(ErrorKind::output, "is larger than the 4 GiB that a .glb can hold", path, "write a .gltf instead");
    if (model.buffers[0].data.empty()) model.buffers.clear();
    STIPPLE_ASSIGN(OutputFile file, OutputFile::create(path));
    // Through memory: the library's own file writing does not notice a full disk.
    std::ostringstream text;
    tinygltf::TinyGLTF writer;
    writer.SetImageWriter(nullptr, nullptr);
    if (!writer.WriteGltfSceneToStream(&model, text, true, extension == ".glb"))
        return fail(ErrorKind::output, "cannot be written as glTF", path);
    const std::string bytes = std::move(text).str();
    STIPPLE_TRY(file.append(bytes.data(), bytes.size()));
    STIPPLE_TRY(file.flush());
    return file.commit();
}

}  // namespace stipple::scene
