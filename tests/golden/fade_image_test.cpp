// Levels of detail that fade: in pictures that are means of frames, what a camera's approach switches is weighed by how
// many frames have it, so that nothing pops.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "apps/study/sweep/errors.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/render/accumulation.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec3;
using render::Image;

/// A step of the cut's own scale of allowed errors, as of a camera 2.2 % nearer.
const double kStep = std::exp2(1.0 / 32);

struct Placed {
    std::string name;
    std::vector<render::PlacedStore> stores;
    std::vector<render::PlacedGroup> groups;
    lod::View view;
};

class Fading : public testing::Test {
  protected:
    Image drawn(render::FrameState& state, const lod::View& view, double target, const render::Exposure& exposure) {
        render::FrameSettings settings = test::drawnAs(render::Mode::surface, target);
        settings.wantDepthAndNormal = true;
        EXPECT_TRUE(render::renderUntilComplete(state, view, settings));
        const auto draw = [&](const lod::View& seen, const render::FrameSettings& s) -> Result<void> {
            STIPPLE_TRY(render::renderUntilComplete(state, seen, s));
            return {};
        };
        EXPECT_TRUE(render::expose(exposure, [&](double) { return view; }, settings, draw, state.image, *executor_));
        return state.image;
    }
    study::Pop pop(const Placed& scene, const render::Exposure& exposure, double step = kStep) {
        const auto backend = cpu::makeCpuBackend(*executor_);
        const auto state = render::makeFrameState(scene.stores, *backend, *executor_, {}, scene.groups);
        const Image frame = drawn(*state, scene.view, 1, exposure);
        return study::popOf(frame, drawn(*state, scene.view, step * 1.0001, exposure));
    }
    static Placed one(const std::string& name, std::shared_ptr<const lod::Store> store, double distance, uint32_t size) {
        Placed p{name, {}, {}, test::lookAt(*store, 30, 25, distance, size)};
        p.stores.emplace_back();
        p.stores.back().store = std::move(store);
        return p;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
};

TEST_F(Fading, Measured) {
    std::vector<Placed> scenes;
    std::vector<test::TestPoint> points = test::samplesOf(test::Shape::statue, 40'000, 3);
    Rng rng(5);
    const auto spacing = static_cast<float>(test::spacingOf(test::Shape::statue, 40'000));
    for (test::TestPoint& p : points) p.colour = static_cast<uint32_t>(rng.next() & 0xffffffu), p.radius = spacing;
    test::writePly(folder_ / "a.ply", points, true, true);
    scenes.push_back(one("noise", test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_), 2, 160));
    scenes.push_back(one("oak", test::buildCurves(test::oak(20'000), folder_ / "c.stipple", *executor_), 1.5, 160));
    const test::Forest forest = test::plantForest(folder_.path(), 8, *executor_);
    for (const double far : {60.0, 200.0}) {
        Placed p{fmt::format("forest {}", far), forest.placed, forest.groups, {}};
        p.view.width = p.view.height = 160;
        p.view.focalPixels = 180;
        p.view.eye = dvec3(28, 0, 28) + far * glm::normalize(dvec3(0.3, 0.3, 0.9));
        const dvec3 f = glm::normalize(dvec3(28, 4, 28) - p.view.eye);
        p.view.forward = f;
        p.view.right = glm::normalize(glm::cross(f, dvec3(0, 1, 0)));
        p.view.down = glm::cross(f, p.view.right);
        scenes.push_back(p);
    }
    for (const Placed& s : scenes)
        for (const double step : {kStep, std::exp2(1.0 / 8)})
            for (const auto& e : {render::Exposure{1, {}, 0}, {16, {}, 0}, {16, {}, 0, 0.5}, {16, {}, 0, 1.0}, {64, {}, 0, 0.5}, {64, {}, 0, 1}}) {
                const study::Pop p = pop(s, e, step);
                fmt::print("{} step {:.3f} frames {} fade {}: {:.1f} most {}\n", s.name, step, e.samples, e.fade, p.p999, p.most);
                std::fflush(stdout);
            }
}

}  // namespace
}  // namespace stipple
