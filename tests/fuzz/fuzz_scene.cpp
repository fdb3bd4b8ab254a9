// libFuzzer: any bytes as glTF end in a scene or in an error, within a bounded time and memory.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static const int descriptor = memfd_create("fuzz", 0);
    static const std::string path = "/proc/self/fd/" + std::to_string(descriptor);
    if (ftruncate(descriptor, 0) != 0 || pwrite(descriptor, data, size, 0) != static_cast<ssize_t>(size)) return 0;
    for (const bool isStrict : {false, true}) {
        stipple::scene::ReadSettings settings;
        settings.isStrict = isStrict;
        settings.memoryBytes = uint64_t{256} << 20;
        const auto scene = stipple::scene::readGltf(path, settings);
        if (!scene) continue;
        (void)stipple::scene::meshBounds(*scene);
        const auto triangles = stipple::scene::triangleSource(*scene, stipple::scene::placements(*scene));
        (void)triangles.read([](const auto&) -> stipple::Result<void> { return {}; });
        (void)stipple::scene::surfaceMaterials(*scene);
        (void)stipple::scene::textureImages(*scene);
    }
    return 0;
}
