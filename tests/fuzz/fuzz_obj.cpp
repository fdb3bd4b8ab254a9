// libFuzzer: any bytes as OBJ, and those after a zero byte as its MTL file, end in a scene or in an error.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>

#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"

namespace {

std::string makeFolder() {
    std::string name = "/tmp/stipple-fuzz-XXXXXX";
    return mkdtemp(name.data()) == nullptr ? std::string(".") : name;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static const std::string folder = makeFolder();
    const std::string all(reinterpret_cast<const char*>(data), size);
    const size_t cut = std::min(all.find('\0'), all.size());
    std::ofstream(folder + "/a.obj", std::ios::binary) << all.substr(0, cut);
    std::ofstream(folder + "/a.mtl", std::ios::binary) << all.substr(std::min(cut + 1, all.size()));
    const auto scene = stipple::scene::readObj(folder + "/a.obj");
    if (!scene) return 0;
    (void)stipple::scene::meshBounds(*scene);
    (void)stipple::scene::surfaceMaterials(*scene);
    const auto triangles = stipple::scene::triangleSource(*scene, stipple::scene::placements(*scene));
    (void)triangles.read([](const auto&) -> stipple::Result<void> { return {}; });
    return 0;
}
