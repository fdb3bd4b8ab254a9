// What a node holds of one kind of primitive. A node has up to four payloads, e.g. patches and the points that no patch
// fits; each has its own errors, its own codec and its own streams, which are found by their ids.
#pragma once

#include <cstddef>
#include <cstdint>

namespace stipple::lod {

#define STIPPLE_KIND(name) name,
/// Kinds of primitives; what is known of each stands in the table of kinds.h. Files name them: the numbers are those of
/// this program.
enum class Kind : uint8_t {
#include "lod/primitives/kinds.inl"
};
/// How records are coded: each kind has a codec of its own, and a source may bring others, which come after them. What
/// is known of each stands in the table of codecs.h, and files name them, too.
enum class Codec : uint8_t {
#include "lod/primitives/kinds.inl"
};
#undef STIPPLE_KIND
#define STIPPLE_KIND(name) +1
inline constexpr size_t kKinds = 0
#include "lod/primitives/kinds.inl"
    ;
#undef STIPPLE_KIND
inline constexpr size_t kCodecs = kKinds;

inline constexpr uint32_t kMostPayloads = 4;

/// What a stream of a payload holds. Ids that a reader does not know are none of its business.
enum class StreamId : uint16_t {
    records = 1,        ///< what the codec decodes
    attributes = 2,     ///< values of every record (lod/store/attributes.h)
    surfelWeights = 4,  ///< a byte of every record (lod/store/surfel_weights.h)
    // Kept for what is to come:
    normals = 3,
    material = 5,
    spacingCode = 6,  ///< of each record, should they ever need one each; else Payload::spacingCode
};

/// Bytes of the file.
struct Stream {
    uint64_t offset = 0, hash = 0;
    uint32_t bytes = 0;
    StreamId id = StreamId::records;
};

/// Records of a node with a code greater than c, for every c: a step function over a short range of codes.
struct CodeCounts {
    uint32_t first = 0;      ///< into Hierarchy::greaterThan
    uint8_t lo = 0, hi = 0;  ///< codes below lo: all records; from hi on: none
};

struct Payload {
    uint32_t records = 0;
    uint32_t chunkBytes = 0;  ///< of the stream of records, compressed
    uint64_t chunkOffset = 0, chunkHash = 0;
    uint64_t attributeHash = 0;
    uint32_t attributeBytes = 0;  ///< of the stream of attributes, which follows that of records
    CodeCounts parentCounts, ownCounts;
    uint32_t firstStream = 0, streams = 0;  ///< further streams, into Hierarchy::streams
    uint32_t group = 0;                     ///< of triangles: into Hierarchy::groups
    Kind kind = Kind::points;
    Codec codec = Codec::points;
    uint8_t errorCode = 0;    ///< largest own error among the records (but those of an overview)
    int8_t stepShift = 0;     ///< position step of the records: 2^stepShift lattice units
    uint8_t spacingCode = 0;  ///< of points: how far records lie apart (record_spacing.h); 0: not known
    uint8_t maps = 0;         ///< of patches: what their maps are at most (patch_map.h); 0: there are none
};

/// `kind` as this program codes it.
inline void setKind(Payload& p, Kind kind) {
    p.kind = kind;
    p.codec = static_cast<Codec>(kind);
}

}  // namespace stipple::lod
