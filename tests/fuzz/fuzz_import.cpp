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
    stipple::lod::ReadOptions options;
    options.attributes = {"intensity", "classification", "gps_time"};
    for (const bool skipBad : {false, true}) {
        options.skipBad = skipBad;
        if (const auto ply = stipple::lod::openPly(path, options)) (void)stipple::lod::readPoints(*ply);
        if (const auto las = stipple::lod::openLas(path, options)) (void)stipple::lod::readPoints(*las);
    }
    return 0;
}
