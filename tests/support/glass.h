// A ball of glass before a board, for tests of what is seen through it.
#pragma once

#include <cmath>
#include <memory>

#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "tests/support/support.h"

namespace stipple::test {

/// As triangles, around the origin, radius 1; double-sided if it is none of a body.
inline scene::Primitive ball(uint32_t around) {
    scene::Primitive mesh;
    const uint32_t up = around / 2;
    for (uint32_t j = 0; j <= up; ++j)
        for (uint32_t i = 0; i <= around; ++i) {
            const double a = 2 * M_PI * i / around, b = M_PI * j / up;
            mesh.position.emplace_back(std::cos(a) * std::sin(b), std::cos(b), std::sin(a) * std::sin(b));
            if (i == 0 || j == 0) continue;
            const auto d = static_cast<uint32_t>(mesh.position.size() - 1), c = d - 1, upper = d - (around + 1),
                       left = upper - 1;
            for (const uint32_t k : {left, upper, d, left, d, c}) mesh.indices.push_back(k);
        }
    mesh.normal = mesh.position;
    return mesh;
}

/// Squares of two colours, 16 x 16 of them, x and y from -4 to 4, facing +z.
inline scene::Primitive board(double z) {
    scene::Primitive mesh;
    constexpr int kSquares = 16;
    for (int j = 0; j < kSquares; ++j)
        for (int i = 0; i < kSquares; ++i) {
            const auto first = static_cast<uint32_t>(mesh.position.size());
            for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
                mesh.position.emplace_back(0.5 * (i + x) - 4, 0.5 * (j + y) - 4, z);
                mesh.normal.emplace_back(0, 0, 1);
                mesh.colour.push_back((i + j) % 2 == 0 ? glm::vec4(0.8f, 0.2f, 0.1f, 1)
                                                       : glm::vec4(0.1f, 0.3f, 0.8f, 1));
            }
            for (const uint32_t k : {0u, 1u, 2u, 0u, 2u, 3u}) mesh.indices.push_back(first + k);
        }
    return mesh;
}

inline std::shared_ptr<const lod::Store> meshStore(scene::Primitive mesh,
                                                   const std::optional<scene::Material>& material,
                                                   const std::string& path, Executor& executor) {
    scene::Scene scene;
    scene.path = "glass";
    if (material) {
        scene.materials = {*material};
        mesh.material = 0;
    }
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {std::move(mesh)};
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(scene);
    build.description.optics = scene::surfaceOptics(scene, scene::placements(scene));
    Progress silent(false);
    const auto built =
        lod::buildMeshStore(scene::triangleSource(scene, scene::placements(scene)), path, build, executor, silent);
    EXPECT_TRUE(built);
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

/// Patches of a mesh of white triangles, about so many samples; a mirror where nothing else is asked for.
inline std::shared_ptr<const lod::Store> patchStore(const scene::Primitive& of, uint64_t samples,
                                                    const std::string& path, Executor& executor) {
    lod::TriangleMesh mesh;
    for (size_t v = 0; v < of.position.size(); ++v) {
        mesh.position.emplace_back(glm::round(glm::dvec3(of.position[v]) * 1e7) / 1e7);  // a ball's pole is one place
        mesh.normal.push_back(of.normal[v]);
        mesh.colour.push_back(~0u);
        mesh.surface.push_back(0);
        mesh.uv.emplace_back(0);
    }
    mesh.indices = of.indices;
    lod::PatchBuildSettings settings;
    settings.samples = samples;
    settings.description.pointMaterials = {{0, 1}};
    Progress silent(false);
    const auto built = lod::buildPatchStore(lod::sourceOf(mesh), path, settings, executor, silent);
    EXPECT_TRUE(built) << (built ? "" : built.error().line());
    for (const std::string& note : built->notes) std::printf("patches: %s\n", note.c_str());
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

/// A dielectric, smooth, white.
inline scene::Material glassMaterial(const lod::Optics& optics, float roughness = 0) {
    scene::Material m;
    m.metallic = 0;
    m.roughness = roughness;
    m.optics = optics;
    return m;
}

/// Evenly spread (Fibonacci) on a unit sphere.
inline std::vector<TestPoint> spherePoints(size_t count, uint32_t colour) {
    std::vector<TestPoint> points;
    for (size_t i = 0; i < count; ++i) {
        const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(count),
                     a = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
        const glm::dvec3 p(r * std::cos(a), r * std::sin(a), z);
        points.push_back({p, glm::vec3(p), colour, 0});
    }
    return points;
}

inline lod::View glassView(const glm::dvec3& eye, uint32_t size, bool isOrthographic = false) {
    scene::Camera camera;
    camera.eye = eye;
    camera.target = {0, 0, 0};
    camera.up = {0, 1, 0};
    camera.fovDegrees = 40;
    lod::View view = scene::makeView(camera, size, size, 1e-3);
    if (isOrthographic) {
        view.isOrthographic = true;
        view.focalPixels /= glm::length(eye);
    }
    return view;
}

/// Light says where it comes from: 1 + half of the direction.
inline render::HdrImage directionLight(uint32_t width) {
    render::HdrImage image{width, width / 2, {}};
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const double a = ((x + 0.5) / width - 0.5) * 2 * M_PI, e = (0.5 - (y + 0.5) / image.height) * M_PI;
            for (const double v : {std::sin(a) * std::cos(e), std::sin(e), -std::cos(a) * std::cos(e)})
                image.rgb.push_back(static_cast<float>(1 + 0.5 * v));
        }
    return image;
}

inline render::FrameSettings glassSettings(render::Mode mode) {
    render::FrameSettings settings;
    settings.mode = mode;
    settings.draw.lit = true;
    settings.draw.worldUp = {0, 1, 0};
    settings.budgets.errorPixels = 0.25;
    settings.wantDepthAndNormal = true;
    return settings;
}

}  // namespace stipple::test
