// Records on the border of triangles (shaders/shared/border.h; Marroquim, Kraus & Cavalcanti 2008, 5.2): what a picture
// shows where they lie on the triangles that they belong to. Mode ewa blends both within what surfaces may be rough;
// of the others, which do not blend, the nearest of both is seen (README of engine/render/reconstructions).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "engine/scene/camera.h"
#include "engine/scene/surfels.h"
#include "engine/scene/triangles.h"
#include "shaders/shared/border.h"
#include "tests/support/backends_here.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

constexpr double kSpacing = 0.01;

std::shared_ptr<const lod::Store> opened(const std::string& path) {
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

/// Triangles (red) up to x = 0 that go on as points (green); those of the border, which stand on the triangles' edge,
/// are green, too.
class Borders : public test::BackendsHere {
  protected:
    static scene::Scene planeOf(glm::vec4 colour) {
        scene::Scene plane;
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
        plane.materials.resize(1);
        plane.materials[0].baseColour = colour;
        plane.materials[0].isUnlit = true;
        plane.meshes.resize(1);
        plane.meshes[0].primitives = {mesh, cloud};
        plane.nodes.resize(1);
        plane.nodes[0].mesh = 0;
        return plane;
    }
    void SetUp() override {
        test::BackendsHere::SetUp();
        const scene::Scene red = planeOf({1, 0, 0, 1});
        lod::MeshBuildSettings build;
        build.description.materials = scene::surfaceMaterials(red);
        Progress silent(false);
        ASSERT_TRUE(lod::buildMeshStore(scene::triangleSource(red, scene::placements(red)), folder_ / "red.stipple",
                                        build, *executor_, silent));
        triangles_ = opened(folder_ / "red.stipple");
        flagged_ = points(true);
        plain_ = points(false);
    }
    /// `isFlagged`: else the same records, not told as a border's.
    std::shared_ptr<const lod::Store> points(bool isFlagged) {
        lod::BuildSettings settings;
        Progress silent(false);
        settings.open = [&](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> {
            auto source = scene::sampleSurfels(planeOf({0, 1, 0, 1}), {}, {0});
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
    }
    /// Five pixels a spacing, from straight above.
    static lod::View fromAbove() {
        lod::View view = test::viewFromAbove({0, 0, 0});
        view.width = view.height = 201;
        view.focalPixels = 1500;
        return view;
    }
    render::Image drawn(const std::vector<render::PlacedStore>& placed, render::Backend& backend, render::Mode mode,
                        const lod::View& view) {
        render::FrameSettings settings = test::drawnAs(mode, 1e-4, false);
        settings.draw.background = {0, 0, 1};
        return test::draw(placed, backend, *executor_, view, settings);
    }

    std::shared_ptr<const lod::Store> triangles_, flagged_, plain_;
};

/// Triangles (red) that go on as points, whose border's records are of another colour (green, as the points): within
/// the triangles that fades in the width of a kernel. The control: the same records, not told as a border's, are not
/// seen on triangles at all.
TEST_F(Borders, BlendWithTheTrianglesThatTheyStandOn) {
    const lod::View view = fromAbove();
    for (auto& [name, backend] : backends_)
        for (const bool isFlagged : {true, false}) {
            const render::Image image = drawn({{triangles_, {}, {}}, {isFlagged ? flagged_ : plain_, {}, {}}}, *backend,
                                              render::Mode::ewa, view);
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

/// Of pixels that a picture of the triangles alone and one of the points alone both show.
struct Shared {
    size_t pixels = 0, points = 0, notNearest = 0;
};
Shared sharedOf(const render::Image& both, const render::Image& triangles, const render::Image& points) {
    Shared s;
    for (size_t i = 0; i < both.rgba.size(); ++i) {
        if (!(triangles.depth[i] > 0) || !(points.depth[i] > 0)) continue;
        const bool isPoint = both.linear[3 * i + 1] > 0.5f;
        ++s.pixels;
        s.points += isPoint;
        // Of equals it is the point (visibility.h).
        s.notNearest += isPoint != (points.depth[i] <= triangles.depth[i]);
        s.notNearest += both.depth[i] != std::min(points.depth[i], triangles.depth[i]);
    }
    return s;
}

/// Modes that show one disc a pixel: the nearest of discs and triangles, whatever the flag says. The control: a tenth
/// of a spacing behind the triangles nothing of the points is seen on them, as far before them nothing else; and in ewa
/// the flag changes the picture.
TEST_F(Borders, LoseToWhatIsNearerWhereNothingIsBlended) {
    scene::Camera camera;
    camera.up = {0, 1, 0};
    camera.fovDegrees = 4;
    for (const auto& [name, backend] : backends_)
        for (const dvec3& eye : {dvec3(0, 0, 3), dvec3(2, -0.2, 2), dvec3(-2.7, 0.3, 1)}) {
            camera.eye = eye;
            const lod::View view = scene::makeView(camera, 201, 201, 1e-3);
            for (const render::Mode mode : {render::Mode::surface, render::Mode::splat, render::Mode::pullpushExact})
                for (const double ahead : {0.0, 0.1, -0.1}) {
                    SCOPED_TRACE(testing::Message() << name << " " << render::reconstructionOf(mode).name << " from "
                                                    << eye.x << ", points before triangles by " << ahead);
                    const auto placed = [&](const std::shared_ptr<const lod::Store>& store) {
                        render::PlacedStore at{store, {}, {}};
                        at.place.translation.z = ahead * kSpacing;
                        return at;
                    };
                    const render::PlacedStore mesh{triangles_, {}, {}}, points = placed(flagged_);
                    const render::Image both = drawn({mesh, points}, *backend, mode, view);
                    const Shared s =
                        sharedOf(both, drawn({mesh}, *backend, mode, view), drawn({points}, *backend, mode, view));
                    EXPECT_GT(s.pixels, 150u);
                    EXPECT_EQ(s.notNearest, 0u);
                    if (ahead != 0) EXPECT_EQ(s.points, ahead > 0 ? s.pixels : 0u);
                    EXPECT_EQ(both.rgba, drawn({mesh, placed(plain_)}, *backend, mode, view).rgba);
                    if (ahead == 0 && mode == render::Mode::splat)
                        std::printf("%-7s from (%g %g %g): %zu of %zu pixels on both show points\n", name.c_str(),
                                    eye.x, eye.y, eye.z, s.points, s.pixels);
                }
            EXPECT_NE(drawn({{triangles_, {}, {}}, {flagged_, {}, {}}}, *backend, render::Mode::ewa, view).rgba,
                      drawn({{triangles_, {}, {}}, {plain_, {}, {}}}, *backend, render::Mode::ewa, view).rgba)
                << "the control";
        }
}

/// Pull and push fill what no exact surface is seen at: triangles keep their pixels, borders or not.
TEST_F(Borders, LeaveTrianglesTheirPixelsInPullPush) {
    const lod::View view = fromAbove();
    for (const auto& [name, backend] : backends_) {
        const auto of = [&](const std::vector<render::PlacedStore>& placed) {
            return drawn(placed, *backend, render::Mode::pullpush, view);
        };
        const render::PlacedStore mesh{triangles_, {}, {}}, points{flagged_, {}, {}};
        const render::Image both = of({mesh, points}), triangles = of({mesh});
        EXPECT_EQ(both.rgba, of({mesh, {plain_, {}, {}}}).rgba) << name;
        size_t red = 0, changed = 0;
        for (size_t i = 0; i < both.rgba.size(); ++i) {
            red += triangles.depth[i] > 0;
            changed += triangles.depth[i] > 0 && both.rgba[i] != triangles.rgba[i];
        }
        EXPECT_GT(red, 10'000u);
        EXPECT_EQ(changed, 0u) << name << ": of " << red;
        EXPECT_GT(sharedOf(both, triangles, of({points})).pixels, 300u) << "the control: points alone lie there, too";
    }
}

}  // namespace
}  // namespace stipple
