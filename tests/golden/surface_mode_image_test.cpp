// Mode surface against its restatement in fp64, where discs are wide: in perspective and parallel, with materials, on
// turned and scaled instances, among triangles, at every debug view.
#include <gtest/gtest.h>

#include "engine/reference/reference.h"
#include "lod/store/materials.h"
#include "tests/support/backends_here.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

class SurfaceModes : public test::BackendsHere {
  protected:
    void expectRestated(const std::vector<render::PlacedStore>& placed, const lod::View& view,
                        const render::FrameSettings& settings) {
        const auto oracle = reference::makeReferenceBackend(*executor_);
        const render::Image truth = test::draw(placed, *oracle, *executor_, view, settings);
        render::FrameSettings facets = settings;
        facets.mode = render::Mode::splat;
        const render::Image control = test::draw(placed, *oracle, *executor_, view, facets);
        for (auto& [name, backend] : backends_) {
            if (name == "fp64") continue;
            const render::Image image = test::draw(placed, *backend, *executor_, view, settings);
            const auto d = reference::compareImages(image, truth, 4, nullptr),
                       c = reference::compareImages(control, truth, 4, nullptr);
            ASSERT_TRUE(d && c);
            SCOPED_TRACE(testing::Message() << name << " debug " << settings.draw.debugView);
            EXPECT_GE(d->psnr, 50);
            EXPECT_LE(d->differingFraction, 0.001);
            if (settings.draw.debugView == shared::kDebugNone || settings.draw.debugView == shared::kDebugNormals)
                EXPECT_GE(c->differingFraction, 0.005) << "the control: discs as facets";
            size_t off = 0, drawn = 0;
            for (size_t i = 0; i < truth.depth.size(); ++i) {
                drawn += truth.depth[i] > 0;
                off += std::abs(truth.depth[i] - image.depth[i]) > 1e-3f * truth.depth[i];
            }
            EXPECT_GT(drawn, 10'000u);
            EXPECT_LE(off, drawn / 500) << "depths";
        }
    }
};

TEST_F(SurfaceModes, AreRestated) {
    test::writePly(folder_ / "a.ply", test::samplesOf(test::Shape::statue, 5'000, 3));
    const auto points = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    test::MeshRecipe rock;
    rock.grow.kind = "rock";
    rock.grow.triangles = 5'000;
    const auto mesh = test::growMeshStore(rock, folder_ / "b.stipple", *executor_);
    lod::Instance turned;
    turned.scale = 0.7;
    turned.rotation = glm::dmat3(0, 1, 0, 0, 0, 1, 1, 0, 0);
    turned.translation = {0.9, 0.6, 0.3};
    const std::vector<render::PlacedStore> placed{{points, {}, {}}, {points, turned, {}}, {mesh, {}, {}}};
    lod::View view = test::lookAt(*points, 30, 25, 0.8, 240);
    for (const bool isOrthographic : {false, true}) {
        if (isOrthographic) {
            view.isOrthographic = true;
            view.focalPixels /= glm::length(view.eye);
        }
        for (const uint32_t debug : {shared::kDebugNone, shared::kDebugNormals, shared::kDebugLevel}) {
            render::FrameSettings settings = test::drawnAs(render::Mode::surface);
            settings.draw.debugView = debug;
            expectRestated(placed, view, settings);
        }
        render::FrameSettings metal = test::drawnAs(render::Mode::surface);
        metal.draw.pointMaterial = lod::packed(lod::PointMaterial{0.4f, 1});
        expectRestated({{points, {}, {}}}, view, metal);
    }
}

// So near that some discs are wider than a texel holds.
TEST_F(SurfaceModes, AreRestatedFromNear) {
    test::writePly(folder_ / "a.ply", test::samplesOf(test::Shape::torus, 1'500, 3));
    const auto points = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    lod::View view = test::lookAt(*points, 30, 25, 0.8, 240);
    view.eye *= 0.55;
    expectRestated({{points, {}, {}}}, view, test::drawnAs(render::Mode::surface));
}

}  // namespace
}  // namespace stipple
