#include "engine/scene/scene_bytes.h"

#include <filesystem>

#include "engine/base/file.h"

namespace stipple::scene {

Result<Scene> readScene(const std::string& path, const ReadSettings& settings) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    return readScene(file, settings, {});
}

Result<Scene> readScene(const ByteSource& file, const ReadSettings& settings, const Resolve& resolve) {
    const bool isObj =
        std::filesystem::path(file.path()).extension() == ".obj" && lod::fileKindOf(file) != lod::FileKind::glb;
    return isObj ? readObj(file, settings, resolve) : readGltf(file, settings, resolve);
}

bool isScene(const std::string& path, lod::FileKind kind) {
    if (kind != lod::FileKind::other) return kind == lod::FileKind::glb;
    const std::string extension = std::filesystem::path(path).extension().string();
    return extension == ".gltf" || extension == ".glb" || extension == ".obj";
}

Result<std::vector<uint8_t>> readNamed(const Resolve& resolve, const std::string& folder, const std::string& name,
                                       const ReadSettings& settings) {
    if (!resolve) return readFileOfScene(folder, name, settings);
    STIPPLE_ASSIGN(const std::shared_ptr<const ByteSource> source, resolve(name));
    if (!source) return fail(ErrorKind::input, "is not among what was given with the scene", name);
    if (source->sizeBytes() > settings.memoryBytes)
        return overBudget("is read as a whole, which", source->sizeBytes(), settings.memoryBytes, source->path());
    std::vector<uint8_t> bytes(source->sizeBytes());
    if (!bytes.empty()) STIPPLE_TRY(source->readAt(0, bytes.data(), bytes.size()));
    return bytes;
}

std::vector<glm::dmat4> Scene::worldTransforms() const {
    std::vector<glm::dmat4> world(nodes.size());
    for (size_t i = 0; i < nodes.size(); ++i)
        world[i] = nodes[i].parent < 0 ? nodes[i].local : world[static_cast<size_t>(nodes[i].parent)] * nodes[i].local;
    return world;
}

std::vector<bool> Scene::visibility() const {
    std::vector<bool> visible(nodes.size());
    for (size_t i = 0; i < nodes.size(); ++i)
        visible[i] = nodes[i].isVisible && (nodes[i].parent < 0 || visible[static_cast<size_t>(nodes[i].parent)]);
    return visible;
}

Box meshBounds(const Scene& scene) {
    Box box;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    const std::vector<bool> visible = scene.visibility();
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        const Node& node = scene.nodes[n];
        if (node.mesh < 0 || !visible[n]) continue;
        std::vector<glm::dmat4> places = node.instances;
        if (places.empty()) places.emplace_back(1);
        for (const glm::dmat4& place : places)
            for (const Primitive& primitive : scene.meshes[static_cast<size_t>(node.mesh)].primitives)
                for (size_t i = 0; i < primitive.position.size(); ++i)
                    box.add(glm::dvec3(world[n] * (place * glm::dvec4(primitive.at(i), 1))));
    }
    return box;
}

}  // namespace stipple::scene
