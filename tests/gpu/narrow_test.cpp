// Edge functions of narrow triangles have 32 bits, of others 64 (isNarrow in shaders/mesh.glsl): triangles just below,
// at and above 64 pixels, and far beyond, have the pixels and depths of the oracle.
#include <gtest/gtest.h>

#include <cmath>

#include "lod/builder/mesh/mesh_build.h"
#include "tests/support/against_oracle.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

constexpr int kSteps = 256, kLimit = 64 * kSteps;  // of a pixel; where 32 bits end
constexpr uint32_t kCell = 260, kAcross = 4, kSize = kCell * kAcross;

using NarrowTriangles = test::AgainstOracle;

/// Corners on 256ths of a pixel of a picture of one pixel a unit; so long along one axis and no longer along the other.
void addTriangle(Rng& rng, int length, glm::dvec2 corner, lod::TriangleMesh& mesh) {
    // Half of them such that edges pass through centres of pixels.
    const uint32_t step = rng.below(2) == 0 ? 1 : kSteps / 2;
    const auto any = [&] { return static_cast<double>(rng.below(static_cast<uint32_t>(length) / step + 1) * step); };
    std::array<glm::dvec2, 3> places{{{0, any()}, {length, any()}, {any(), any()}}};
    const bool isUpright = rng.below(2) == 1, isTurned = rng.below(2) == 1;
    if (isTurned) std::swap(places[0], places[1]);
    // (So flat that where corners are rounded to matters little.)
    const glm::dvec3 plane(rng.uniform(-1e-3, 1e-3), rng.uniform(-1e-3, 1e-3), rng.uniform(-1, 1));
    for (glm::dvec2 p : places) {
        if (isUpright) std::swap(p.x, p.y);
        p = (p + 0.3) / double{kSteps} + corner - 0.5 * kSize;  // (the store's places are finer than 0.3)
        mesh.indices.push_back(static_cast<uint32_t>(mesh.position.size()));
        mesh.position.emplace_back(p.x, -p.y, plane.z + plane.x * p.x + plane.y * p.y);
        mesh.normal.emplace_back(0, 0, 1);
        mesh.uv.emplace_back(0, 0);
        mesh.colour.push_back(0xff000000u | static_cast<uint32_t>(rng.below(1u << 24)));
        mesh.surface.push_back(shared::kSurfaceTwoSided);
    }
}

TEST_F(NarrowTriangles, AndThoseThatAreNotHaveThePixelsOfTheOracle) {
    constexpr std::array kLengths{kLimit - 2,     kLimit - 1,      kLimit,         kLimit + 1,
                                  kLimit + 2,     kLimit - kSteps, kLimit / 4,     kLimit + kSteps,
                                  2 * kLimit - 1, 2 * kLimit,      2 * kLimit + 1, kLimit / 2,
                                  3 * kLimit,     3 * kLimit + 7,  kLimit - 1,     kLimit};
    static_assert(kLengths.size() == kAcross * kAcross && 3 * 64 + 1 < kCell);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.isOrthographic = true;
    view.focalPixels = 1;
    view.width = view.height = kSize;
    for (const uint64_t seed : {1u, 2u, 3u}) {
        Rng rng(seed);
        lod::TriangleMesh mesh;
        for (uint32_t i = 0; i < kLengths.size(); ++i)
            addTriangle(rng, kLengths.at(i), {i % kAcross * kCell + 20, i / kAcross * kCell + 20}, mesh);
        lod::MeshBuildSettings build;
        shared::SurfaceMaterial material{};
        material.baseColour = {1, 1, 1};
        material.alpha = 1;
        build.description.materials = {material};
        Progress silent(false);
        const std::string path = folder_ / "a.stipple";
        ASSERT_TRUE(lod::buildMeshStore(lod::sourceOf(std::move(mesh)), path, build, *executor_, silent));
        auto opened = lod::openStore(path);
        ASSERT_TRUE(opened);
        const auto store = std::make_shared<const lod::Store>(std::move(*opened));
        const render::FrameSettings settings = test::drawnAs(render::Mode::surface, 1e-4, false);
        const render::Image expected = test::renderView(store, *oracle_, *executor_, view, settings),
                            image = test::renderView(store, usual(), *executor_, view, settings);
        std::vector<size_t> drawn(kLengths.size()), other(kLengths.size()), farOff(kLengths.size());
        for (size_t i = 0; i < expected.depth.size(); ++i) {
            const size_t cell = i / kSize / kCell * kAcross + i % kSize / kCell;
            drawn[cell] += expected.depth[i] > 0;
            other[cell] += (expected.depth[i] > 0) != (image.depth[i] > 0);
            farOff[cell] += std::abs(expected.depth[i] - image.depth[i]) > 1e-5f;
        }
        for (size_t cell = 0; cell < kLengths.size(); ++cell) {
            EXPECT_GT(drawn[cell], 4u) << kLengths.at(cell);
            EXPECT_EQ(other[cell], 0u) << kLengths.at(cell) << " 256ths of a pixel, seed " << seed;
            EXPECT_EQ(farOff[cell], 0u) << kLengths.at(cell) << " 256ths of a pixel, seed " << seed;
        }
    }
}

}  // namespace
}  // namespace stipple
