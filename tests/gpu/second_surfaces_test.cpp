// Mode ewa on the gpu: the passes of second surfaces run where a front ends before another surface, and have no group
// to run where none does.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/gpu/gpu_backend.h"
#include "shaders/shared/bindings.h"
#include "tests/gpu/one_time_commands.h"
#include "tests/support/support.h"

namespace stipple::gpu {
namespace {

using Counts = std::array<shared::GroupCounts, shared::kGroupShapes>;

/// A square of points about the axis, to `half` each way.
std::vector<test::TestPoint> square(double half, double height, uint32_t colour) {
    std::vector<test::TestPoint> points;
    for (double y = -half; y <= half; y += 0.01)
        for (double x = -half; x <= half; x += 0.01) points.push_back({{x, y, height}, {0, 0, 1}, colour});
    return points;
}

TEST(SecondSurfaces, HaveNoGroupsWhereThereAreNone) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "wall.ply", square(1, 0, 0x00ff00u));
    test::writePly(folder / "leaf.ply", square(0.2, 0.5, 0x0000ffu));
    const auto wall = test::buildAndOpen(folder / "wall.ply", folder / "wall.stipple", *executor);
    const auto leaf = test::buildAndOpen(folder / "leaf.ply", folder / "leaf.stipple", *executor);
    auto made = Device::create({"", true, {}, {}});
    ASSERT_TRUE(made);
    const std::shared_ptr<Device> device = std::move(*made);
    auto backend = makeGpuBackendOn(device);
    ASSERT_TRUE(backend);
    lod::View view = test::viewFromAbove({0, 0, 0});  // the wall fills the picture
    view.width = view.height = 200;
    view.focalPixels = 450;
    render::FrameSettings settings = test::drawnAs(render::Mode::ewa, 1e-4, false);
    settings.staysOnDevice = true;
    // Twice: what a frame has counted is not the next one's.
    for (const bool hasLeaf : {false, true, false}) {
        auto state = hasLeaf ? render::makeFrameState({wall, leaf}, **backend, *executor, {})
                             : render::makeFrameState({wall}, **backend, *executor, {});
        for (const bool isLooked : {false, true}) {
            ASSERT_TRUE(isLooked ? render::renderResident(*state, view, settings).has_value()
                                 : render::renderUntilComplete(*state, view, settings).has_value());
        }
        ASSERT_TRUE(state->onDevice);
        const auto counts = secondGroupsOf(**backend, *state->onDevice);
        ASSERT_TRUE(counts);
        ASSERT_TRUE((*backend)->finish(*state->onDevice));
        Counts found{};
        copyCounts(*counts, found.data(), sizeof found);
        for (const shared::GroupCounts& c : found) {
            EXPECT_GT(c.x * c.y, 0u);
            EXPECT_EQ(c.z, hasLeaf ? 1u : 0u) << "a leaf: " << hasLeaf;
        }
    }
    for (const std::string& message : device->messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace stipple::gpu
