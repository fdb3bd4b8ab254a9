// Draco data is distrusted like everything else of a file: libdraco takes memory for what its header promises, so the
// promise is held against the bytes that are there and against --memory before the library acts on it: once before the
// connectivity (triangles, vertices) and once before the attributes. Only what glTF allows gets that far: triangle
// meshes of bitstream 2.2, without metadata.
#include "engine/scene/gltf/draco.h"

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

constexpr const char* kName = "KHR_draco_mesh_compression";
constexpr const char* kHint = "is the file whole? Otherwise save it again, e.g. with gltf-transform copy";

/// What unpacking takes at most, measured with a mesh of a million triangles and three sets of seams (170 MB) and
/// rounded up by half: of a triangle, of a triangle for each set of seams, and of a component besides its value.
constexpr uint64_t kTriangleBytes = 96, kSeamBytes = 24, kComponentBytes = 12;
/// Triangles, or vertices, that one byte can stand for: in a flat grid, the smallest there is, 11 triangles.
constexpr uint64_t kMostOfByte = 1024;
constexpr int kMostComponents = 16;

/// What libdraco asks before it takes memory.
class Guard {
  public:
    Guard(Buffers& buffers, size_t bytes, std::string place, std::string path)
        : buffers_(buffers), bytes_(bytes), place_(std::move(place)), path_(std::move(path)) {}

    /// `seams`: attributes that have vertices of their own.
    bool allowsConnectivity(uint64_t triangles, uint64_t vertices, uint64_t seams) {
        if (std::max(triangles, vertices) > kMostOfByte * bytes_)
            return refuse(fmt::format("says that it has {} triangles and {} vertices, which {} bytes cannot be",
                                      triangles, vertices, bytes_));
        taken_ = triangles * (kTriangleBytes + seams * kSeamBytes);
        return fits();
    }

    bool allowsAttributes(const draco::PointCloud& cloud) {
        for (int i = 0; i < cloud.num_attributes(); ++i) {
            const auto components = static_cast<uint64_t>(cloud.attribute(i)->num_components());
            if (components > kMostComponents)
                return refuse(fmt::format("has an attribute of {} components", components));
            taken_ += cloud.num_points() * components *
                      (static_cast<uint64_t>(draco::DataTypeLength(cloud.attribute(i)->data_type())) + kComponentBytes);
        }
        return fits();
    }

    Result<void> answer = {};  ///< why not

  private:
    bool fits() {
        answer = buffers_.fits(taken_, place_ + " unpacked");
        return answer.has_value();
    }
    bool refuse(const std::string& what) {
        answer = fail(ErrorKind::input, "its Draco data " + what, path_ + ": " + place_, kHint);
        return false;
    }
    Buffers& buffers_;
    size_t bytes_;
    std::string place_, path_;
    uint64_t taken_ = 0;
};

/// libdraco's decoder, which asks a guard.
template <typename Decoder>
class Guarded final : public Decoder {
  public:
    explicit Guarded(Guard& guard) : guard_(guard) {}

  private:
    /// Called before the connectivity is decoded; looks ahead at its head (Draco bitstream 2.2, sections 5 and 6).
    bool InitializeDecoder() override {
        if (!Decoder::InitializeDecoder()) return false;
        draco::DecoderBuffer ahead(*this->buffer());
        uint32_t first = 0, second = 0;
        if (!draco::DecodeVarint(&first, &ahead) || !draco::DecodeVarint(&second, &ahead)) return false;
        if constexpr (std::is_same_v<Decoder, draco::MeshSequentialDecoder>)
            return guard_.allowsConnectivity(first, second, 0);
        uint8_t seams = 0;
        return ahead.Decode(&seams) && guard_.allowsConnectivity(second, first, seams);
    }
    bool DecodeAllAttributes() override {
        return guard_.allowsAttributes(*this->point_cloud()) && Decoder::DecodeAllAttributes();
    }

    Guard& guard_;
};

/// `place`: in the file at `path`.
Result<std::unique_ptr<draco::Mesh>> decode(std::span<const uint8_t> bytes, const std::string& place,
                                            const std::string& path, Buffers& buffers) {
    draco::DecoderBuffer data;
    data.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    draco::DecoderBuffer head(data);
    draco::DracoHeader header{};
    const auto refuse = [&](const std::string& what) {
        return fail(ErrorKind::input, what, path + ": " + place, kHint);
    };
    if (!draco::PointCloudDecoder::DecodeHeader(&head, &header).ok()) return refuse("its bytes are no Draco data");
    if (header.encoder_type != draco::TRIANGULAR_MESH) return refuse("its Draco data is no mesh of triangles");
    if (header.version_major != 2 || header.version_minor != 2)
        return refuse(
            fmt::format("its Draco data has version {}.{}, glTF has 2.2", header.version_major, header.version_minor));
    // glTF has no use for it, and a short text of it can ask for any memory.
    if ((header.flags & METADATA_FLAG_MASK) != 0) return refuse("its Draco data has metadata, which is not read");
    Guard guard(buffers, bytes.size(), place, path);
    auto mesh = std::make_unique<draco::Mesh>();
    const draco::DecoderOptions options;
    bool isDecoded = false;
    try {
        if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING)
            isDecoded = Guarded<draco::MeshEdgebreakerDecoder>(guard).Decode(options, &data, mesh.get()).ok();
        else if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING)
            isDecoded = Guarded<draco::MeshSequentialDecoder>(guard).Decode(options, &data, mesh.get()).ok();
    } catch (const std::length_error&) {  // (memory that is not there is said by who reads the file)
        isDecoded = false;
    }
    STIPPLE_TRY(guard.answer);
    if (!isDecoded) return refuse("its Draco data is damaged");
    if (mesh->num_faces() == 0 || mesh->num_points() == 0) return refuse("its Draco data is empty");
    return mesh;
}

double valueAt(const uint8_t* at, draco::DataType type) {
    const auto get = [&](auto v) {
        std::memcpy(&v, at, sizeof(v));
        return static_cast<double>(v);
    };
    switch (type) {
        case draco::DT_INT8:
            return get(int8_t{});
        case draco::DT_UINT8:
        case draco::DT_BOOL:
            return get(uint8_t{});
        case draco::DT_INT16:
            return get(int16_t{});
        case draco::DT_UINT16:
            return get(uint16_t{});
        case draco::DT_INT32:
            return get(int32_t{});
        case draco::DT_UINT32:
            return get(uint32_t{});
        case draco::DT_INT64:
            return get(int64_t{});
        case draco::DT_UINT64:
            return get(uint64_t{});
        case draco::DT_FLOAT32:
            return get(float{});
        default:
            return get(double{});
    }
}

/// The largest value of a type of Draco, and of glTF; 0: floats.
double largest(draco::DataType type) {
    if (type == draco::DT_FLOAT32 || type == draco::DT_FLOAT64) return 0;
    if (type == draco::DT_BOOL) return 1;
    const bool isSigned =
        type == draco::DT_INT8 || type == draco::DT_INT16 || type == draco::DT_INT32 || type == draco::DT_INT64;
    return std::exp2(8 * draco::DataTypeLength(type) - (isSigned ? 1 : 0)) - 1;
}
double largest(int componentType) {
    return componentType == 5120   ? 127
           : componentType == 5121 ? 255
           : componentType == 5122 ? 32767
           : componentType == 5123 ? 65535
           : componentType == 5125 ? 4294967295.0
                                   : 0;
}

/// False for what the type cannot hold.
bool put(uint8_t* to, int componentType, double value) {
    const auto whole = [&](auto as) {
        using T = decltype(as);
        const double rounded = std::round(value);
        if (!(rounded >= std::numeric_limits<T>::min() && rounded <= std::numeric_limits<T>::max())) return false;
        as = static_cast<T>(rounded);
        std::memcpy(to, &as, sizeof(as));
        return true;
    };
    switch (componentType) {
        case 5120:
            return whole(int8_t{});
        case 5121:
            return whole(uint8_t{});
        case 5122:
            return whole(int16_t{});
        case 5123:
            return whole(uint16_t{});
        case 5125:
            return whole(uint32_t{});
        default: {
            const auto real = static_cast<float>(value);
            std::memcpy(to, &real, sizeof(real));
            return true;
        }
    }
}

std::optional<size_t> indexOf(const json& value, double limit) {
    if (!value.is_number()) return {};
    const auto v = value.get<double>();
    return v >= 0 && v < limit && v == std::floor(v) ? std::optional(static_cast<size_t>(v)) : std::nullopt;
}

class Unpacker {
  public:
    Unpacker(json& root, const std::string& path, Buffers& buffers, Problems& problems)
        : root_(root), path_(path), buffers_(buffers), problems_(problems) {}

    Result<void> run() {
        if (!root_.contains("meshes")) return {};
        for (size_t m = 0; m < root_["meshes"].size(); ++m)
            for (size_t k = 0; k < root_["meshes"][m]["primitives"].size(); ++k) {
                json& primitive = root_["meshes"][m]["primitives"][k];
                if (extensionOf(primitive, kName).is_null() || hasPlainForm(primitive)) continue;
                here_ = fmt::format("/meshes/{}/primitives/{}", m, k);
                STIPPLE_TRY(unpack(primitive));
            }
        return {};
    }

  private:
    bool has(const json& index, const char* member) const {
        return root_["accessors"][index.get<size_t>()].contains(member);
    }
    /// An accessor that only replaces some elements begins with those that are compressed.
    bool isPlain(const json& index, bool isCompressed) const {
        return has(index, "bufferView") || (!isCompressed && has(index, "sparse"));
    }
    bool hasPlainForm(const json& primitive) const {
        const json& compressed = extensionOf(primitive, kName);
        for (const auto& [name, index] : primitive["attributes"].items()) {
            const bool isCompressed = compressed.contains("attributes") && compressed["attributes"].contains(name);
            if ((isCompressed || name == "POSITION") && !isPlain(index, isCompressed)) return false;
        }
        return !primitive.contains("indices") || has(primitive["indices"], "bufferView");
    }

    tl::unexpected<Error> refuse(const std::string& what) const {
        return fail(ErrorKind::input, what, path_ + ": " + here_, kHint);
    }

    Result<void> unpack(json& primitive) {
        const json compressed = extensionOf(primitive, kName);
        const auto views = static_cast<double>(arrayOf(root_, "bufferViews").size());
        const auto view = compressed.is_object() && compressed.contains("bufferView")
                              ? indexOf(compressed["bufferView"], views)
                              : std::nullopt;
        if (!view || !compressed.contains("attributes") || !compressed["attributes"].is_object())
            return refuse(fmt::format("{} names no buffer view or no attributes", kName));
        const int mode = primitive.value("mode", 4);
        if (mode != 4 && mode != 5)
            return refuse(fmt::format("has mode {}, but is Draco data, which only triangles can be", mode));
        STIPPLE_ASSIGN(const std::span<const uint8_t> bytes, buffers_.view(*view));
        STIPPLE_ASSIGN(const std::unique_ptr<draco::Mesh> mesh, decode(bytes, here_, path_, buffers_));
        std::vector<uint8_t> out;
        const json attributes = primitive["attributes"], &ids = compressed["attributes"];
        for (const auto& [name, index] : attributes.items()) {
            const bool isDrawn = name[0] != '_' && name.rfind("JOINTS_", 0) != 0 && name.rfind("WEIGHTS_", 0) != 0;
            // (An accessor of nothing stands for zeros, which is what some write for joints.)
            if (!ids.contains(name) && (!isDrawn || isPlain(index, false))) continue;
            const auto id = ids.contains(name) ? indexOf(ids[name], 4294967296.0) : std::nullopt;
            const draco::PointAttribute* of = id ? mesh->GetAttributeByUniqueId(static_cast<uint32_t>(*id)) : nullptr;
            if (!of) return refuse(fmt::format("its Draco data lacks the attribute that is to be its {}", name));
            STIPPLE_ASSIGN(primitive["attributes"][name], addAttribute(*mesh, *of, name, index.get<size_t>(), out));
        }
        STIPPLE_ASSIGN(primitive["indices"], addIndices(*mesh, primitive, out));
        primitive["mode"] = 4;  // of a strip, too, the triangles are compressed one by one
        root_["buffers"].push_back({{"byteLength", out.size()}});
        buffers_.add(std::move(out));
        primitive["extensions"].erase(kName);
        return {};
    }

    /// Room for another accessor behind `out`. (The buffer follows.)
    Result<size_t> addAccessor(json accessor, size_t elementBytes, std::vector<uint8_t>& out) {
        const size_t begin = (out.size() + 3) / 4 * 4, bytes = accessor["count"].get<size_t>() * elementBytes;
        STIPPLE_TRY(buffers_.claim(bytes, "the unpacked meshes"));
        out.resize(begin + bytes);
        accessor["bufferView"] = root_["bufferViews"].size();
        root_["bufferViews"].push_back(
            {{"buffer", root_["buffers"].size()}, {"byteOffset", begin}, {"byteLength", bytes}});
        root_["accessors"].push_back(std::move(accessor));
        return begin;
    }

    Result<size_t> addAttribute(const draco::Mesh& mesh, const draco::PointAttribute& from, const std::string& name,
                                size_t index, std::vector<uint8_t>& out) {
        json accessor = root_["accessors"][index];
        const auto type = accessor["type"].get<std::string>();
        const int componentType = accessor["componentType"].get<int>();
        const size_t points = mesh.num_points(), components = componentsOf(type), size = componentBytes(componentType);
        if (accessor["count"].get<size_t>() != points)
            sayHarmless(problems_, here_,
                        fmt::format("{} is to have {} elements, its Draco data has {}", name,
                                    accessor["count"].get<size_t>(), points));
        if (type.rfind("MAT", 0) == 0 || static_cast<size_t>(from.num_components()) < components)
            return refuse(
                fmt::format("{} is to be {}, its Draco data has {} components", name, type, from.num_components()));
        accessor["count"] = points;
        // Bounds are those of the numbers before they were compressed, which moves them.
        for (const char* other : {"min", "max", "byteOffset"}) accessor.erase(other);
        const bool isNormalised = accessor.value("normalized", false);
        STIPPLE_ASSIGN(const size_t begin, addAccessor(std::move(accessor), components * size, out));
        // Whole numbers that stand for 0 to 1 keep what they stand for; where only the accessor says so, they are
        // copied.
        const bool isFloat = largest(from.data_type()) == 0, isUnit = !isFloat && from.normalized();
        double factor = 1;
        if (isUnit && (isNormalised || largest(componentType) == 0)) factor /= largest(from.data_type());
        if (isNormalised && (isUnit || isFloat)) factor *= std::max(1.0, largest(componentType));
        const auto stride = static_cast<size_t>(from.byte_stride()),
                   width = static_cast<size_t>(draco::DataTypeLength(from.data_type()));
        const bool isWhole = from.buffer() != nullptr && from.byte_offset() == 0 && stride >= components * width &&
                             (from.is_mapping_identity() || from.indices_map_size() >= points);
        const size_t elements = isWhole ? from.buffer()->data_size() / stride : 0;
        for (size_t p = 0; p < points; ++p) {
            const draco::PointIndex point(static_cast<uint32_t>(p));
            const size_t at = isWhole ? from.mapped_index(point).value() : 0;
            for (size_t k = 0; k < components; ++k)
                if (at >= elements ||
                    !put(out.data() + begin + (p * components + k) * size, componentType,
                         factor * valueAt(from.buffer()->data() + at * stride + k * width, from.data_type())))
                    return refuse(
                        fmt::format("{} of vertex {} is not in its Draco data, or does not fit its type", name, p));
        }
        return root_["accessors"].size() - 1;
    }

    Result<size_t> addIndices(const draco::Mesh& mesh, const json& primitive, std::vector<uint8_t>& out) {
        const size_t count = size_t{mesh.num_faces()} * 3;
        if (primitive.contains("indices"))
            if (const json& said = root_["accessors"][primitive["indices"].get<size_t>()]["count"]; said != count)
                sayHarmless(problems_, here_,
                            fmt::format("is to have {} indices, its Draco data has {}", said.dump(), count));
        constexpr int kWords = 5125;
        STIPPLE_ASSIGN(const size_t begin,
                       addAccessor({{"componentType", kWords}, {"count", count}, {"type", "SCALAR"}}, 4, out));
        for (size_t i = 0; i < count; ++i) {
            const uint32_t point = mesh.face(draco::FaceIndex(static_cast<uint32_t>(i / 3)))[i % 3].value();
            std::memcpy(out.data() + begin + i * 4, &point, 4);
        }
        return root_["accessors"].size() - 1;
    }

    json& root_;
    const std::string& path_;
    Buffers& buffers_;
    Problems& problems_;
    std::string here_;
};

}  // namespace

Result<void> unpackDraco(Container& container, Buffers& buffers, Problems& problems) {
    return Unpacker(container.json, container.path, buffers, problems).run();
}

}  // namespace stipple::scene::gltf
