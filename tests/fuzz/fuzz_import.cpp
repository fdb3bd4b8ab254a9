// libFuzzer: any bytes as PLY or LAS end in points or in an error, within a bounded time and memory.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "lod/import/import.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static const int descriptor = memfd_create("fuzz", 0);
    static const std::string path = "/proc/self/fd/" + std::to_string(descriptor);
    if (ftruncate(descriptor, 0) != 0 || pwrite(descriptor, data, size, 0) != static_cast<ssize_t>(size)) return 0;
    for (const auto open : {stipple::lod::openPly, stipple::lod::openLas}) {
        auto source = open(path);
        while (source) {
            stipple::lod::PointBlock block;
            const auto count = source->read(block, 65536);
            if (!count || *count == 0) break;
        }
    }
    return 0;
}
