#include "lod/store/chunk.h"

#include <fmt/format.h>
#include <meshoptimizer.h>
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

#include "lod/store/check.h"
#include "lod/store/vertex_encoder.h"
#include "lod/store/zstd_memory.h"

namespace stipple::lod {
namespace {

constexpr int kZstdLevel = 1;  // 3 saves 1 % of the bytes and takes twice the time on scans
// Records of points are 14 KB a chunk and have few repetitions: with a table of 512 places for them, where level 1
// empties one of 32,768 each time, zstd takes 0.7 of the time. (Of curves and meshes it would lose 5 % of the bytes.)
constexpr int kLog2FewPlaces = 9, kShortestMatch = 5;

constexpr uint32_t kNotFinite = 0x7f800000u;  // the exponent of infinities and NaN

struct ChunkHead {
    uint32_t recordBytes, lowBitBytes;
};

/// `log2Places`: of the table of what comes again; 0: the level's own.
std::vector<uint8_t> compress(std::span<const uint8_t> raw, int log2Places = 0) {
    thread_local std::vector<uint8_t> room;
    if (room.size() < ZSTD_compressBound(raw.size())) room.resize(ZSTD_compressBound(raw.size()));
    ZSTD_CCtx& context = zstdContext(ZSTD_createCCtx, ZSTD_freeCCtx);
    for (const auto& [what, value] : {std::pair{ZSTD_c_compressionLevel, kZstdLevel},
                                      {ZSTD_c_hashLog, log2Places},
                                      {ZSTD_c_minMatch, log2Places == 0 ? 0 : kShortestMatch}})
        written(ZSTD_CCtx_setParameter(&context, what, value));
    const size_t bytes = written(ZSTD_compress2(&context, room.data(), room.size(), raw.data(), raw.size()));
    return {room.begin(), room.begin() + static_cast<ptrdiff_t>(bytes)};
}

/// meshoptimizer's codec under zstd.
template <typename T>
std::vector<uint8_t> encodeRecords(const std::vector<T>& records) {
    thread_local std::vector<uint8_t> scratch;
    constexpr int kPlaces = std::is_same_v<T, shared::PointRecord> ? kLog2FewPlaces : 0;
    return compress(encodeVertices(records.data(), records.size(), sizeof(T), scratch), kPlaces);
}

Result<std::vector<uint8_t>> decompress(const uint8_t* bytes, size_t count, size_t limit, const std::string& where) {
    const unsigned long long size = ZSTD_getFrameContentSize(bytes, count);
    if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN || size > limit ||
        !isPossibleGain(count, size))
        return fail(ErrorKind::input, fmt::format("a compressed block does not hold at most {} bytes", limit), where,
                    "the file is damaged; build it again");
    std::vector<uint8_t> out(size);
    ZSTD_DCtx& context = zstdContext(ZSTD_createDCtx, ZSTD_freeDCtx);
    const size_t got = unlessOutOfMemory(ZSTD_decompressDCtx(&context, out.data(), out.size(), bytes, count));
    if (ZSTD_isError(got) || got != size)
        return fail(ErrorKind::input, "a compressed block is damaged", where, "build it again");
    return out;
}

/// `count` records of T out of meshoptimizer's codec under zstd.
template <typename T>
Result<std::vector<T>> decodeRecords(const uint8_t* bytes, size_t size, size_t count, const std::string& where,
                                     const char* what) {
    const size_t limit = meshopt_encodeVertexBufferBound(count, sizeof(T));
    STIPPLE_ASSIGN(const std::vector<uint8_t> encoded, decompress(bytes, size, limit, where));
    std::vector<T> out;
    if (encoded.size() >= fewestEncodedBytes(count, sizeof(T))) out.resize(count);
    if (out.size() != count ||
        meshopt_decodeVertexBuffer(out.data(), count, sizeof(T), encoded.data(), encoded.size()) != 0)
        return fail(ErrorKind::input, fmt::format("{} are damaged", what), where, "build it again");
    return out;
}

}  // namespace

std::vector<uint8_t> encodeChunk(const Chunk& chunk) {
    const std::vector<uint8_t> records = encodeRecords(chunk.records);
    std::vector<uint8_t> low;
    if (!chunk.lowBits.empty()) {
        std::vector<uint8_t> raw(chunk.lowBits.size() * 4);
        std::memcpy(raw.data(), chunk.lowBits.data(), raw.size());
        low = compress(raw);
    }
    const ChunkHead head{static_cast<uint32_t>(records.size()), static_cast<uint32_t>(low.size())};
    std::vector<uint8_t> out(sizeof(head) + records.size() + low.size());
    std::memcpy(out.data(), &head, sizeof(head));
    std::memcpy(out.data() + sizeof(head), records.data(), records.size());
    if (!low.empty()) std::memcpy(out.data() + sizeof(head) + records.size(), low.data(), low.size());
    return out;
}

Result<Chunk> decodeChunk(const uint8_t* bytes, size_t count, uint32_t records, const std::string& where,
                          bool wantLowBits) {
    ChunkHead head{};
    if (count < sizeof(head)) return fail(ErrorKind::input, "the chunk is shorter than its head", where);
    std::memcpy(&head, bytes, sizeof(head));
    if (uint64_t{head.recordBytes} + head.lowBitBytes + sizeof(head) != count)
        return fail(ErrorKind::input, "the chunk's parts do not add up to its size", where, "build it again");
    Chunk chunk;
    STIPPLE_ASSIGN(chunk.records, decodeRecords<shared::PointRecord>(bytes + sizeof(head), head.recordBytes, records,
                                                                     where, "the records of a chunk"));
    if (wantLowBits && head.lowBitBytes > 0) {
        STIPPLE_ASSIGN(const std::vector<uint8_t> raw, decompress(bytes + sizeof(head) + head.recordBytes,
                                                                  head.lowBitBytes, size_t{records} * 12, where));
        if (raw.size() != size_t{records} * 12)
            return fail(ErrorKind::input, "the low bits of a chunk are damaged", where, "build it again");
        chunk.lowBits.resize(size_t{records} * 3);
        std::memcpy(chunk.lowBits.data(), raw.data(), raw.size());
    }
    return chunk;
}

std::vector<uint8_t> encodeCurveChunk(const Chunk& chunk) { return encodeRecords(chunk.segments); }

Result<Chunk> decodeCurveChunk(const uint8_t* bytes, size_t count, uint32_t segments, const std::string& where) {
    Chunk chunk;
    STIPPLE_ASSIGN(chunk.segments,
                   decodeRecords<shared::CurveSegment>(bytes, count, segments, where, "the segments of a chunk"));
    // Radii are the upper half of an fp32: an exponent of all ones is no number.
    uint32_t bad = 0;
    for (const shared::CurveSegment& s : chunk.segments)
        for (const uint32_t word : {s.a.positionZ, s.b.positionZ}) bad |= (word & kNotFinite) == kNotFinite ? 1u : 0u;
    if (bad != 0) return fail(ErrorKind::input, "a segment has a radius that is no number", where, "build it again");
    return chunk;
}

namespace {

struct MeshChunkHead {
    uint32_t vertexBytes, triangleBytes, clusterBytes;
};

/// Are all on the lattice, with texture coordinates that are numbers? Differences of places must be, too. (Of pairs,
/// what clusters hold is looked at.)
bool arePossible(const std::vector<shared::MeshVertex>& vertices, MeshVertices kind) {
    constexpr int kLargest = 1 << 30;
    const int least = kind == MeshVertices::shortOnes ? 0 : -kLargest;
    uint32_t bad = 0;
    for (const shared::MeshVertex& v : vertices) {
        const auto u = std::bit_cast<uint32_t>(v.u), w = std::bit_cast<uint32_t>(v.v);
        const bool isOut = std::min({v.x, v.y, v.z}) < least || std::max({v.x, v.y, v.z}) > kLargest;
        bad |= isOut && kind != MeshVertices::pairs ? 1u : 0u;
        bad |= (u & kNotFinite) == kNotFinite ? 1u : 0u;
        bad |= (w & kNotFinite) == kNotFinite ? 1u : 0u;
    }
    return bad == 0;
}

template <typename T>
Result<std::vector<T>> decompressArray(const uint8_t* bytes, size_t count, size_t items, const std::string& where) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> raw, decompress(bytes, count, items * sizeof(T), where));
    if (raw.size() != items * sizeof(T))
        return fail(ErrorKind::input, "a part of a chunk has not its size", where, "build it again");
    std::vector<T> out(items);
    if (items > 0) std::memcpy(out.data(), raw.data(), raw.size());
    return out;
}

}  // namespace

std::vector<uint8_t> encodeTile(const std::vector<uint32_t>& texels) { return encodeRecords(texels); }

Result<Chunk> decodeTile(const uint8_t* bytes, size_t count, const std::string& where) {
    constexpr size_t kTexels = size_t{shared::kTileEdge} * shared::kTileEdge;
    Chunk chunk;
    STIPPLE_ASSIGN(chunk.texels, decodeRecords<uint32_t>(bytes, count, kTexels, where, "the texels of a tile"));
    return chunk;
}

std::vector<uint8_t> encodeMeshChunk(const Chunk& chunk) {
    // Planes of bytes compress better than words: each corner's index follows that of the triangle before.
    std::vector<uint8_t> corners(chunk.triangles.size() * 4);
    for (size_t i = 0; i < chunk.triangles.size(); ++i)
        for (size_t k = 0; k < 4; ++k)
            corners[k * chunk.triangles.size() + i] = static_cast<uint8_t>(chunk.triangles[i] >> (8 * k));
    std::vector<uint8_t> clusters(chunk.clusters.size() * sizeof(shared::MeshCluster));
    if (!clusters.empty()) std::memcpy(clusters.data(), chunk.clusters.data(), clusters.size());
    const std::vector<uint8_t> a = encodeRecords(chunk.vertices), b = compress(corners), c = compress(clusters);
    const MeshChunkHead head{static_cast<uint32_t>(a.size()), static_cast<uint32_t>(b.size()),
                             static_cast<uint32_t>(c.size())};
    std::vector<uint8_t> out(sizeof(head));
    std::memcpy(out.data(), &head, sizeof(head));
    for (const auto* part : {&a, &b, &c}) out.insert(out.end(), part->begin(), part->end());
    return out;
}

Result<Chunk> decodeMeshChunk(const uint8_t* bytes, size_t count, uint32_t triangles, const MeshGroup& group,
                              MeshVertices kind, const std::string& where) {
    MeshChunkHead head{};
    if (count < sizeof(head)) return fail(ErrorKind::input, "the chunk is shorter than its head", where);
    std::memcpy(&head, bytes, sizeof(head));
    if (uint64_t{head.vertexBytes} + head.triangleBytes + head.clusterBytes + sizeof(head) != count)
        return fail(ErrorKind::input, "the chunk's parts do not add up to its size", where, "build it again");
    const uint8_t* at = bytes + sizeof(head);
    Chunk chunk;
    STIPPLE_ASSIGN(chunk.vertices, decodeRecords<shared::MeshVertex>(at, head.vertexBytes, group.vertices, where,
                                                                     "the vertices of a chunk"));
    if (!arePossible(chunk.vertices, kind))
        return fail(ErrorKind::input, "a vertex lies nowhere, or its texture coordinates are no numbers", where,
                    "build it again");
    at += head.vertexBytes;
    STIPPLE_ASSIGN(const std::vector<uint8_t> corners,
                   decompressArray<uint8_t>(at, head.triangleBytes, size_t{triangles} * 4, where));
    chunk.triangles.resize(triangles);
    for (size_t i = 0; i < triangles; ++i)
        chunk.triangles[i] = static_cast<uint32_t>(corners[i]) | static_cast<uint32_t>(corners[triangles + i]) << 8 |
                             static_cast<uint32_t>(corners[size_t{2} * triangles + i]) << 16;
    at += head.triangleBytes;
    STIPPLE_ASSIGN(chunk.clusters, decompressArray<shared::MeshCluster>(at, head.clusterBytes, group.clusters, where));
    // The renderers index with these: every cluster within the chunk, every corner within its cluster.
    for (const shared::MeshCluster& c : chunk.clusters) {
        const uint64_t slots = c.counts & 0xffffu, count3 = c.counts >> 16;
        const uint64_t vertices = kind == MeshVertices::pairs ? slots / 2 : slots;
        bool fits = slots <= shared::kClusterVertices && count3 <= shared::kClusterTriangles &&
                    c.firstVertex + slots <= group.vertices && c.firstTriangle + count3 <= triangles;
        for (uint64_t i = vertices; fits && i < slots; ++i) {
            const shared::MeshVertex& high = chunk.vertices[c.firstVertex + i];
            constexpr int kFarthest = 1 << 29;  // 2^61 steps
            fits = std::min({high.x, high.y, high.z}) >= -kFarthest && std::max({high.x, high.y, high.z}) <= kFarthest;
        }
        for (uint64_t t = 0; fits && t < count3; ++t) {
            const uint32_t corner = chunk.triangles[c.firstTriangle + t];
            fits = (corner & 255u) < vertices && (corner >> 8 & 255u) < vertices && (corner >> 16 & 255u) < vertices;
        }
        if (!fits) return fail(ErrorKind::input, "a cluster points outside its chunk", where, "build it again");
    }
    return chunk;
}

}  // namespace stipple::lod
