// Squares and balls of triangles, whose pictures can be worked out.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <memory>
#include <string>
#include <vector>

#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_build.h"

namespace stipple::test {

/// Of a diffuse white, unless it is painted.
class Shapes {
  public:
    Shapes() {
        scene_.meshes.resize(1);
        scene_.nodes.resize(1);
        scene_.nodes[0].mesh = 0;
        scene::Material white;
        white.roughness = 1;
        white.metallic = 0;
        paint(white);
    }
    /// What is added from here on.
    void paint(scene::Material material) {
        material.isDoubleSided = true;
        if (!scene_.materials.empty() && mesh().position.empty()) scene_.materials.pop_back();
        if (scene_.materials.size() == scene_.meshes[0].primitives.size()) scene_.meshes[0].primitives.emplace_back();
        scene_.materials.push_back(material);
        mesh().material = static_cast<uint32_t>(scene_.materials.size() - 1);
    }
    void add(const std::vector<glm::dvec3>& places, const std::vector<glm::dvec3>& normals, uint32_t columns) {
        const auto first = static_cast<uint32_t>(mesh().position.size());
        for (size_t i = 0; i < places.size(); ++i) {
            mesh().position.emplace_back(places[i]);
            mesh().normal.emplace_back(normals[i]);
        }
        const auto rows = static_cast<uint32_t>(places.size()) / columns;
        for (uint32_t y = 0; y + 1 < rows; ++y)
            for (uint32_t x = 0; x + 1 < columns; ++x) {
                const uint32_t a = first + y * columns + x, b = a + 1, c = a + columns, d = c + 1;
                for (const uint32_t k : {a, b, d, a, d, c}) mesh().indices.push_back(k);
            }
    }
    /// A square about `middle`, from its edges' halves.
    void square(const glm::dvec3& middle, const glm::dvec3& u, const glm::dvec3& v) {
        const glm::dvec3 n = glm::normalize(glm::cross(u, v));
        add({middle - u - v, middle + u - v, middle - u + v, middle + u + v}, {n, n, n, n}, 2);
    }
    void ball(const glm::dvec3& middle, double radius) {
        constexpr uint32_t kAround = 96, kDown = 48;
        std::vector<glm::dvec3> places, normals;
        for (uint32_t j = 0; j <= kDown; ++j)
            for (uint32_t i = 0; i <= kAround; ++i) {
                const double a = 2 * glm::pi<double>() * i / kAround, e = glm::pi<double>() * j / kDown;
                normals.emplace_back(std::sin(e) * std::cos(a), std::sin(e) * std::sin(a), -std::cos(e));
                places.push_back(middle + radius * normals.back());
            }
        add(places, normals, kAround + 1);
    }
    std::shared_ptr<const lod::Store> built(const std::string& path, Executor& executor) const {
        lod::MeshBuildSettings build;
        build.description.materials = scene::surfaceMaterials(scene_);
        build.description.optics = scene::surfaceOptics(scene_, scene::placements(scene_));
        Progress silent(false);
        const auto done = lod::buildMeshStore(scene::triangleSource(scene_, scene::placements(scene_)), path, build,
                                              executor, silent);
        EXPECT_TRUE(done) << done.error().line();
        auto store = lod::openStore(path);
        EXPECT_TRUE(store) << store.error().line();
        return store ? std::make_shared<const lod::Store>(std::move(*store)) : nullptr;
    }

  private:
    scene::Primitive& mesh() { return scene_.meshes[0].primitives.back(); }
    scene::Scene scene_;
};

/// From a place to another, z up.
inline lod::View lookingAt(const glm::dvec3& target, const glm::dvec3& from, bool isOrthographic = false) {
    lod::View v;
    v.eye = from;
    v.forward = glm::normalize(target - from);
    v.right = glm::normalize(glm::cross(v.forward, glm::dvec3(0, 0, 1)));
    v.down = glm::cross(v.forward, v.right);
    v.width = 240;
    v.height = 180;
    v.focalPixels = 220;
    v.isOrthographic = isOrthographic;
    if (isOrthographic) v.focalPixels /= glm::length(target - from);
    return v;
}

}  // namespace stipple::test
