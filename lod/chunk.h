// A decoded chunk (the records of one node) and its encoding on disk: meshoptimizer's vertex codec (byte-wise deltas)
// under zstd. Where a leaf's position step is coarser than the lattice, the low bits travel in a stream of their own,
// so that scanner integers come back exactly.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/result.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

struct Chunk {
    std::vector<shared::PointRecord> records;
    /// 3 per record (x, y, z), each below 2^stepShift; empty where the step is one lattice unit or the node is no leaf.
    std::vector<uint32_t> lowBits;
    uint64_t sizeBytes() const { return records.size() * sizeof(shared::PointRecord); }
};

std::vector<uint8_t> encodeChunk(const Chunk& chunk);

/// Decodes a chunk of `records` records. `where` names the place in errors. Allocates no more than `records` justifies.
Result<Chunk> decodeChunk(const uint8_t* bytes, size_t count, uint32_t records, const std::string& where,
                          bool wantLowBits);

}  // namespace stipple::lod
