// The bytes of a .stipple file, and which field of them is which field in memory: each is named once, for reading and
// for writing. Little-endian.
//
//   Head | streams of payloads | pages of nodes | pages | description | mesh | Foot
//
// Sections are compressed with zstd. A page holds a PageHead and then all that the table says of 2^k nodes that follow
// each other, in arrays in the order of TablePart (tables.h): nodes come breadth first, payloads in the order of their
// nodes, streams in that of their payloads, groups of triangles in that of the payloads of triangles. The section of
// the pages is the directory: a TableHead, the names of kinds and of codecs, and of each page where it is and what
// stands before it. So a first image needs the head, the directory, the first page, and those that it looks at. The
// section of the mesh holds a MeshHead and then textures and tiles.
//
// Version 12: the records of the root begin with an overview (Hierarchy::overviewOf), and the parents' codes of its own
// ones are those of the overview's finest level.
//
// Versions 8 and 9 have one section for all nodes, one for counts per code, one for payloads (a PayloadHead and then
// its arrays), and that of the mesh holds the groups, too.
//
// Versions 6 and 7 (meshes whose coordinates have more than 30 bits) have one payload a node, which stands in the node
// itself, and no section of payloads: their kind follows from the description and from whether there are groups.
// Version 8 left the spacing of records 0.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
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
    Section nodes, counts, description, mesh;  // `nodes` is that of the pages, `counts` is of versions before 10
    // (Of versions 6 and 7 the hash follows here.)
    Section payloads;  // of versions 8 and 9
    uint32_t isGraph, reserved;
    uint64_t hash;  // of everything before
};
static_assert(sizeof(Head) == 16 + 24 + 16 + 24 + 128 + 32 + 8 + 8 && std::is_trivially_copyable_v<Head>);
inline constexpr size_t kOldHeadBytes = offsetof(Head, payloads) + sizeof(uint64_t);

struct Foot {
    uint64_t headHash, magic;
};

struct NodeOnDisk {
    std::array<double, 4> sphere;
    std::array<uint64_t, 3> cell;
    uint32_t parent, firstChild, normalCone;
    float normalConeCosine;
    uint8_t level, childMask, furtherPayloads, sourceCode;
    std::array<uint8_t, 4> reserved;
};
static_assert(sizeof(NodeOnDisk) == 32 + 24 + 16 + 8);

/// Of versions 6 and 7.
struct OldNodeOnDisk {
    std::array<double, 4> sphere;
    uint64_t chunkOffset, chunkHash, attributeHash;
    std::array<uint32_t, 3> cell;  // low bits; the parent's tells the rest
    uint32_t parent, firstChild, records, chunkBytes, attributeBytes, parentCodes, ownCodes, normalCone;
    float normalConeCosine;
    uint8_t level, childMask, errorCode;
    int8_t stepShift;
};
static_assert(sizeof(OldNodeOnDisk) == 32 + 24 + 12 + 32 + 4 + 4 + 4);  // the last for alignment

/// Of a kind or a codec, filled up with zeros.
using NameOnDisk = std::array<char, 24>;

struct PayloadOnDisk {
    uint32_t records, parentCodes, ownCodes;  // of codes: so many CodeCounts
    uint8_t kind, codec;                      // into the names
    uint8_t errorCode;
    int8_t stepShift;
    uint16_t streams;
    uint8_t spacingCode, maps;
};
static_assert(sizeof(PayloadOnDisk) == 20);

struct StreamOnDisk {
    uint64_t offset, hash;
    uint32_t bytes;
    uint16_t id, reserved;
};
static_assert(sizeof(StreamOnDisk) == 24);

/// (code, count) of one code that occurs in a payload.
struct CodeCount {
    uint32_t code, count;
};

/// How much of each array of the table stands before a page (all in memory; `steps`: of Hierarchy::greaterThan).
struct Places {
    uint64_t nodes, further, streams, steps, groups, runs, parents, groupTextures;
    uint64_t children;  // of the nodes before, and the root: the number of the page's first child
};
struct PageOnDisk {
    Section section;
    Places first;
};

struct TableHead {
    uint64_t kinds, codecs, pages;
    uint32_t log2Nodes, flags;  // of a page; kTable...
    Places total;
};
static_assert(sizeof(PageOnDisk) == 104 && sizeof(TableHead) == 104);
inline constexpr uint32_t kTableMixed = 1;          // Hierarchy::isMixed
inline constexpr uint32_t kTablePatches = 2;        // some nodes' first payload is one of patches
inline constexpr uint32_t kTableOneSourceCode = 4;  // Hierarchy::hasOneSourceCode
inline constexpr uint32_t kTableFlags = 7;

/// Of a page: how many streams (all, as they are in the file) and pairs of CodeCount it has.
struct PageHead {
    uint64_t streams, pairs;
};

/// Of the mesh section: the counts, then groups, runs and parents.
struct MeshHead {
    uint64_t groups, runs, parents, groupTextures, textures, tiles;
};

/// Of the section of payloads: the counts, then names of kinds and of codecs, payloads and streams.
struct PayloadHead {
    uint64_t kinds, codecs, payloads, streams;
};

// ---- which field is which: move(in memory, on disk), with kToDisk or kFromDisk

inline constexpr auto kToDisk = [](const auto& memory, auto& disk) {
    disk = static_cast<std::remove_cvref_t<decltype(disk)>>(memory);
};
inline constexpr auto kFromDisk = [](auto& memory, const auto& disk) {
    memory = static_cast<std::remove_cvref_t<decltype(memory)>>(disk);
};

template <typename Hierarchy, typename OnDisk, typename Move>
void moveHead(Hierarchy& h, OnDisk& d, const Move& move) {
    for (int a = 0; a < 3; ++a) move(h.origin[a], d.origin[static_cast<size_t>(a)]);
    move(h.unit, d.unit);
    move(h.rootLog2, d.rootLog2);
    move(h.errors.smallest, d.smallestError);
    move(h.isGraph, d.isGraph);
}

/// What nodes of all versions have.
template <typename Node, typename OnDisk, typename Move>
void moveNode(Node& n, OnDisk& d, const Move& move) {
    for (int a = 0; a < 3; ++a) move(n.centre[a], d.sphere[static_cast<size_t>(a)]);
    move(n.radius, d.sphere[3]);
    for (size_t a = 0; a < 3; ++a) move(n.cell[a], d.cell[a]);
    move(n.parent, d.parent);
    move(n.firstChild, d.firstChild);
    move(n.normalCone, d.normalCone);
    move(n.normalConeCosine, d.normalConeCosine);
    move(n.level, d.level);
    move(n.childMask, d.childMask);
    if constexpr (!std::is_same_v<std::remove_const_t<OnDisk>, OldNodeOnDisk>) {
        move(n.furtherPayloads, d.furtherPayloads);
        move(n.sourceCode, d.sourceCode);
    }
}

/// What payloads of all versions have (in old ones `d` is the node).
template <typename Payload, typename OnDisk, typename Move>
void movePayload(Payload& p, OnDisk& d, const Move& move) {
    move(p.records, d.records);
    move(p.errorCode, d.errorCode);
    move(p.stepShift, d.stepShift);
    if constexpr (std::is_same_v<std::remove_const_t<OnDisk>, OldNodeOnDisk>) {
        move(p.chunkOffset, d.chunkOffset);
        move(p.chunkHash, d.chunkHash);
        move(p.chunkBytes, d.chunkBytes);
        move(p.attributeHash, d.attributeHash);
        move(p.attributeBytes, d.attributeBytes);
    } else {
        move(p.spacingCode, d.spacingCode);
        move(p.maps, d.maps);
    }
}

template <typename Stream, typename OnDisk, typename Move>
void moveStream(Stream& s, OnDisk& d, const Move& move) {
    move(s.offset, d.offset);
    move(s.hash, d.hash);
    move(s.bytes, d.bytes);
    move(s.id, d.id);
}

}  // namespace stipple::lod::layout
