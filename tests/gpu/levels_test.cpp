// Levels of the pyramid whose texels are larger than the largest splat have no group to run.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "engine/gpu/gpu_backend.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/pyramid_tail.h"
#include "tests/gpu/one_time_commands.h"
#include "tests/support/support.h"

namespace stipple::gpu {
namespace {

/// As StatsBlock in shaders/bindings.glsl.
struct Stats {
    float largestRadius = 0;
    std::array<shared::GroupCounts, 2 * shared::kPyramidLevels> groups{};  ///< of pull, of push
};

TEST(Levels, WithoutTexelsHaveNoGroups) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(4'000, 1));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    auto made = Device::create({"", true, {}, {}});
    ASSERT_TRUE(made);
    const std::shared_ptr<Device> device = std::move(*made);
    auto backend = makeGpuBackendOn(device);
    ASSERT_TRUE(backend);
    render::FrameSettings settings = test::drawnAs(render::Mode::pullpush, 1e-4, false);
    settings.staysOnDevice = true;
    auto state = render::makeFrameState({store}, **backend, *executor, {});
    std::vector<uint32_t> most;  // levels that are pulled, of each view
    for (const double nearer : {-3.0, 0.0, -30.0, 0.0}) {
        lod::View view = test::fitView(*store, 643, 357);
        view.eye += view.forward * (nearer * glm::length(view.eye));
        for (const bool isLooked : {false, true})
            ASSERT_TRUE(isLooked ? render::renderResident(*state, view, settings).has_value()
                                 : render::renderUntilComplete(*state, view, settings).has_value());
        ASSERT_TRUE(state->onDevice);
        const auto counts = levelGroupsOf(**backend, *state->onDevice);
        ASSERT_TRUE(counts);
        ASSERT_TRUE((*backend)->finish(*state->onDevice));
        Stats stats;
        copyCounts(*counts, &stats, sizeof stats);
        ASSERT_GT(stats.largestRadius, 0) << nearer;
        const auto levels = 1u + static_cast<uint32_t>(std::ceil(std::log2(std::max(2.0f, 2 * stats.largestRadius))));
        most.push_back(levels);
        uint32_t width = view.width, height = view.height;
        for (uint32_t l = 0; l < shared::kPyramidLevels; ++l) {
            const auto tiles = [](uint32_t texels) { return (texels + shared::kLevelTile - 1) / shared::kLevelTile; };
            for (const uint32_t half : {0u, 1u}) {
                const shared::GroupCounts& c = stats.groups.at(half * shared::kPyramidLevels + l);
                EXPECT_EQ(c.x, tiles(width)) << nearer << ", level " << l;
                EXPECT_EQ(c.y, tiles(height)) << nearer << ", level " << l;
                // Pushing begins at the level before the coarsest.
                EXPECT_EQ(c.z, l + half < levels ? 1u : 0u) << nearer << ", level " << l << (half ? ", pushed" : "");
            }
            width = (width + 1) / 2;
            height = (height + 1) / 2;
        }
    }
    EXPECT_LT(most[2], most[0]);
    EXPECT_LT(most[0], most[1]);
    EXPECT_EQ(most[1], most[3]) << "what a frame has counted is not the next one's";
    EXPECT_LT(most[1], 9u) << "some levels of this picture are empty";
    for (const std::string& message : device->messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace stipple::gpu
