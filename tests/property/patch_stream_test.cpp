// A camera path through a store of patches: at every frame it stays within the bytes and the records that it was given,
// and what it shows hangs on neither what was drawn before nor, where all that is wanted fits, on the budget.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/patch_samples.h"
#include "tests/support/patch_cuts.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

constexpr int kFrames = 24;

class PatchStream : public testing::TestWithParam<uint32_t> {
  protected:
    void SetUp() override {
        lod::PatchBuildSettings settings;
        settings.leafTriangles = 1500;
        settings.description.materials.resize(1);
        Progress silent(false);
        const auto path = folder_ / "a.stipple";
        ASSERT_TRUE(lod::buildPatchStore(lod::sourceOf(test::wavyTorus(400, 160)), path, settings, *executor_, silent));
        store_ = std::make_shared<const lod::Store>(*lod::openStore(path));
        ASSERT_GE(store_->hierarchy.nodes.size(), 100u);
        settings_.budgets.errorPixels = 0.5;
        settings_.draw.lit = true;
        settings_.draw.patchAs = GetParam();
    }
    std::unique_ptr<render::FrameState> state(uint64_t residentBytes) {
        render::PlacedStore placed{store_, {}, {}};
        placed.patchesAreSamples = GetParam() == lod::kPatchesAsSamples;
        streaming::StreamSettings stream;
        stream.residentBytes = residentBytes;
        return render::makeFrameState({placed}, *backend_, *executor_, stream);
    }
    /// Round the ring, nearer and farther by turns: from where all of it is seen to where a few cells fill the picture.
    lod::View view(int frame) const {
        const glm::dvec3 lo = store_->description.boundsMin, hi = store_->description.boundsMax,
                         middle = 0.5 * (lo + hi);
        const double t = static_cast<double>(frame) / kFrames, a = 2 * M_PI * t, size = glm::length(hi - lo);
        const double far = size * (0.55 + 0.35 * std::cos(6 * M_PI * t));
        const glm::dvec3 out(std::cos(a), std::sin(a), 0.4);
        scene::Camera camera;
        camera.eye = middle + far * out;
        camera.target = middle + 0.3 * size * glm::dvec3(out.x, out.y, 0);
        camera.up = {0, 0, 1};
        return scene::makeView(camera, 240, 160, 1e-3 * size);
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::unique_ptr<render::Backend> backend_ = cpu::makeCpuBackend(*executor_);
    std::shared_ptr<const lod::Store> store_;
    render::FrameSettings settings_;
};

TEST_P(PatchStream, AlongAPathStaysWithinItsBytes) {
    const auto all = state(uint64_t{1} << 30);
    uint64_t most = 0;
    std::vector<render::Image> whole;
    for (int k = 0; k < kFrames; ++k) {
        ASSERT_TRUE(*render::renderUntilComplete(*all, view(k), settings_));
        whole.push_back(all->image);
        most = std::max(most, all->counters.residentBytes);
    }
    for (const uint64_t share : {2, 4, 10}) {
        const uint64_t budget = most / share;
        SCOPED_TRACE(share);
        const auto planned = state(budget), window = state(budget);
        int complete = 0, empty = 0;
        for (int k = 0; k < kFrames; ++k) {
            const auto isComplete = render::renderUntilComplete(*planned, view(k), settings_);
            ASSERT_TRUE(isComplete);
            EXPECT_LE(planned->counters.residentBytes, budget);
            complete += *isComplete ? 1 : 0;
            size_t seen = 0;
            for (const uint32_t c : planned->image.rgba) seen += c >> 24 != 0 ? 1 : 0;
            empty += seen == 0 ? 1 : 0;
            if (*isComplete) EXPECT_TRUE(planned->image.rgba == whole[static_cast<size_t>(k)].rgba) << k;
            for (int pass = 0; pass < 3; ++pass) {  // as the window streams: with what has come by then
                ASSERT_TRUE(render::renderFrame(*window, view(k), settings_));
                EXPECT_LE(window->counters.residentBytes, budget);
            }
        }
        std::printf("a %u-th of %.2f MB: %d of %d frames complete, %llu evictions\n", static_cast<unsigned>(share),
                    static_cast<double>(most) / 1e6, complete, kFrames,
                    static_cast<unsigned long long>(planned->counters.evictions));
        EXPECT_EQ(empty, 0) << "coarser levels are shown instead";
        EXPECT_GT(planned->counters.evictions, 0u) << "or the budget binds nowhere";
        if (share == 2) EXPECT_GT(complete, 0) << "or pictures were never compared";
        if (share == 10) EXPECT_LT(complete, kFrames) << "the control";
    }
}

TEST_P(PatchStream, AlongAPathStaysWithinItsRecords) {
    const auto state = this->state(uint64_t{1} << 30);
    const auto drawn = [&](int k) {
        EXPECT_TRUE(render::renderUntilComplete(*state, view(k), settings_));
        return state->cut.counters.recordsDrawn + state->cut.counters.trianglesDrawn;
    };
    uint64_t most = 0;
    for (int k = 0; k < kFrames; ++k) most = std::max(most, drawn(k));
    settings_.budgets.records = most / 4;
    for (int k = 0; k < kFrames; ++k) EXPECT_LE(drawn(k), settings_.budgets.records) << k;
    EXPECT_GT(state->cut.tauTarget, settings_.budgets.errorPixels) << "the error that it takes is said";
}

INSTANTIATE_TEST_SUITE_P(Ways, PatchStream,
                         testing::Values(shared::kPatchStrips, shared::kPatchSplats, lod::kPatchesAsSamples),
                         [](const testing::TestParamInfo<uint32_t>& way) {
                             return way.param == shared::kPatchStrips   ? "Strips"
                                    : way.param == shared::kPatchSplats ? "Splats"
                                                                        : "Samples";
                         });

}  // namespace
}  // namespace stipple
