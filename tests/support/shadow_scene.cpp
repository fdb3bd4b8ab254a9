#include "tests/support/shadow_scene.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/scene/camera.h"
#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_build.h"

namespace stipple::test::shadows {

using glm::dvec3;

namespace {

void addBall(scene::Primitive& mesh) {
    constexpr uint32_t kAround = 128, kUp = 64;
    for (uint32_t j = 0; j <= kUp; ++j)
        for (uint32_t i = 0; i <= kAround; ++i) {
            const double a = 2 * M_PI * i / kAround, b = M_PI * j / kUp;
            const dvec3 n(std::cos(a) * std::sin(b), std::sin(a) * std::sin(b), std::cos(b));
            mesh.position.emplace_back(kBall + kRadius * n);
            mesh.normal.emplace_back(n);
            if (i == 0 || j == 0) continue;
            const auto d = static_cast<uint32_t>(mesh.position.size() - 1), c = d - 1, up = d - (kAround + 1);
            for (const uint32_t k : {up - 1, up, d, up - 1, d, c}) mesh.indices.push_back(k);
        }
}

}  // namespace

std::vector<TestPoint> floorAndBall(bool hasBall, double lower) {
    std::vector<TestPoint> points;
    constexpr int kAcross = 200;
    for (int y = 0; y < kAcross; ++y)
        for (int x = 0; x < kAcross; ++x)
            points.push_back(
                {{4 * (x + 0.5) / kAcross - 2, 4 * (y + 0.5) / kAcross - 2, 0}, {0, 0, 1}, 0xc0c0c0, 0.02f});
    constexpr size_t kBallPoints = 15'000;
    for (size_t i = 0; hasBall && i < kBallPoints; ++i) {
        const double z = 1 - (2 * static_cast<double>(i) + 1) / kBallPoints,
                     a = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
        const dvec3 n(r * std::cos(a), r * std::sin(a), z);
        points.push_back({kBall - dvec3(0, 0, lower) + kRadius * n, glm::vec3(n), 0x4080c0, 0.02f});
    }
    return points;
}

std::shared_ptr<const lod::Store> triangles(const std::string& path, Executor& executor) {
    scene::Scene scene;
    scene.path = "floor";
    scene::Primitive mesh;
    addBall(mesh);
    const auto first = static_cast<uint32_t>(mesh.position.size());
    for (const dvec3 p : {dvec3(-2, -2, 0), dvec3(2, -2, 0), dvec3(2, 2, 0), dvec3(-2, 2, 0)}) {
        mesh.position.emplace_back(p);
        mesh.normal.emplace_back(0, 0, 1);
    }
    for (const uint32_t k : {0u, 1u, 2u, 0u, 2u, 3u}) mesh.indices.push_back(first + k);
    mesh.material = 0;
    scene.materials.resize(1);
    scene.materials[0].isDoubleSided = true;
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {std::move(mesh)};
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(scene);
    Progress silent(false);
    EXPECT_TRUE(
        lod::buildMeshStore(scene::triangleSource(scene, scene::placements(scene)), path, build, executor, silent));
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

lod::View viewOf(bool isOrthographic, const dvec3& eye) {
    scene::Camera camera;
    camera.eye = eye;
    camera.target = {-0.3, -0.1, 0.2};
    camera.up = {0, 0, 1};
    camera.fovDegrees = 45;
    lod::View view = scene::makeView(camera, 256, 192, 1e-3);
    if (isOrthographic) {
        view.isOrthographic = true;
        view.focalPixels /= 4.5;
    }
    return view;
}

render::WorldLight sun(float size) {
    render::WorldLight light;
    light.kind = shared::kLightDirectional;
    light.direction = -kTowardsSun;
    light.colour = glm::vec3(2.3f);
    light.castsShadow = true;
    light.size = size;
    return light;
}
render::WorldLight spot() {
    render::WorldLight light;
    light.kind = shared::kLightSpot;
    light.position = kBall + 3.0 * kTowardsSun;
    light.direction = -kTowardsSun;
    light.colour = glm::vec3(25);
    light.innerCone = 0.45f;
    light.outerCone = 0.5f;
    light.castsShadow = true;
    return light;
}

render::FrameSettings under(const render::WorldLight& light, render::Mode mode) {
    render::FrameSettings settings;
    settings.mode = mode;
    settings.draw.lit = true;
    settings.draw.lights = {light};
    settings.draw.effects.emplace_back("shadow");
    settings.draw.parameters.shadow.texels = 256;
    settings.budgets.errorPixels = 0.5;
    settings.wantDepthAndNormal = true;
    return settings;
}

std::unique_ptr<render::FrameState> drawn(const std::shared_ptr<const lod::Store>& store, render::Backend& backend,
                                          Executor& executor, const lod::View& view,
                                          const render::FrameSettings& settings) {
    auto state = render::makeFrameState({store}, backend, executor, {});
    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
    return state;
}

Mask maskOf(const std::shared_ptr<const lod::Store>& store, render::Backend& backend, Executor& executor,
            const lod::View& view, render::FrameSettings settings) {
    Mask mask;
    mask.state = drawn(store, backend, executor, view, settings);
    settings.draw.lights[0].castsShadow = false;
    const auto open = drawn(store, backend, executor, view, settings);
    settings.draw.lights[0].colour = glm::vec3(0);
    const auto dark = drawn(store, backend, executor, view, settings);
    for (size_t i = 0; i < open->image.depth.size(); ++i) {
        const double all = double{open->image.linear[3 * i]} - double{dark->image.linear[3 * i]};
        mask.share.push_back(
            all > 1e-3 ? (double{mask.state->image.linear[3 * i]} - double{dark->image.linear[3 * i]}) / all : -1);
    }
    return mask;
}

dvec3 placeOf(const lod::View& view, size_t i, double depth) {
    const double x = (double(i % view.width) + 0.5 - 0.5 * view.width) / view.focalPixels,
                 y = (double(i / view.width) + 0.5 - 0.5 * view.height) / view.focalPixels;
    return view.isOrthographic ? view.eye + view.right * x + view.down * y + view.forward * depth
                               : view.eye + depth * (view.right * x + view.down * y + view.forward);
}

}  // namespace stipple::test::shadows
