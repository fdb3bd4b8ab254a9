// Maps of patches as bytes: each texel that a drawn cell touches minus what its left and lower neighbours predict
// (their sum minus the one between them, or the nearer of both: Weinberger, Seroussi & Sapiro 2000, 3.1), in planes of
// bytes under zstd. Mips are made when they are read: they would be a third more bytes. Light of their own is one more
// stream behind the others, only where some patch has it.
//
// Everything is exact, but normals: they stand on the steps of kMapNormalStep.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/primitives/patch.h"

namespace stipple::lod {

struct PatchMapBytes {
    std::vector<uint8_t> bytes;  ///< none where no patch has a map
    uint64_t colours = 0, normals = 0, materials = 0;
    uint64_t light = 0;  ///< 0: there is no such stream
};
PatchMapBytes encodeMaps(std::span<const Patch> patches);

/// What is known of patches before their maps are read.
struct MapLimits {
    uint64_t blocks = 0;  ///< of 16 x 8 cells: how many they are
    uint32_t most = 0;    ///< log2 of texels along an edge of a cell; kMapNormals and kMapLight where they are allowed
    bool hasLight = false;  ///< there is a stream of it
};
/// Of any bytes, to patches whose sides and cells are known and possible. False: they are no such maps, or larger than
/// is allowed. No array is made that the bytes do not justify.
bool decodeMaps(std::span<const uint8_t> bytes, std::span<Patch> patches, const MapLimits& limits);

}  // namespace stipple::lod
