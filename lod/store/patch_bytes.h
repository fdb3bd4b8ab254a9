// Patches as bytes: what is smooth is predicted, what is left lies in planes of bytes under zstd.
//
//   head      sides, plane, errors, a patch after the other
//   cells     a bit each
//   heights   of samples in use: codes minus left + below - lower left (or what there is of them), zigzag
//   normals   octahedral steps (11 bits each way, of mirrors 13) minus the neighbour's, or minus the normal of the
//   heights' own slope:
//             whichever takes less room
//   colours   minus the neighbour's; red and blue also minus green's
//   materials numbers minus the neighbour's; left out where all have the first
//   maps      patch_map_bytes.h; patches that have one have no colours beside it
//
// Everything is exact: decoding gives the patches again.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/result.h"
#include "lod/primitives/patch.h"

namespace stipple::lod {

struct PatchBytes {
    std::vector<uint8_t> bytes;
    /// Of `bytes`: heads, cells and heights; normals; colours; materials.
    uint64_t geometry = 0, normals = 0, colours = 0, materials = 0;
    uint64_t mapColours = 0, mapNormals = 0, mapMaterials = 0, mapLight = 0;  ///< likewise, of maps
};

PatchBytes encodePatches(std::span<const Patch> patches);
/// What the table of a store tells of a payload.
struct PatchLimits {
    uint64_t blocks = ~uint64_t{0} >> 16;  ///< of 16 x 8 cells, no more
    uint32_t map = 23;  ///< as Payload::maps has it: no finer maps, no normals or light unless they are told
};
/// Of any bytes. `where` for errors. No array is made before the bytes are there that can fill it, nor what is more
/// than the table tells: what is taken is a small multiple of what such blocks take when they are decoded.
Result<std::vector<Patch>> decodePatches(std::span<const uint8_t> bytes, const std::string& where,
                                         const PatchLimits& told = {});

/// Of what encodePatches made, those of maps, which its first kPatchHeadBytes tell; 0 of fewer, and of any bytes
/// something.
constexpr size_t kPatchHeadBytes = 64;
uint64_t mapBytesOf(std::span<const uint8_t> bytes);

}  // namespace stipple::lod
