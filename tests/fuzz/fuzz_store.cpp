// libFuzzer: any bytes as a chunk end in records or in an error.
#include <cstdint>

#include "lod/chunk.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size < 1) return 0;
    (void)stipple::lod::decodeChunk(data + 1, size - 1, data[0] + 1u, "fuzz", true);
    return 0;
}
