// The bytes of a .stipple file: what the reader copies as it is. Little-endian.
//
//   Head | chunks and their attribute streams | nodes | counts | description | mesh | Foot
//
// Sections are compressed with zstd; those of the mesh hold a MeshHead and then its arrays in the order of its fields.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>

namespace stipple::lod::layout {

static_assert(std::endian::native == std::endian::little, "the store is little-endian and copied as it is");

inline constexpr uint64_t kMagic = 0x31454c5050495453ull;      // "STIPPLE1"
inline constexpr uint64_t kFootMagic = 0x444e45454c505053ull;  // "SPPLEEND"

struct Section {
    uint64_t offset, bytes, rawBytes, hash;
};

struct Head {
    uint64_t magic;
    uint32_t version, rootLog2;
    std::array<double, 3> origin;
    double unit, smallestError;
    uint64_t nodeCount, fileBytes, contentHash;
    Section nodes, counts, description, mesh;
    uint64_t hash;  // of everything before
};
static_assert(sizeof(Head) == 16 + 24 + 16 + 24 + 128 + 8 && std::is_trivially_copyable_v<Head>);

struct Foot {
    uint64_t headHash, magic;
};

struct NodeOnDisk {
    std::array<double, 4> sphere;
    uint64_t chunkOffset, chunkHash, attributeHash;
    std::array<uint32_t, 3> cell;  // low bits: see readNodes
    uint32_t parent, firstChild, records, chunkBytes, attributeBytes, parentCodes, ownCodes, normalCone;
    float normalConeCosine;
    uint8_t level, childMask, errorCode;
    int8_t stepShift;
};
static_assert(sizeof(NodeOnDisk) == 32 + 24 + 12 + 32 + 4 + 4 + 4);  // the last for alignment

/// (code, count) of one code that occurs in a node.
struct CodeCount {
    uint32_t code, count;
};

/// Of the mesh section: the counts, then groups, runs and parents.
struct MeshHead {
    uint64_t groups, runs, parents, groupTextures, textures, tiles;
};

}  // namespace stipple::lod::layout
