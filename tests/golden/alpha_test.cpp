// Textures with holes: from afar as much of them is seen as from near by, however thin it is.
#include <gtest/gtest.h>

#include "engine/cpu/cpu_backend.h"
#include "engine/scene/camera.h"
#include "engine/scene/triangles.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

/// A square of edge 2 in the plane z = 0 with a texture of 1024 x 1024 of which thin lines are seen, a share of 1/10.
std::shared_ptr<const lod::Store> net(const std::string& path, Executor& executor) {
    scene::Scene scene;
    scene::Primitive square;
    square.position = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    square.normal.assign(4, {0, 0, 1});
    square.uv = {{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};
    square.indices = {0, 1, 2, 0, 2, 3};
    square.material = 0;
    scene::Mesh mesh;
    mesh.primitives = {square};
    scene.meshes = {mesh};
    scene::Node node;
    node.mesh = 0;
    scene.nodes = {node};
    scene::Material material;
    material.alphaMode = scene::AlphaMode::mask;
    material.baseColourTexture.texture = 0;
    scene.materials = {material};
    scene.textures.resize(1);
    scene.textures[0].image = 0;
    scene.images.resize(1);
    lod::MeshBuildSettings settings;
    settings.description.materials = scene::surfaceMaterials(scene);
    lod::TextureImage image;
    image.width = image.height = 1024;
    for (uint32_t y = 0; y < 1024; ++y)
        for (uint32_t x = 0; x < 1024; ++x) image.rgba.push_back((x % 40 < 4 ? 0xff000000u : 0u) | 0x40a0c0u);
    settings.textures = {image};
    Progress progress(false);
    auto source = lod::sourceOf(test::collect(scene::triangleSource(scene, scene::placements(scene))));
    EXPECT_TRUE(lod::buildMeshStore(std::move(source), path, settings, executor, progress));
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

TEST(Holes, AreAsLargeAPartFromAfarAsFromNearBy) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(1);
    const auto store = net(folder / "net.stipple", *executor);
    const auto backend = cpu::makeCpuBackend(*executor);
    for (const uint32_t size : {1024u, 512u, 256u, 128u, 64u, 32u}) {
        scene::Camera camera;
        camera.eye = {0, 0, 5};
        camera.target = {0, 0, 0};
        camera.orthoWidth = 2;
        const lod::View view = scene::makeView(camera, size, size, 1e-3);
        const render::Image image = test::renderView(store, *backend, *executor, view, {});
        size_t seen = 0;
        for (const uint32_t c : image.rgba) seen += c >> 24 != 0;
        const double share = static_cast<double>(seen) / (double(size) * size);
        std::printf("%4u pixels a side: %.4f seen of 0.1\n", size, share);
        // (Between texels alpha is interpolated: one that is seen alone looks smaller than it is.)
        EXPECT_GE(share, 0.06) << size;
        EXPECT_LE(share, 0.14) << size;
    }
}

}  // namespace
}  // namespace stipple
