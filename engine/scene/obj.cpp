// Wavefront OBJ with MTL materials, by tinyobjloader; only what it gives is checked, since it believes its input.
// Numbers are doubles: map coordinates have more digits than fp32.
#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <sstream>
#include <streambuf>
#include <type_traits>

#include "engine/base/file.h"
#include "engine/scene/obj_polygons.h"
#include "engine/scene/scene_bytes.h"

namespace stipple::scene {
namespace {

/// Bytes as a stream, in blocks; of a file no more than what it held when it was opened.
class FileStream final : public std::streambuf {
  public:
    explicit FileStream(const ByteSource& file) : file_(file), block_(size_t{1} << 20) {}
    /// What went wrong: a stream only ends.
    const Result<void>& result() const { return result_; }

  protected:
    int_type underflow() override {
        const size_t count = static_cast<size_t>(std::min<uint64_t>(block_.size(), file_.sizeBytes() - at_));
        if (count == 0) return traits_type::eof();
        if (const auto read = file_.readAt(at_, block_.data(), count); !read) {
            result_ = read;
            return traits_type::eof();
        }
        at_ += count;
        setg(block_.data(), block_.data(), block_.data() + count);
        return traits_type::to_int_type(block_[0]);
    }

  private:
    const ByteSource& file_;
    std::vector<char> block_;
    uint64_t at_ = 0;
    Result<void> result_;
};

/// Materials of MTL files beside the OBJ file. (The library's own reader opens whatever it is told to.)
class MaterialFiles final : public tinyobj::MaterialReader {
  public:
    MaterialFiles(std::string folder, const ReadSettings& settings, const Resolve& resolve,
                  std::vector<std::string>& notes)
        : folder_(std::move(folder)), settings_(settings), resolve_(resolve), notes_(notes) {}

    bool operator()(const std::string& name, std::vector<tinyobj::material_t>* materials,
                    std::map<std::string, int>* byName, std::string* warning, std::string* error) override {
        const auto leaveOut = [&](const std::string& why) {
            notes_.push_back(fmt::format("materials are left out: {}", why));
            return true;
        };
        const auto bytes = readNamed(resolve_, folder_, withSlashes(name), settings_);
        if (!bytes) return leaveOut(bytes.error().line());
        const std::string text(bytes->begin(), bytes->end());
        uint64_t count = 1;
        for (size_t at = text.find("newmtl"); at != std::string::npos; at = text.find("newmtl", at + 6)) ++count;
        constexpr uint64_t kTimes = 3;  // growing arrays, and ours
        if (count * sizeof(tinyobj::material_t) * kTimes > settings_.memoryBytes)
            return leaveOut(fmt::format("{}: {} of them do not fit --memory", name, count));
        std::istringstream in(text);
        tinyobj::LoadMtl(byName, materials, &in, warning, error);
        return true;
    }

  private:
    std::string folder_;
    const ReadSettings& settings_;
    const Resolve& resolve_;
    std::vector<std::string>& notes_;
};

/// An image beside the file; missing ones are noted and count as white.
int addImage(const std::string& folder, std::string name, const ReadSettings& settings, const Resolve& resolve,
             Scene& scene, std::map<std::string, int>& known) {
    if (name.empty()) return -1;
    name = withSlashes(name);
    if (const auto found = known.find(name); found != known.end()) return found->second;
    auto bytes = readNamed(resolve, folder, name, settings);
    if (!bytes || bytes->empty()) {
        scene.notes.push_back(
            fmt::format("texture '{}' is left out: {}", name, bytes ? "is empty" : bytes.error().line()));
        return known[name] = -1;
    }
    scene.images.push_back({name, std::move(*bytes)});
    scene.textures.push_back({static_cast<int>(scene.images.size()) - 1, Wrap::repeat, Wrap::repeat});
    return known[name] = static_cast<int>(scene.textures.size()) - 1;
}

static_assert(std::is_same_v<tinyobj::real_t, double>);

/// OBJ colours are sRGB by custom; materials here are linear.
float linear(double srgb) {
    const auto s = static_cast<float>(srgb);
    return s <= 0.04045f ? s / 12.92f : std::pow((s + 0.055f) / 1.055f, 2.4f);
}

Material materialOf(const tinyobj::material_t& m, int texture) {
    Material out;
    out.name = m.name;
    for (int c = 0; c < 3; ++c) {
        out.baseColour[c] = texture >= 0 ? 1.0f : linear(std::isfinite(m.diffuse[c]) ? m.diffuse[c] : 1.0);
        out.emissive[c] = linear(std::isfinite(m.emission[c]) ? m.emission[c] : 0.0);
    }
    out.metallic = 0;
    out.roughness = 1;
    out.baseColourTexture.texture = texture;
    // v grows upwards in OBJ and downwards in glTF and here.
    out.baseColourTexture.transform = glm::mat3(1, 0, 0, 0, -1, 0, 0, 1, 1);
    if (!m.alpha_texname.empty() || m.dissolve < 1) out.alphaMode = AlphaMode::mask;
    out.baseColour.a = std::isfinite(m.dissolve) ? static_cast<float>(m.dissolve) : 1.0f;
    return out;
}

}  // namespace

namespace {

/// What the library makes of a file.
struct Parsed {
    tinyobj::attrib_t attributes;
    std::vector<tinyobj::shape_t> shapes;
    std::vector<tinyobj::material_t> materials;
    std::string warning;
};

/// What the library says, in our words: of which line it speaks.
std::string plainReason(const std::string& error) {
    const size_t at = error.find("line ");
    const size_t digits = at == std::string::npos ? at : error.find_first_of("0123456789", at);
    if (digits == std::string::npos) return "is not a readable OBJ";
    const size_t end = error.find_first_not_of("0123456789", digits);
    return fmt::format("is not a readable OBJ: line {} is not what OBJ expects", error.substr(digits, end - digits));
}

Result<Parsed> parse(const ByteSource& file, const std::string& folder, const ReadSettings& settings,
                     const Resolve& resolve, std::vector<std::string>& notes) {
    const std::string& path = file.path();
    FileStream buffer(file);
    SplitFaces split(buffer);
    STIPPLE_ASSIGN(const bool isLarge, hasLargeFaces(file));
    std::istream in(isLarge ? static_cast<std::streambuf*>(&split) : &buffer);
    MaterialFiles materials(folder, settings, resolve, notes);
    Parsed out;
    std::string error;
    try {
        const bool isRead =
            tinyobj::LoadObj(&out.attributes, &out.shapes, &out.materials, &out.warning, &error, &in, &materials);
        STIPPLE_TRY(buffer.result());
        if (isRead) return out;
    } catch (const std::bad_alloc&) {
        return fail(ErrorKind::budget, "does not fit in memory", path, "close other programs, or give PLY");
    } catch (const std::exception&) {
        error = "a line is not what OBJ expects";
    }
    return fail(ErrorKind::input, plainReason(error), path, "is it a whole OBJ file?");
}

}  // namespace

Result<Scene> readObj(const std::string& path, const ReadSettings& settings) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    return readObj(file, settings, {});
}

Result<Scene> readObj(const ByteSource& file, const ReadSettings& settings, const Resolve& resolve) {
    const std::string& path = file.path();
    Scene scene;
    scene.path = path;
    const std::string folder = std::filesystem::path(path).parent_path().string();
    STIPPLE_ASSIGN(const Parsed parsed, parse(file, folder, settings, resolve, scene.notes));
    std::map<std::string, int> images;
    for (const tinyobj::material_t& m : parsed.materials)
        scene.materials.push_back(materialOf(m, addImage(folder, m.diffuse_texname, settings, resolve, scene, images)));
    const tinyobj::attrib_t& a = parsed.attributes;
    const auto positions = static_cast<int>(a.vertices.size() / 3), normals = static_cast<int>(a.normals.size() / 3),
               uvs = static_cast<int>(a.texcoords.size() / 2);
    constexpr double kLargest = std::numeric_limits<float>::max();
    uint64_t dropped = 0;
    Mesh mesh;
    for (const tinyobj::shape_t& shape : parsed.shapes) {
        std::map<int, Primitive> byMaterial;
        for (size_t f = 0; f * 3 + 3 <= shape.mesh.indices.size(); ++f) {
            bool good = f >= shape.mesh.num_face_vertices.size() || shape.mesh.num_face_vertices[f] == 3;
            for (size_t k = 0; k < 3; ++k) {
                const int v = shape.mesh.indices[f * 3 + k].vertex_index;
                good = good && v >= 0 && v < positions;
                for (size_t c = 0; good && c < 3; ++c)
                    good = std::abs(a.vertices[3 * static_cast<size_t>(v) + c]) <= kLargest;
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
                const glm::dvec3 place(a.vertices[3 * v], a.vertices[3 * v + 1], a.vertices[3 * v + 2]);
                p.position.emplace_back(place);
                p.rest.emplace_back(place - glm::dvec3(p.position.back()));
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
    if (!parsed.warning.empty()) scene.notes.push_back(parsed.warning.substr(0, parsed.warning.find('\n')));
    if (mesh.primitives.empty()) return fail(ErrorKind::input, "holds no faces", path);
    scene.meshes.push_back(std::move(mesh));
    Node node;
    node.mesh = 0;
    scene.nodes.push_back(node);
    return scene;
}

}  // namespace stipple::scene
