// Mode ewa where one surface ends before another: both are seen, each by what it covers, whichever kind the one behind
// is of. The truth: 64 rays a pixel against discs.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "engine/scene/surfels.h"
#include "engine/scene/triangles.h"
#include "shaders/shared/border.h"
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

/// Triangles (red) that go on as points, whose border's records are of another colour (green, as the points): within
/// the triangles that fades in the width of a kernel. The control: the same records, not told as a border's, are not
/// seen on triangles at all.
TEST_F(EwaSecond, BordersBlendWithTheTrianglesThatTheyStandOn) {
    constexpr double kSpacing = 0.01;
    scene::Scene green;
    scene::Primitive mesh, cloud;
    mesh.position = {{-0.6f, -0.6f, 0}, {0, -0.6f, 0}, {0, 0.6f, 0}, {-0.6f, 0.6f, 0}};
    mesh.normal.assign(4, {0, 0, 1});
    mesh.indices = {0, 1, 2, 0, 2, 3};
    mesh.material = 0;
    cloud.kind = scene::PrimitiveKind::points;
    cloud.material = 0;
    for (int y = -60; y < 60; ++y)
        for (int x = 1; x < 60; ++x) {
            cloud.indices.push_back(static_cast<uint32_t>(cloud.position.size()));
            cloud.position.emplace_back(kSpacing * x, kSpacing * y, 0);
            cloud.normal.emplace_back(0, 0, 1);
        }
    green.materials.resize(1);
    green.materials[0].baseColour = {0, 1, 0, 1};
    green.materials[0].isUnlit = true;
    green.meshes.resize(1);
    green.meshes[0].primitives = {mesh, cloud};
    green.nodes.resize(1);
    green.nodes[0].mesh = 0;
    scene::Scene red = green;
    red.materials[0].baseColour = {1, 0, 0, 1};
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(red);
    Progress silent(false);
    ASSERT_TRUE(lod::buildMeshStore(scene::triangleSource(red, scene::placements(red)), folder_ / "red.stipple", build,
                                    *executor_, silent));
    const auto points = [&](bool isFlagged) {
        lod::BuildSettings settings;
        settings.open = [&](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> {
            auto source = scene::sampleSurfels(green, {}, {0});
            if (!source || isFlagged) return source;
            source->openPart = [openPart = source->openPart](uint32_t part) {
                auto read = openPart(part);
                if (read)
                    *read = [next = *read](lod::PointBlock& block, size_t most) {
                        auto count = next(block, most);
                        for (uint32_t& c : block.colour) c &= ~(shared::kFlagBorder << 24);
                        return count;
                    };
                return read;
            };
            return source;
        };
        const std::string path = folder_ / (isFlagged ? "flagged.stipple" : "plain.stipple");
        EXPECT_TRUE(lod::buildStore({"points"}, path, settings, *executor_, silent));
        return opened(path);
    };
    const auto triangles = opened(folder_ / "red.stipple"), flagged = points(true), plain = points(false);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.width = view.height = 201;
    view.focalPixels = 1500;  // five pixels a spacing
    for (auto& [name, backend] : backends_)
        for (const bool isFlagged : {true, false}) {
            const render::Image image = drawn({{triangles, {}, {}}, {isFlagged ? flagged : plain, {}, {}}}, *backend,
                                              *executor_, test::drawnAs(render::Mode::ewa, 1e-4, false), view);
            // Of rows, the mean share of red from left to right; depth is the plane's.
            std::vector<double> share(view.width, 0);
            for (size_t i = 0; i < image.rgba.size(); ++i) {
                share[i % view.width] += double{image.linear[3 * i]} / view.height;
                ASSERT_NEAR(image.depth[i], 3, 1e-3) << name;
                ASSERT_EQ(image.linear[3 * i + 2], 0) << name << ": the sky";
            }
            double step = 0, most = 0;
            for (size_t x = 1; x < share.size(); ++x) step = std::max(step, std::abs(share[x] - share[x - 1]));
            for (size_t x = 0; x < 90; ++x) most = std::max(most, 1 - share[x]);
            std::printf("%-7s %s: largest step between columns %.2f, green farther in %.3f\n", name.c_str(),
                        isFlagged ? "border" : "control", step, most);
            EXPECT_LT(most, 0.002) << name << ": two spacings in there is nothing of them";
            if (isFlagged) EXPECT_LT(step, 0.5) << name;
            if (!isFlagged) EXPECT_GT(step, 0.95) << name;
        }
}

}  // namespace
}  // namespace stipple
