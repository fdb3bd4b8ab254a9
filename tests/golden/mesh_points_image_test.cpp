// Meshes beside points and meshes that end in points: no seam is seen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/scene/camera.h"
#include "engine/scene/surfels.h"
#include "engine/scene/triangles.h"
#include "lod/store/nearest.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using test::draw;

/// A unit sphere, triangles on one side of x = 0 and, as a primitive of its own, points on the other.
scene::Scene halfMeshHalfPoints() {
    scene::Scene scene;
    scene.path = "half";
    scene::Primitive mesh, cloud;
    constexpr uint32_t kAround = 240, kUp = 120;
    for (uint32_t j = 0; j <= kUp; ++j)
        for (uint32_t i = 0; i <= kAround / 2; ++i) {
            const double a = 3.14159265358979 * (0.5 + 2.0 * i / kAround), b = 3.14159265358979 * j / kUp;
            mesh.position.emplace_back(std::cos(a) * std::sin(b), std::cos(b), std::sin(a) * std::sin(b));  // x <= 0
            if (i == 0 || j == 0) continue;
            const auto d = static_cast<uint32_t>(mesh.position.size() - 1), c = d - 1, b2 = d - (kAround / 2 + 1),
                       a2 = b2 - 1;
            for (const uint32_t k : {a2, b2, d, a2, d, c}) mesh.indices.push_back(k);
        }
    mesh.normal = mesh.position;
    mesh.colour.assign(mesh.position.size(), glm::vec4(0.58f, 0.58f, 0.58f, 1));
    mesh.material = 0;
    cloud.kind = scene::PrimitiveKind::points;
    Rng rng(3);
    while (cloud.position.size() < 40'000) {
        const glm::dvec3 p = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        if (p.x < 0) continue;
        cloud.indices.push_back(static_cast<uint32_t>(cloud.position.size()));
        cloud.position.emplace_back(p);
    }
    cloud.normal = cloud.position;
    cloud.colour.assign(cloud.position.size(), glm::vec4(0.58f, 0.58f, 0.58f, 1));
    scene.materials.resize(1);
    scene.materials[0].isDoubleSided = true;
    scene.materials[0].metallic = 0;
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {std::move(mesh), std::move(cloud)};
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    return scene;
}

struct Seam {
    size_t inside = 0, holes = 0, atBorder = 0, through = 0;  ///< pixels
    double mean = 0, worst = 0;                               ///< of normals at the border, degrees
};

Seam seamOf(const scene::Scene& mesh, const scene::Scene& points, const std::string& folder, Executor& executor) {
    std::vector<render::PlacedStore> placed;
    const auto place = [&](const std::string& path) {
        auto opened = lod::openStore(path);
        if (opened) placed.push_back({std::make_shared<const lod::Store>(std::move(*opened)), {}, {}});
        return bool(opened);
    };
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(mesh);
    Progress progress(false);
    lod::BuildSettings settings;
    settings.leafRecords = 1024;
    settings.open = [&](const std::string&, const lod::ReadOptions&) { return scene::sampleSurfels(points, {}, {0}); };
    if (!lod::buildMeshStore(scene::triangleSource(mesh, scene::placements(mesh)), folder + "/mesh.stipple", build,
                             executor, progress) ||
        !lod::buildStore({"points"}, folder + "/points.stipple", settings, executor, progress) ||
        !place(folder + "/points.stipple") || !place(folder + "/mesh.stipple"))
        return {};
    scene::Camera camera;
    camera.eye = {0.7, 0.4, 3};
    camera.target = {0, 0, 0};
    camera.up = {0, 1, 0};
    camera.fovDegrees = 45;
    const lod::View view = scene::makeView(camera, 480, 480, 1e-3);
    render::FrameSettings frame;
    frame.draw.lit = true;
    frame.budgets.errorPixels = 0.5;
    frame.wantDepthAndNormal = true;
    const auto backend = cpu::makeCpuBackend(executor);
    const render::Image image = draw(placed, *backend, executor, view, frame);
    Seam seam;
    for (uint32_t y = 0; y < 480; ++y)
        for (uint32_t x = 0; x < 480; ++x) {
            const glm::dvec3 ray = glm::normalize(view.forward * view.focalPixels + view.right * (x + 0.5 - 240) +
                                                  view.down * (y + 0.5 - 240));
            const double b = glm::dot(view.eye, ray), d = b * b - glm::dot(view.eye, view.eye) + 1;
            if (d < 0.03) continue;  // beside the sphere, or its rim
            const glm::dvec3 p = view.eye + ray * (-b - std::sqrt(d));
            ++seam.inside;
            const size_t i = size_t{y} * 480 + x;
            if (image.depth[i] <= 0) {
                ++seam.holes;
                continue;
            }
            if (std::abs(p.x) > 0.02) continue;
            const glm::dvec3 n(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            const double angle = std::acos(std::clamp(glm::dot(n, p), -1.0, 1.0)) * 57.29578;
            ++seam.atBorder;
            seam.mean += angle;
            seam.through += angle > 10 ? 1 : 0;
            if (angle <= 10) seam.worst = std::max(seam.worst, angle);
        }
    seam.mean /= static_cast<double>(std::max<size_t>(seam.atBorder, 1));
    return seam;
}

TEST(MeshImages, AMeshThatEndsInPointsHasNoSeam) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const scene::Scene both = halfMeshHalfPoints();
    scene::Scene onlyPoints = both;
    onlyPoints.meshes[0].primitives.erase(onlyPoints.meshes[0].primitives.begin());
    const Seam joined = seamOf(both, both, folder.path(), *executor);
    const Seam apart = seamOf(both, onlyPoints, folder.path(), *executor);
    for (const Seam& s : {joined, apart}) {
        EXPECT_GT(s.inside, 50'000u);
        EXPECT_EQ(s.holes, 0u);
        ASSERT_GT(s.atBorder, 500u);
        EXPECT_LE(s.worst, 6.0);
        printf("normals at the border: mean %.2f, largest %.2f degrees, through it %zu of %zu\n", s.mean, s.worst,
               s.through, s.atBorder);
    }
    // Of the mesh alone the largest error is half a facet, 1.1 degrees; the points' normals are exact.
    EXPECT_LE(joined.mean, 0.5);
    // (Measured: 2 pixels of 3,773; with plain instead of area weights in the pull 3, so that those are not the cause.)
    EXPECT_LE(joined.through, 2u);
    // The control: without points at the border, where one is missing beside it, the far side shows.
    EXPECT_GT(apart.through, 10 * joined.through);
}

TEST(MeshImages, WhatCannotBeSimplifiedIsPointsFromAfar) {
    // Many small separate leaves: as a surface they cannot be simplified.
    scene::Scene scene;
    scene.meshes.resize(1);
    scene::Primitive leaves;
    Rng rng(2);
    for (uint32_t k = 0; k < 20'000; ++k) {
        glm::vec3 c(1);
        while (glm::length(c) > 1) c = glm::vec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
        const glm::vec3 n = glm::normalize(glm::vec3(rng.normal(), rng.normal(), rng.normal()));
        const glm::vec3 a = glm::normalize(glm::cross(n, glm::vec3(n.y, n.z, -n.x))) * 0.02f, b = glm::cross(n, a);
        for (const glm::vec3& corner : {c - a - b, c + a - b, c + a + b, c - a + b}) {
            leaves.position.push_back(corner);
            leaves.normal.push_back(n);
        }
        for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) leaves.indices.push_back(4 * k + i);
    }
    scene.meshes[0].primitives.push_back(leaves);
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Progress progress(false);
    lod::MeshBuildSettings settings;
    settings.description.materials = scene::surfaceMaterials(scene);
    settings.description.up = {0, 1, 0};
    ASSERT_TRUE(lod::buildMeshStore(scene::triangleSource(scene, scene::placements(scene)), folder / "a.stipple",
                                    settings, *executor, progress));
    lod::BuildSettings points;
    points.open = [&](const std::string&, const lod::ReadOptions&) {
        return scene::sampleSurfels(scene, {}, {100'000});
    };
    test::spit(folder / "scene", "x");
    ASSERT_TRUE(lod::buildStore({folder / "scene"}, folder / "b.stipple", points, *executor, progress));
    const auto mesh = std::make_shared<const lod::Store>(*lod::openStore(folder / "a.stipple")),
               afar = std::make_shared<const lod::Store>(*lod::openStore(folder / "b.stipple"));
    const auto error = lod::largestLeafRadius(*afar);
    ASSERT_TRUE(error);
    EXPECT_GT(*error, 0.005);
    EXPECT_LT(*error, 0.2);
    const auto proxies = std::make_shared<const std::vector<render::Proxy>>(std::vector{render::Proxy{afar, *error}});
    const auto backend = cpu::makeCpuBackend(*executor);
    scene::Camera camera;
    camera.up = {0, 1, 0};
    for (const double distance : {3.0, 600.0}) {
        camera.eye = {0, 0, distance};
        const lod::View view = scene::makeView(camera, 320, 240, 0.01);
        FrameCounters with, without;
        render::FrameSettings frame;
        frame.draw.lit = true;
        const render::Image a = draw({{mesh, {}, {}, proxies}}, *backend, *executor, view, frame, &with);
        const render::Image b = draw({{mesh, {}, {}}}, *backend, *executor, view, frame, &without);
        EXPECT_EQ(without.trianglesDrawn, 40'000u);
        if (distance < 10) {
            EXPECT_EQ(with.proxies, 0u);
            EXPECT_EQ(a.rgba, b.rgba);
        } else {
            EXPECT_EQ(with.proxies, 1u);
            EXPECT_EQ(with.trianglesDrawn, 0u);
            EXPECT_GT(with.recordsDrawn, 0u);
            EXPECT_LT(with.recordsDrawn, 40'000u);
        }
    }
}

}  // namespace
}  // namespace stipple
