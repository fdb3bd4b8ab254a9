// Point grids: out of a file as rows of a PLY file, and into one from rows.
#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointCount.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>

#include "lod/import/vdb/program/grids.h"
#include "lod/import/vdb/program/ply_file.h"
#include "shaders/shared/record.h"

namespace stipple::vdb {
namespace {
using openvdb::Vec3d;
using openvdb::Vec3f;
using openvdb::points::AttributeArray;
using openvdb::points::PointDataGrid;
using Leaf = openvdb::points::PointDataTree::LeafNodeType;

/// What an attribute of points becomes.
enum class Use { colour, normal, radius, diameter, value, none };

struct Column {
    std::string attribute, type;  ///< of OpenVDB
    Use use = Use::none;
};

std::string lower(std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

Use useOf(const std::string& name, const std::string& type) {
    const std::string n = lower(name);
    if (type == "vec3s" || type == "vec3d") {
        if (n == "cd" || n == "color" || n == "colour" || n == "rgb") return Use::colour;
        return n == "n" || n == "normal" || n == "normals" ? Use::normal : Use::none;
    }
    if (type == "float" || type == "double") {
        if (n == "pscale" || n == "radius") return Use::radius;
        if (n == "width") return Use::diameter;
        return Use::value;
    }
    return type == "int16" || type == "int32" || type == "int64" || type == "bool" || type == "half" ||
                   type == "int8" || type == "uint8"
               ? Use::value
               : Use::none;
}

/// The name of an attribute as one of PLY that means nothing else there.
std::string plyName(std::string name) {
    static const std::vector<std::string> kTaken{"x",     "y",    "z",         "nx",       "ny",     "nz",   "red",
                                                 "green", "blue", "roughness", "metallic", "radius", "alpha"};
    for (char& c : name)
        if (std::isspace(static_cast<unsigned char>(c)) || static_cast<unsigned char>(c) < 33) c = '_';
    return std::find(kTaken.begin(), kTaken.end(), lower(name)) == kTaken.end() ? name : name + "_";
}

std::vector<Column> columnsOf(const PointDataGrid& grid) {
    std::vector<Column> out;
    const auto leaf = grid.tree().cbeginLeaf();
    if (!leaf) return out;
    const auto& descriptor = leaf->attributeSet().descriptor();
    for (const auto& [name, at] : descriptor.map()) {
        if (name == "P" || leaf->constAttributeArray(at).stride() != 1 ||
            openvdb::points::isGroup(leaf->constAttributeArray(at)))
            continue;
        const std::string type = descriptor.valueType(at);
        out.push_back({name, type, useOf(name, type)});
    }
    return out;
}

/// Columns that every grid has, in order of their names; one of a use that only one column can have.
std::vector<Column> commonColumns(const std::vector<PointDataGrid::Ptr>& grids, std::vector<std::string>& leftOut) {
    std::vector<Column> common;
    for (const PointDataGrid::Ptr& grid : grids) {
        const std::vector<Column> own = columnsOf(*grid);
        const auto has = [](const std::vector<Column>& all, const Column& c) {
            return std::any_of(all.begin(), all.end(),
                               [&](const Column& o) { return o.attribute == c.attribute && o.type == c.type; });
        };
        if (grid == grids.front()) common = own;
        for (const Column& c : own)
            if (!has(common, c)) leftOut.push_back(c.attribute);
        std::erase_if(common, [&](const Column& c) {
            if (has(own, c)) return false;
            leftOut.push_back(c.attribute);
            return true;
        });
    }
    std::vector<Column> kept;
    for (const Column& c : common) {
        const bool isTaken = c.use != Use::value && std::any_of(kept.begin(), kept.end(), [&](const Column& k) {
                                 const bool areRadii = (k.use == Use::radius || k.use == Use::diameter) &&
                                                       (c.use == Use::radius || c.use == Use::diameter);
                                 return k.use == c.use || areRadii;
                             });
        if (c.use == Use::none || isTaken)
            leftOut.push_back(c.attribute);
        else
            kept.push_back(c);
    }
    return kept;
}

/// Colours of point grids are linear, as in the programs that write them.
uint8_t byteOf(double linear) {
    const double srgb = shared::srgbFromLinear(static_cast<float>(std::clamp(linear, 0.0, 1.0)));
    return static_cast<uint8_t>(std::lround(srgb * 255));
}

/// Writes the value of a point of a leaf to a row.
using Writer = std::function<void(openvdb::Index, PlyFile&)>;

template <typename T>
std::shared_ptr<openvdb::points::AttributeHandle<T>> handleOf(const AttributeArray& array) {
    return std::make_shared<openvdb::points::AttributeHandle<T>>(array);
}

template <typename V>
Writer vectorWriter(const AttributeArray& array, Use use) {
    return [handle = handleOf<V>(array), use](openvdb::Index i, PlyFile& ply) {
        const V v = handle->get(i);
        for (int a = 0; a < 3; ++a) {
            if (use == Use::colour) ply.put(byteOf(static_cast<double>(v[a])));
            if (use == Use::normal) ply.put(static_cast<float>(v[a]));
        }
    };
}

template <typename T, typename As>
Writer scalarWriter(const AttributeArray& array, Use use) {
    return [handle = handleOf<T>(array), use](openvdb::Index i, PlyFile& ply) {
        const auto v = static_cast<As>(handle->get(i));
        if (use == Use::radius) ply.put(static_cast<float>(v));
        if (use == Use::diameter) ply.put(static_cast<float>(v) / 2);
        if (use == Use::value) ply.put(v);
    };
}

Writer writerOf(const Leaf& leaf, const Column& c) {
    const AttributeArray& array = leaf.constAttributeArray(c.attribute);
    if (c.type == "vec3s") return vectorWriter<Vec3f>(array, c.use);
    if (c.type == "vec3d") return vectorWriter<Vec3d>(array, c.use);
    if (c.type == "float") return scalarWriter<float, float>(array, c.use);
    if (c.type == "double") return scalarWriter<double, double>(array, c.use);
    if (c.type == "half") return scalarWriter<openvdb::math::half, float>(array, c.use);
    if (c.type == "int8") return scalarWriter<int8_t, int8_t>(array, c.use);
    if (c.type == "uint8") return scalarWriter<uint8_t, uint8_t>(array, c.use);
    if (c.type == "int16") return scalarWriter<int16_t, int16_t>(array, c.use);
    if (c.type == "int32") return scalarWriter<int32_t, int32_t>(array, c.use);
    if (c.type == "bool") return scalarWriter<bool, uint8_t>(array, c.use);
    return scalarWriter<int64_t, double>(array, c.use);
}

std::vector<std::pair<std::string, std::string>> propertiesOf(const std::vector<Column>& columns) {
    static const std::map<std::string, std::string> kTypes{{"float", "float"}, {"half", "float"},  {"double", "double"},
                                                           {"int8", "char"},   {"uint8", "uchar"}, {"int16", "short"},
                                                           {"int32", "int"},   {"bool", "uchar"},  {"int64", "double"}};
    std::vector<std::pair<std::string, std::string>> out{{"double", "x"}, {"double", "y"}, {"double", "z"}};
    for (const Column& c : columns) {
        if (c.use == Use::colour) out.insert(out.end(), {{"uchar", "red"}, {"uchar", "green"}, {"uchar", "blue"}});
        if (c.use == Use::normal) out.insert(out.end(), {{"float", "nx"}, {"float", "ny"}, {"float", "nz"}});
        if (c.use == Use::radius || c.use == Use::diameter) out.emplace_back("float", "radius");
        if (c.use == Use::value) out.emplace_back(kTypes.at(c.type), plyName(c.attribute));
    }
    return out;
}

}  // namespace

Result<nlohmann::json> pointGridsToPoints(const Request& request) {
    STIPPLE_ASSIGN(const std::vector<openvdb::GridBase::Ptr> read, readPointGrids(request));
    std::vector<PointDataGrid::Ptr> grids;
    for (const auto& grid : read) grids.push_back(openvdb::gridPtrCast<PointDataGrid>(grid));
    std::vector<std::string> leftOut;
    const std::vector<Column> columns = commonColumns(grids, leftOut);
    PlyFile ply(request.columns);
    nlohmann::json answer = {{"grids", nlohmann::json::array()}, {"left_out", leftOut}};
    uint64_t points = 0;
    for (const PointDataGrid::Ptr& grid : grids) {
        const uint64_t before = points;
        for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
            const auto place = handleOf<Vec3f>(leaf->constAttributeArray("P"));
            std::vector<Writer> writers;
            for (const Column& c : columns) writers.push_back(writerOf(*leaf, c));
            for (auto i = leaf->beginIndexAll(); i; ++i, ++points) {
                const Vec3d voxel = i.getCoord().asVec3d() + Vec3d(place->get(*i));
                const Vec3d world = grid->transform().indexToWorld(voxel);
                for (int a = 0; a < 3; ++a) ply.put(world[a]);
                for (const Writer& write : writers) write(*i, ply);
            }
        }
        answer["grids"].push_back({{"grid", grid->getName()}, {"points", points - before}});
    }
    STIPPLE_TRY(ply.finish(points, propertiesOf(columns), 0));
    return answer;
}

namespace {

/// A column of rows as OpenVDB asks for it.
template <typename T>
struct Values {
    using PosType = T;
    using value_type = T;
    const char* rows;
    size_t count, stride;
    size_t size() const { return count; }
    void get(T& value, size_t n) const { std::memcpy(&value, rows + n * stride, sizeof(T)); }
    void get(T& value, size_t n, openvdb::Index) const { get(value, n); }
    void getPos(size_t n, T& value) const { get(value, n); }
};

template <typename T>
void addAttribute(PointDataGrid& grid, const openvdb::tools::PointIndexGrid& index, const std::string& name,
                  const Values<T>& values) {
    using namespace openvdb::points;
    appendAttribute(grid.tree(), name, TypedAttributeArray<T>::attributeType());
    populateAttribute(grid.tree(), index.tree(), name, values);
}

}  // namespace

Result<nlohmann::json> pointsToPointGrid(const Request& request, const nlohmann::json& layout) {
    const size_t count = layout.at("rows"), stride = layout.at("row_bytes");
    std::vector<char> rows(count * stride);
    if (!std::ifstream(request.columns, std::ios::binary).read(rows.data(), static_cast<std::streamsize>(rows.size())))
        return fail(ErrorKind::output, "the points cannot be read back", request.columns);
    const Values<Vec3d> places{rows.data(), count, stride};
    Vec3d least(1e300);
    for (size_t i = 0; i < count; ++i) {
        Vec3d p;
        places.get(p, i);
        least = openvdb::math::minComponent(least, p);
    }
    // One voxel for some eight points of a surface: places are kept to 2^-24 of it.
    const double voxel = request.voxel;
    auto transform = openvdb::math::Transform::createLinearTransform(voxel);
    for (int a = 0; a < 3; ++a) least[a] = std::floor(least[a] / voxel) * voxel;
    transform->postTranslate(least);
    const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(places, *transform);
    const auto grid =
        openvdb::points::createPointDataGrid<openvdb::points::NullCodec, PointDataGrid>(*index, places, *transform);
    grid->setName("points");
    for (const auto& c : layout.at("columns")) {
        const std::string name = c.at("name"), type = c.at("type");
        const char* at = rows.data() + c.at("offset").get<size_t>();
        if (type == "vec3s") addAttribute(*grid, *index, name, Values<Vec3f>{at, count, stride});
        if (type == "float") addAttribute(*grid, *index, name, Values<float>{at, count, stride});
        if (type == "double") addAttribute(*grid, *index, name, Values<double>{at, count, stride});
    }
    openvdb::io::File file(request.path);
    file.write({grid});
    file.close();
    return nlohmann::json{{"points", count}, {"voxel", voxel}};
}

}  // namespace stipple::vdb
