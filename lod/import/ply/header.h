// What the header of a PLY file says.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/byte_source.h"

namespace stipple::lod {

enum class PlyType : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::array<uint8_t, 8> kPlyTypeBytes{1, 1, 2, 2, 4, 4, 4, 8};
enum class PlyRole : int8_t { none = -1, x, y, z, nx, ny, nz, red, green, blue, radius, roughness, metallic };
constexpr size_t kPlyRoles = 12;
constexpr size_t kMostAttributes = 64;

struct PlyProperty {
    std::string name;
    PlyType type = PlyType::f32, countType = PlyType::u8;
    bool isList = false;
    PlyRole role = PlyRole::none;
    int slot = -1;  ///< of the values that a row gives: by role, then the attributes asked for; -1: not wanted
};
struct PlyElement {
    std::string name;
    uint64_t count = 0;
    std::vector<PlyProperty> properties;
    bool hasLists() const {
        return std::any_of(properties.begin(), properties.end(), [](const PlyProperty& p) { return p.isList; });
    }
    size_t rowBytes() const {
        size_t sum = 0;
        for (const PlyProperty& p : properties) sum += kPlyTypeBytes.at(static_cast<size_t>(p.type));
        return sum;
    }
};
enum class PlyEncoding { ascii, little, big };

struct PlyHeader {
    PlyEncoding encoding = PlyEncoding::ascii;
    std::vector<PlyElement> elements;
    uint64_t bytes = 0;
    uint32_t unknownLines = 0;  ///< before the first element; passed over
};

Result<PlyHeader> parsePlyHeader(const ByteSource& file);
/// Is the list one of corners (faces, strips)?
inline bool isCornerList(const PlyProperty& p) {
    return p.isList && (p.name == "vertex_indices" || p.name == "vertex_index");
}

}  // namespace stipple::lod
