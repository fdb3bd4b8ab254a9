#include "engine/scene/scene.h"

#include <filesystem>

#include "lod/store/file_kind.h"

namespace stipple::scene {

Result<Scene> readScene(const std::string& path, const ReadSettings& settings) {
    const bool isObj = std::filesystem::path(path).extension() == ".obj" && lod::fileKindOf(path) != lod::FileKind::glb;
    return isObj ? readObj(path, settings) : readGltf(path, settings);
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
