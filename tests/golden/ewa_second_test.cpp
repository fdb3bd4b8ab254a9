// Mode ewa where one surface ends before another: both are seen, each by what it covers, whichever kind the one behind
// is of. The truth: 64 rays a pixel against discs.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "engine/scene/triangles.h"
#include "tests/support/backends_here.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;

constexpr uint32_t kSize = 300;
constexpr double kLeafDepth = 2.5, kWallDepth = 3;

std::shared_ptr<const lod::Store> opened(const std::string& path) {
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}
lod::View fromAbove() {
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.width = view.height = kSize;
    view.focalPixels = 0.45 * kSize * kLeafDepth;
    return view;
}
render::Image drawn(const std::vector<render::PlacedStore>& placed, render::Backend& backend, Executor& executor,
                    render::FrameSettings settings, const lod::View& view) {
    settings.draw.background = {0, 0, 1};
    return test::draw(placed, backend, executor, view, settings);
}

/// A red leaf, round, half a unit before a green wall.
class EwaSecond : public test::BackendsHere {
  protected:
    void SetUp() override {
        test::BackendsHere::SetUp();
        Rng rng(3);
        std::vector<test::TestPoint> leaf, wall;
        for (int y = -100; y <= 100; ++y)
            for (int x = -100; x <= 100; ++x) {
                const dvec2 jitter(rng.uniform(-0.002, 0.002), rng.uniform(-0.002, 0.002));
                wall.push_back({dvec3(0.01 * dvec2(x, y) + jitter, 0), {0, 0, 1}, 0x00ff00u});
                if (x * x + y * y > 1600) continue;
                leaf.push_back({dvec3(0.01 * dvec2(x, y) + jitter, 0.5), {0, 0, 1}, 0x0000ffu});
            }
        test::writePly(folder_ / "leaf.ply", leaf);
        test::writePly(folder_ / "wall.ply", wall);
        leaf_ = test::buildAndOpen(folder_ / "leaf.ply", folder_ / "leaf.stipple", *executor_);
        wall_ = test::buildAndOpen(folder_ / "wall.ply", folder_ / "wall.stipple", *executor_);
        scene::Scene square;
        scene::Primitive mesh;
        mesh.position = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
        mesh.normal.assign(4, {0, 0, 1});
        mesh.indices = {0, 1, 2, 0, 2, 3};
        mesh.material = 0;
        square.materials.resize(1);
        square.materials[0].baseColour = {0, 1, 0, 1};
        square.materials[0].isUnlit = true;
        square.meshes.resize(1);
        square.meshes[0].primitives = {mesh};
        square.nodes.resize(1);
        square.nodes[0].mesh = 0;
        lod::MeshBuildSettings build;
        build.description.materials = scene::surfaceMaterials(square);
        Progress silent(false);
        ASSERT_TRUE(lod::buildMeshStore(scene::triangleSource(square, scene::placements(square)),
                                        folder_ / "square.stipple", build, *executor_, silent));
        triangles_ = opened(folder_ / "square.stipple");
        // How much of each pixel the leaf covers.
        lod::View fine = fromAbove();
        fine.width = fine.height = 8 * kSize;
        fine.focalPixels *= 8;
        const test::RayHits hits = test::hitDiscs(test::leafDiscs(*leaf_), fine, 0.01);
        share_.assign(size_t{kSize} * kSize, 0);
        for (size_t i = 0; i < hits.depths.size(); ++i)
            share_[i / fine.width / 8 * kSize + i % fine.width / 8] += hits.isCovered(i) ? 1.0 / 64 : 0;
    }
    /// Of pixels that the leaf shares with what is behind it: rms of how far its share of the colour is off, over that
    /// of a picture in which the leaf is all or nothing; and how many of them show any of the sky.
    struct Rim {
        double rms = 0;
        size_t pixels = 0, sky = 0, farOff = 0;
    };
    Rim rimOf(const render::Image& image) const {
        Rim rim;
        for (size_t i = 0; i < share_.size(); ++i) {
            if (share_[i] <= 0 || share_[i] >= 1) continue;
            const double off = double{image.linear[3 * i]} - share_[i];
            rim.rms += off * off;
            rim.sky += image.linear[3 * i + 2] > 1e-6f;
            // Depth is that of one of the two.
            const double depth = image.depth[i];
            rim.farOff += std::min(std::abs(depth - kLeafDepth), std::abs(depth - kWallDepth)) > 0.02;
            ++rim.pixels;
        }
        rim.rms = std::sqrt(rim.rms / static_cast<double>(rim.pixels));
        return rim;
    }

    std::shared_ptr<const lod::Store> leaf_, wall_, triangles_;
    std::vector<double> share_;
};

TEST_F(EwaSecond, RimsAreAsSoftBeforeAWallAsBeforeTheSky) {
    const render::FrameSettings ewa = test::drawnAs(render::Mode::ewa, 1e-4, false);
    for (auto& [name, backend] : backends_) {
        const auto rim = [&](std::vector<render::PlacedStore> placed, render::Mode mode) {
            render::FrameSettings settings = ewa;
            settings.mode = mode;
            return rimOf(drawn(placed, *backend, *executor_, settings, fromAbove()));
        };
        const Rim sky = rim({{leaf_, {}, {}}}, render::Mode::ewa),
                  wall = rim({{wall_, {}, {}}, {leaf_, {}, {}}}, render::Mode::ewa),
                  mesh = rim({{triangles_, {}, {}}, {leaf_, {}, {}}}, render::Mode::ewa),
                  splat = rim({{wall_, {}, {}}, {leaf_, {}, {}}}, render::Mode::splat);
        std::printf("%-7s rms of %zu pixels: sky %.3f, wall %.3f, triangles %.3f; splat %.3f; depths off %zu %zu\n",
                    name.c_str(), sky.pixels, sky.rms, wall.rms, mesh.rms, splat.rms, wall.farOff, mesh.farOff);
        EXPECT_GT(sky.pixels, 300u);
        EXPECT_GT(sky.sky, sky.pixels / 2) << "the control";
        EXPECT_LE(wall.rms, 1.1 * sky.rms) << name;
        EXPECT_LE(mesh.rms, 1.1 * sky.rms) << name;
        EXPECT_EQ(wall.sky + mesh.sky, 0u) << name;
        EXPECT_EQ(wall.farOff + mesh.farOff, 0u) << name << ": a depth between both";
    }
}

}  // namespace
}  // namespace stipple
