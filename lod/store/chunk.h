// A decoded chunk (the records of one node) and its encoding on disk: meshoptimizer's vertex codec (byte-wise deltas)
// under zstd. Where a leaf's position step is coarser than the lattice, the low bits travel in a stream of their own,
// so that scanner integers come back exactly.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/result.h"
#include "lod/primitives/mesh.h"
#include "lod/primitives/patch_blocks.h"
#include "shaders/shared/curve.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

struct Chunk {
    std::vector<shared::PointRecord> records;
    /// Of each record (of blocks of patches: of each of their samples), packed (shaders/shared/material.h); empty: all
    /// have the store's. In the file they are numbers: readers add them (lod/store/materials.h).
    std::vector<uint16_t> materials;
    std::vector<uint8_t> weights;  ///< of surfels, where the store has them (surfel_weights.h)
    /// 3 per record (x, y, z), each below 2^stepShift; empty where the step is one lattice unit or the node is no leaf.
    std::vector<uint32_t> lowBits;
    // Of a mesh store instead of records:
    std::vector<shared::MeshVertex> vertices;
    std::vector<uint32_t> triangles;
    std::vector<shared::MeshCluster> clusters;
    std::vector<shared::CurveSegment> segments;  ///< of a curve store
    std::vector<uint32_t> texels;                ///< of a texture's tile, kTileEdge x kTileEdge
    std::vector<shared::PatchBlock> patchBlocks;
    std::vector<PatchPlane> patchPlanes;  ///< of each block
    std::vector<uint32_t> patchMaps;      ///< of blocks (shaders/shared/patch_map.h)
    /// Calls use(array) for all that backends draw from, in the order in which it lies on a device.
    template <typename Use>
    void forEachArray(const Use& use) const {
        use(records);
        use(weights);
        use(patchBlocks);
        use(materials);
        use(patchMaps);
        use(segments);
        use(vertices);
        use(triangles);
        use(texels);
    }
    uint64_t sizeBytes() const {
        uint64_t bytes = clusters.size() * sizeof(shared::MeshCluster) + patchPlanes.size() * sizeof(PatchPlane);
        forEachArray([&](const auto& array) { bytes += array.size() * sizeof(array[0]); });
        return bytes;
    }
};

std::vector<uint8_t> encodeChunk(const Chunk& chunk);

/// Decodes a chunk of `records` records. `where` names the place in errors. Allocates no more than `records` justifies.
Result<Chunk> decodeChunk(const uint8_t* bytes, size_t count, uint32_t records, const std::string& where,
                          bool wantLowBits);

/// The same for a chunk of a curve store.
std::vector<uint8_t> encodeCurveChunk(const Chunk& chunk);
Result<Chunk> decodeCurveChunk(const uint8_t* bytes, size_t count, uint32_t segments, const std::string& where);

/// A texture tile, kTileEdge x kTileEdge texels.
std::vector<uint8_t> encodeTile(const std::vector<uint32_t>& texels);
Result<Chunk> decodeTile(const uint8_t* bytes, size_t count, const std::string& where);

/// How the coordinates of a mesh's vertices are kept, see mesh_place.h.
enum class MeshVertices : uint8_t { shortOnes, counted, pairs };

/// The same for a chunk of a mesh store.
std::vector<uint8_t> encodeMeshChunk(const Chunk& chunk);
Result<Chunk> decodeMeshChunk(const uint8_t* bytes, size_t count, uint32_t triangles, const MeshGroup& group,
                              MeshVertices vertices, const std::string& where);

}  // namespace stipple::lod
