// Weights of the surfels of a payload, in a stream of their own: a byte each, in the order of the records, under zstd.
// What a byte stands for: surfelWeight (shaders/shared/surfel_weight.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lod/store/hierarchy.h"

namespace stipple::lod {

struct Chunk;

/// The stream of a payload's weights; null: it has none.
const Stream* weightsOf(const Hierarchy& h, uint32_t chunk);
/// Has any payload of the store weights?
bool hasWeights(const Hierarchy& h);
/// What they take in memory, behind their records: whole words.
constexpr uint64_t weightBytes(uint64_t records) { return (records + 3) / 4 * 4; }

std::vector<uint8_t> encodeWeights(const std::vector<uint8_t>& codes);
/// As Chunk::weights has them: weightBytes(records), the last ones zero. Code 0 is drawn as no weight at all, and never
/// written (weightCode). `where` names the place in errors.
Result<std::vector<uint8_t>> decodeWeights(const uint8_t* bytes, size_t count, uint32_t records,
                                           const std::string& where);

}  // namespace stipple::lod
