// More discs than sums and lists hold at once: thousands at a pixel add up without overflow, and wide ones beyond the
// list are drawn by the workgroups that met them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/decode.h"
#include "shaders/shared/ewa.h"
#include "shaders/shared/wide_disc.h"
#include "tests/support/backends_here.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class ManyDiscs : public test::BackendsHere {
  protected:
    static render::FrameSettings whole(render::Mode mode) { return test::drawnAs(mode, 1e-4, false); }
    render::Backend& gpu() { return usual(); }
    std::unique_ptr<render::Backend> cpu_ = cpu::makeCpuBackend(*executor_);
};

TEST_F(ManyDiscs, UnitsOfSumsHoldAsManyAsThereAre) {
    shared::FilteredFront front{};
    for (const uint32_t count : {0u, 1u, 64u, 65u, 16'384u, 16'385u, 1'000'000u, 1u << 30}) {
        front.count = count - 1;
        const double most = double(count) * (double{shared::sumUnit(front)} + 0.5);
        EXPECT_LT(most, 0x1p31) << count;
        EXPECT_TRUE(count < 64 || most > 0x1p28) << count << ": no coarser than it needs to be";
    }
}

/// 10,000 and 40,000 discs in one plane, all about one pixel, each place in two colours: their mean within 1 LSB, on
/// cpu and gpu. (With weights in 2^17ths the gpu's sums pass 2^31, and its pixels show one of the colours.)
TEST_F(ManyDiscs, AboutOnePixelAddUp) {
    constexpr uint32_t kOne = 0x3070c0, kOther = 0xe01020;
    for (const int count : {10'000, 40'000}) {
        Rng rng(4);
        std::vector<test::TestPoint> points;
        for (int i = 0; i < count / 2; ++i)
            for (const uint32_t colour : {kOne, kOther}) points.push_back({{0, 0, 0}, {0, 0, 1}, colour, 0.05f});
        for (size_t i = 0; i < points.size(); i += 2)
            points[i].position = points[i + 1].position = {rng.uniform(-0.005, 0.005), rng.uniform(-0.005, 0.005), 0};
        // (No radius is larger than its cell: two far ones make that wide enough.)
        for (const double x : {-0.15, 0.15}) points.push_back({{x, x, 0}, {0, 0, 1}, kOne, 0.001f});
        test::writePly(folder_ / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, 65536);
        lod::View view = test::viewFromAbove({0, 0, 0});
        view.width = view.height = 40;
        view.focalPixels = 300;
        for (render::Backend* backend : {cpu_.get(), &gpu()}) {
            const render::Image image = test::renderView(store, *backend, *executor_, view, whole(render::Mode::ewa));
            size_t wrong = 0, looked = 0;
            for (size_t i = 0; i < image.rgba.size(); ++i) {
                if (std::hypot(double(i % 40) - 19.5, double(i / 40) - 19.5) > 1.5) continue;
                ++looked;
                for (const int shift : {0, 8, 16}) {
                    const uint32_t mean = reference::encodeSrgb(0.5 * (reference::decodeSrgb(kOne >> shift & 255) +
                                                                       reference::decodeSrgb(kOther >> shift & 255)));
                    wrong += std::abs(static_cast<int>(image.rgba[i] >> shift & 255) - static_cast<int>(mean)) > 1;
                }
                wrong += std::abs(double{image.depth[i]} - 3) > 1e-4 || image.normal[3 * i + 2] < 0.9999f;
            }
            EXPECT_GE(looked, 4u);
            EXPECT_EQ(wrong, 0u) << backend->name() << ", " << count;
        }
    }
}

/// More wide discs than the list holds, in both modes: the picture is that of the cpu.
TEST_F(ManyDiscs, BeyondTheListAreThere) {
    Rng rng(5);
    std::vector<test::TestPoint> points;
    constexpr size_t kCount = size_t{shared::kDiscCapacity} + 1'000;
    for (size_t i = 0; i < kCount; ++i)
        points.push_back({{rng.uniform(-0.02, 0.02), rng.uniform(-0.02, 0.02), rng.uniform(-0.05, 0.05)},
                          {0, 0, 1},
                          static_cast<uint32_t>(rng.below(1u << 24)),
                          0.135f});
    for (const double x : {-0.15, 0.15}) points.push_back({{x, x, 0}, {0, 0, 1}, 0x3070c0u, 0.001f});
    test::writePly(folder_ / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, 131072);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.width = view.height = 36;  // each disc covers more than 1,024 pixels of it
    view.focalPixels = 400;
    for (const render::Mode mode : {render::Mode::splat, render::Mode::ewa}) {
        const render::Image a = test::renderView(store, gpu(), *executor_, view, whole(mode)),
                            b = test::renderView(store, *cpu_, *executor_, view, whole(mode));
        EXPECT_GE(test::drawnPsnr(a, b), 50) << static_cast<int>(mode);
        size_t off = 0;
        for (size_t i = 0; i < a.depth.size(); ++i) off += std::abs(a.depth[i] - b.depth[i]) > 1e-3f * b.depth[i];
        EXPECT_LE(off, a.depth.size() / 1000) << static_cast<int>(mode);
    }
}

}  // namespace
}  // namespace stipple
