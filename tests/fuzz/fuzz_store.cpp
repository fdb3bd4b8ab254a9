// libFuzzer: any bytes as a chunk end in records or in an error.
#include <cstdint>

#include "lod/chunk.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size < 1) return 0;
    (void)stipple::lod::decodeChunk(data + 1, size - 1, data[0] + 1u, "fuzz", true);
    stipple::lod::MeshGroup group;
    group.vertices = data[0];
    group.clusters = 1 + data[0] / 64u;
    (void)stipple::lod::decodeMeshChunk(data + 1, size - 1, data[0] * 2u, group, "fuzz");
    (void)stipple::lod::decodeTile(data + 1, size - 1, "fuzz");
    return 0;
}
