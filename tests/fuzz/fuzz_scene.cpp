// libFuzzer: any bytes as glTF end in a scene or in an error, within a bounded time and memory.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "engine/scene/scene.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static const int descriptor = memfd_create("fuzz", 0);
    static const std::string path = "/proc/self/fd/" + std::to_string(descriptor);
    if (ftruncate(descriptor, 0) != 0 || pwrite(descriptor, data, size, 0) != static_cast<ssize_t>(size)) return 0;
    for (const bool repair : {false, true})
        if (const auto scene = stipple::scene::readGltf(path, repair)) (void)stipple::scene::meshBounds(*scene);
    return 0;
}
