// Levels of detail that fade: in pictures that are means of frames, what a camera's approach switches is weighed by how
// many frames have it, so that nothing pops.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "apps/study/sweep/errors.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/render/accumulation.h"
#include "engine/scene/camera.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/forests.h"

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

Placed placed(const std::string& name, std::shared_ptr<const lod::Store> store, double distance, uint32_t size) {
    Placed p{name, {}, {}, test::lookAt(*store, 30, 25, distance, size)};
    p.stores.emplace_back();
    p.stores.back().store = std::move(store);
    return p;
}

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
        EXPECT_TRUE(render::expose(
            exposure, [&](double) { return view; }, settings, draw, state.image, *executor_));
        return state.image;
    }
    /// Where the cut is that of a camera one step farther away, and the camera is not: the most of four steps on end,
    /// as errors of records lie an eighth of an octave apart.
    double pop(const Placed& scene, const render::Exposure& exposure) {
        const auto backend = cpu::makeCpuBackend(*executor_);
        const auto state = render::makeFrameState(scene.stores, *backend, *executor_, {}, scene.groups);
        double most = 0, target = 1.0001;
        Image frame = drawn(*state, scene.view, target, exposure);
        for (int step = 0; step < 4; ++step) {
            target *= kStep;
            Image next = drawn(*state, scene.view, target, exposure);
            most = std::max(most, study::popOf(frame, next).p999);
            frame = std::move(next);
        }
        return most;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
};

/// Points of a statue whose colours are those of no neighbour, an oak of curves, and a forest whose trees are points
/// from afar.
std::vector<Placed> leafyScenes(const std::string& folder, Executor& executor) {
    std::vector<Placed> scenes;
    std::vector<test::TestPoint> points = test::samplesOf(test::Shape::statue, 40'000, 3);
    Rng rng(5);
    for (test::TestPoint& p : points) {
        p.colour = static_cast<uint32_t>(rng.next() & 0xffffffu);
        p.radius = static_cast<float>(test::spacingOf(test::Shape::statue, 40'000));
    }
    test::writePly(folder + "/a.ply", points, true, true);
    scenes.push_back(placed("points", test::buildAndOpen(folder + "/a.ply", folder + "/a.stipple", executor), 6, 160));
    scenes.push_back(placed("oak", test::buildCurves(test::oak(20'000), folder + "/c.stipple", executor), 1.5, 160));
    const test::Forest forest = test::plantForest(folder, 8, executor);
    for (const double distance : {60.0, 200.0}) {
        Placed p{fmt::format("forest from {} m", distance), forest.placed, forest.groups, {}};
        scene::Camera camera;
        camera.target = {28, 4, 28};
        camera.eye = camera.target + distance * glm::normalize(dvec3(0.3, 0.3, 0.9));
        camera.up = {0, 1, 0};
        p.view = scene::makeView(camera, 160, 160, 0.02);
        scenes.push_back(p);
    }
    return scenes;
}

TEST_F(Fading, NothingPopsInPicturesThatAreMeans) {
    for (const Placed& s : leafyScenes(folder_.path(), *executor_)) {
        const double frame = pop(s, {1, {}, 0}), unfaded = pop(s, {64, {}, 0}),
                     few = pop(s, {16, {}, 0, render::kFadeOctaves}), faded = pop(s, {64, {}, 0, render::kFadeOctaves});
        fmt::print("{}: {:.0f} of 255 of a frame, {:.0f} of 64 of one level, faded {:.0f} of 16, {:.0f} of 64\n",
                   s.name, frame, unfaded, few, faded);
        EXPECT_LE(faded, 8) << s.name;
        EXPECT_GT(frame, 16) << "the control: one frame";
        EXPECT_LT(faded, 0.5 * unfaded) << "the control: as many frames of one level";
        EXPECT_LT(few, frame);
    }
}

TEST_F(Fading, FramesHaveErrorsOfTheBandEvenlyAndNoneAboveWhatIsAskedFor) {
    const render::FrameSettings settings = test::drawnAs(render::Mode::surface, 3);
    for (const double octaves : {0.25, 0.5, 1.0}) {
        std::set<int> shares;
        for (uint32_t i = 0; i < 64; ++i) {
            const double down =
                std::log2(3 / render::settingsOf(settings, i, {64, {}, 0, octaves}).budgets.errorPixels);
            EXPECT_GT(down, 0);
            EXPECT_LT(down, octaves);
            shares.insert(static_cast<int>(64 * down / octaves));
        }
        EXPECT_EQ(shares.size(), 64u) << "one in each 64th of the band";
    }
    EXPECT_EQ(render::settingsOf(settings, 7, {64, {}, 0}).budgets.errorPixels, 3) << "without it: the same for all";
}

}  // namespace
}  // namespace stipple
