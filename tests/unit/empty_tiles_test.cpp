// What shows nothing costs nothing: tiles of a picture are told apart, and kernels are called for no others.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>

#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/passes/shown_tiles.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using cpu::TileRect;

TEST(ShownTiles, AreGoneThroughOnceAndAllElseIsFilledOnce) {
    const auto serial = makeSerialExecutor(), parallel = makeTbbExecutor(2);
    Rng rng(1);
    for (const auto& [width, height] : {std::pair{1u, 1u}, {127u, 32u}, {128u, 33u}, {129u, 31u}, {1000u, 200u}})
        for (const double share : {0.0, 0.3, 1.0})
            for (Executor* executor : {serial.get(), parallel.get()}) {
                const uint32_t columns = (width + cpu::kTile - 1) / cpu::kTile, bands = (height + 31) / 32;
                std::vector<uint8_t> isShown(size_t{columns} * bands);
                for (uint8_t& s : isShown) s = rng.uniform(0, 1) < share ? 1 : 0;
                const auto shows = [&](const TileRect& r) {
                    EXPECT_TRUE(r.x0 % cpu::kTile == 0 && r.row0 % 32 == 0 && r.n <= cpu::kTile);
                    return isShown[r.row0 / 32 * columns + r.x0 / cpu::kTile] != 0;
                };
                std::vector<std::atomic<int>> filled(size_t{width} * height), worked(filled.size());
                std::atomic<size_t> fills{0};
                const auto mark = [&](std::vector<std::atomic<int>>& of, const TileRect& r) {
                    for (uint32_t y = r.row0; y < r.row1; ++y)
                        for (uint32_t x = r.x0; x < r.x0 + r.n; ++x) ++of.at(size_t{y} * width + x);
                };
                cpu::forShownTiles(
                    *executor, width, height, shows,
                    [&](const TileRect& r) {
                        ++fills;
                        mark(filled, r);
                    },
                    [&](const TileRect& r) { mark(worked, r); });
                size_t wrong = 0, stretches = 0;
                for (size_t p = 0; p < filled.size(); ++p) {
                    const int shown = isShown[p / width / 32 * columns + p % width / cpu::kTile];
                    wrong += worked[p] != shown || filled[p] != 1 - shown ? 1 : 0;
                }
                for (size_t t = 0; t < isShown.size(); ++t)
                    stretches += isShown[t] == 0 && (t % columns == 0 || isShown[t - 1] != 0) ? 1 : 0;
                EXPECT_EQ(wrong, 0u) << width << " x " << height;
                EXPECT_EQ(fills, stretches) << "what lies side by side is filled together";
            }
}

/// A table of kernels that counts the calls of some.
std::map<std::string, std::atomic<size_t>> calls;
const cpu::Kernels* counted = nullptr;
template <auto kKernel, typename Function>
struct Counting;
template <auto kKernel, typename R, typename... A>
struct Counting<kKernel, R (*)(A...)> {
    static inline std::atomic<size_t>* of = nullptr;
    static R call(A... arguments) {
        ++*of;
        return (counted->*kKernel)(arguments...);
    }
    static R (*as(const char* name))(A...) {
        of = &calls[name];
        return call;
    }
};
#define STIPPLE_COUNTED(name) table.name = Counting<&cpu::Kernels::name, decltype(cpu::Kernels::name)>::as(#name)
cpu::Kernels countingKernels() {
    cpu::Kernels table = *counted;
    STIPPLE_COUNTED(projectBlock);
    STIPPLE_COUNTED(placeSplats);
    STIPPLE_COUNTED(splatTile);
    STIPPLE_COUNTED(resolveRow);
    STIPPLE_COUNTED(packRow);
    STIPPLE_COUNTED(unpackRow);
    STIPPLE_COUNTED(pullRow);
    STIPPLE_COUNTED(coarseDiscs);
    STIPPLE_COUNTED(pushRow);
    STIPPLE_COUNTED(surfaceRow);
    STIPPLE_COUNTED(lightRow);
    STIPPLE_COUNTED(keepRow);
    STIPPLE_COUNTED(takeRow);
    STIPPLE_COUNTED(edlRow);
    STIPPLE_COUNTED(outputRow);
    return table;
}
#undef STIPPLE_COUNTED

class EmptyTiles : public testing::TestWithParam<render::Mode> {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 1));
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        size_t count = 0;
        counted = cpu::availableKernels(count)[0];
        kernels_ = countingKernels();
        backend_ = cpu::makeCpuBackend(*executor_, &kernels_);
    }
    render::Image draw(const lod::View& view, bool hasEdl) {
        for (auto& [name, count] : calls) count = 0;
        render::FrameSettings settings;
        settings.mode = GetParam();
        settings.wantDepthAndNormal = true;
        if (hasEdl) settings.draw.effects = {"edl"};
        settings.draw.parameters.edl.where = 1;  // everything
        return test::renderView(store_, *backend_, *executor_, view, settings);
    }
    /// The store small in the middle of the picture, or behind the eye.
    lod::View viewOf(bool away) const {
        lod::View view = test::fitView(*store_, 1000, 500);
        view.focalPixels *= 0.2;
        if (away) {
            view.forward = -view.forward;
            view.right = -view.right;
        }
        return view;
    }
    const test::TempFolder folder_;
    const std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::shared_ptr<const lod::Store> store_;
    cpu::Kernels kernels_{};
    std::unique_ptr<render::Backend> backend_;
};

/// Rows of tiles with a pixel that shows something, or with one at most `beside` tiles and 16 `beside` rows away.
size_t shownRows(const render::Image& image, int beside) {
    const auto width = static_cast<int>(image.width), height = static_cast<int>(image.height),
               tile = static_cast<int>(cpu::kTile), columns = (width + tile - 1) / tile;
    std::vector<uint8_t> isShown(static_cast<size_t>(columns) * image.height);
    for (int p = 0; p < width * height; ++p) {
        if (image.rgba[static_cast<size_t>(p)] >> 24 == 0)
            continue;  // (of what covers less than half there is no depth)
        const int x = p % width / tile, y = p / width;
        for (int r = std::max(0, y - 16 * beside); r <= std::min(height - 1, y + 16 * beside); ++r)
            for (int c = std::max(0, x - beside); c <= std::min(columns - 1, x + beside); ++c)
                isShown[static_cast<size_t>(r * columns + c)] = 1;
    }
    return static_cast<size_t>(std::count(isShown.begin(), isShown.end(), uint8_t{1}));
}

TEST_P(EmptyTiles, CallNoKernelAndShowNothingOfFramesBefore) {
    for (const bool hasEdl : {false, true}) {
        const render::Image before = draw(viewOf(false), hasEdl);
        const size_t shown = shownRows(before, 0), near = shownRows(before, 1);
        ASSERT_GT(shown, 100u);
        ASSERT_LT(near, before.rgba.size() / cpu::kTile / 2);
        const size_t runs = hasEdl ? 2 : 1;          // each asks once what nothing looks like
        if (GetParam() == render::Mode::pullpush) {  // which looks at what is beside, too
            EXPECT_LE(calls["outputRow"], runs + near);
            EXPECT_LE(calls["pushRow"], 2 * near) << "all levels: the second has half the rows, and so on";
        } else {
            EXPECT_EQ(calls["outputRow"], runs + shown) << "a row of a tile that shows something";
            EXPECT_EQ(calls["edlRow"], hasEdl ? shown : 0u);
        }
        const render::Image after = draw(viewOf(true), hasEdl);
        EXPECT_EQ(shownRows(after, 0), 0u);
        for (const uint32_t pixel : after.rgba) ASSERT_EQ(pixel, after.rgba.front());
        EXPECT_LE(calls["outputRow"], runs);
        for (const auto& [name, count] : calls)
            if (name != "outputRow") EXPECT_EQ(count, 0u) << name;
    }
}
INSTANTIATE_TEST_SUITE_P(Modes, EmptyTiles,
                         testing::Values(render::Mode::surface, render::Mode::pullpush, render::Mode::splat,
                                         render::Mode::ewa, render::Mode::points),
                         [](const auto& of) { return std::string(render::reconstructionOf(of.param).name); });

}  // namespace
}  // namespace stipple
