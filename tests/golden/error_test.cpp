// The three errors, each on its own: implementation (a backend against the fp64 restatement of the same cut), level of
// detail (a cut against the leaves), reconstruction (against traced discs). Figures for real scans are in
// bench/results.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class Errors : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        folder_ = std::make_unique<test::TempFolder>();
        executor_ = makeTbbExecutor(0);
        test::writePly(*folder_ / "a.ply", test::bumpySphere(200'000, 1));
        store_ = test::buildAndOpen(*folder_ / "a.ply", *folder_ / "a.stipple", *executor_, 4096);
    }
    static void TearDownTestSuite() {
        store_.reset();
        executor_.reset();
        folder_.reset();
    }
    static render::Image draw(render::Backend& backend, double tau, render::Mode mode, uint32_t w = 640,
                              uint32_t h = 480, bool lit = true, glm::dvec3 shift = glm::dvec3(0)) {
        render::FrameSettings settings;
        settings.mode = mode;
        settings.budgets.errorPixels = tau;
        settings.draw.lit = lit;
        lod::View view = test::fitView(*store_, w, h);
        view.eye += shift;
        return test::renderView(store_, backend, *executor_, view, settings);
    }
    static reference::ImageDifference differ(const render::Image& a, const render::Image& b) {
        const auto d = reference::compareImages(a, b, 4, nullptr);
        EXPECT_TRUE(d);
        return *d;
    }
    static std::unique_ptr<test::TempFolder> folder_;
    static std::unique_ptr<Executor> executor_;
    static std::shared_ptr<const lod::Store> store_;
};
std::unique_ptr<test::TempFolder> Errors::folder_;
std::unique_ptr<Executor> Errors::executor_;
std::shared_ptr<const lod::Store> Errors::store_;

TEST_F(Errors, ImplementationOfEveryInstructionSetIsWithinItsBound) {
    size_t count = 0;
    const cpu::Kernels* const* kernels = cpu::availableKernels(count);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Mode mode : {render::Mode::pullpush, render::Mode::splat, render::Mode::points})
        for (const double tau : {0.25, 1.0, 8.0, 64.0}) {
            const render::Image truth = draw(*oracle, tau, mode);
            for (size_t k = 0; k < count; ++k) {
                const auto backend = cpu::makeCpuBackend(*executor_, kernels[k]);
                const auto d = differ(draw(*backend, tau, mode), truth);
                EXPECT_GE(d.psnr, 50) << kernels[k]->name << " tau " << tau;
                EXPECT_LE(d.differingFraction, 0.001) << kernels[k]->name << " tau " << tau;
            }
        }
}

TEST_F(Errors, OddSizesAreDrawnAsWell) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const auto& [w, h] :
         {std::pair{1u, 1u}, {1u, 7u}, {7u, 1u}, {2u, 3u}, {127u, 129u}, {641u, 479u}, {257u, 33u}}) {
        for (const render::Reconstruction& r : render::reconstructions()) {
            const render::Image drawn = draw(*backend, 0.5, r.mode, w, h), truth = draw(*oracle, 0.5, r.mode, w, h);
            const double differing = differ(drawn, truth).differingFraction * w * h;
            printf("[ measured ] %s, %u x %u: %.0f pixels differ\n", r.name, w, h, differing);
            for (size_t i = 0; i < drawn.rgba.size() && drawn.rgba.size() < 10; ++i)
                EXPECT_EQ(drawn.rgba[i] >> 24, truth.rgba[i] >> 24) << r.name << ", coverage of pixel " << i;
            // (In one row or column all splats of pull-push beside the picture share its few pixels: of nearly equal
            // ones any may win, so that colours of one pixel tell nothing, and of seven five are the same.)
            const bool isLine = r.hasPyramid && std::min(w, h) == 1;
            // (Blended discs count at a pixel or do not, by their depths: one in ten thousand, but one of the few
            // here.)
            const double few = std::max(r.blendsSplats ? 1.0 : 0.0, 1e-4 * w * h);
            EXPECT_LE(differing, (isLine ? std::min(2u, w * h) : few) + 1e-9) << r.name << ", " << w << " x " << h;
        }
    }
}

/// The last column and row of an odd size have parents of their own in a pyramid: what reaches the picture's border is
/// drawn there, too.
TEST_F(Errors, OddSizesAreDrawnToTheirBorders) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const auto& [w, h] : {std::pair{127u, 129u}, {257u, 33u}, {131u, 67u}}) {
        const lod::View fit = test::fitView(*store_, w, h);
        const double depth =
            glm::dot(0.5 * (store_->description.boundsMin + store_->description.boundsMax) - fit.eye, fit.forward);
        const glm::dvec3 nearer = 0.55 * depth * fit.forward;
        const render::Image drawn = draw(*backend, 2, render::Mode::pullpush, w, h, true, nearer),
                            truth = draw(*oracle, 2, render::Mode::pullpush, w, h, true, nearer);
        size_t covered = 0, differing = 0;
        for (uint32_t y = 0; y < h; ++y)
            for (uint32_t x = 0; x < w; ++x) {
                if (x + 3 < w && y + 3 < h) continue;
                const size_t i = size_t{y} * w + x;
                covered += truth.rgba[i] >> 24 != 0;
                for (uint32_t c = 0; c < 32; c += 8)
                    if (std::abs(int(drawn.rgba[i] >> c & 255u) - int(truth.rgba[i] >> c & 255u)) > 8) {
                        ++differing;
                        break;
                    }
            }
        printf("[ measured ] %u x %u: %zu of %zu covered pixels of the last columns and rows differ\n", w, h, differing,
               covered);
        EXPECT_GT(covered, 100u);
        EXPECT_LE(differing, covered / 50);
    }
}

TEST_F(Errors, EveryFrameOfTheSameViewIsTheSame) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const render::Image first = draw(*backend, 0.5, render::Mode::pullpush);
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(draw(*backend, 0.5, render::Mode::pullpush).rgba == first.rgba);
    ASSERT_FALSE(draw(*backend, 0.5, render::Mode::pullpush, 640, 480, true, {0.001, 0, 0}).rgba == first.rgba)
        << "the comparison must be able to fail";
}

TEST_F(Errors, EqualCutsGiveEqualIdsWhateverElseIsResident) {
    const auto backend = cpu::makeCpuBackend(*executor_), other = cpu::makeCpuBackend(*executor_);
    const lod::View view = test::fitView(*store_, 320, 240);
    render::FrameSettings fine, coarse;
    fine.budgets.errorPixels = 0.05;
    coarse.budgets.errorPixels = 4;
    auto fresh = render::makeFrameState({store_}, *backend, *executor_, {});
    auto used = render::makeFrameState({store_}, *other, *executor_, {});
    ASSERT_TRUE(render::renderUntilComplete(*used, view, fine));
    ASSERT_TRUE(render::renderUntilComplete(*used, view, coarse));
    ASSERT_TRUE(render::renderUntilComplete(*fresh, view, coarse));
    ASSERT_NE(fresh->counters.residentBytes, used->counters.residentBytes) << "the residency must differ";
    ASSERT_EQ(fresh->draws.points().blocks.size(), used->draws.points().blocks.size());
    for (size_t b = 0; b < fresh->draws.points().blocks.size(); ++b) {
        ASSERT_EQ(fresh->draws.points().blocks[b].first, used->draws.points().blocks[b].first);
        ASSERT_EQ(fresh->draws.points().keys[fresh->draws.points().blocks[b].node].chunk,
                  used->draws.points().keys[used->draws.points().blocks[b].node].chunk);
    }
    EXPECT_TRUE(fresh->image.rgba == used->image.rgba);
    fresh->streamer.reset();  // hands its chunks back before the backend goes
    used->streamer.reset();
}

TEST_F(Errors, LevelOfDetailFallsWithTau) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const render::Image leaves = draw(*backend, 1e-5, render::Mode::pullpush);
    double last = 1e9;
    for (const double tau : {0.5, 1.0, 2.0, 4.0, 16.0}) {
        const auto d = differ(draw(*backend, tau, render::Mode::pullpush), leaves);
        if (tau == 0.5) EXPECT_GE(d.foregroundPsnr, 35);
        EXPECT_GE(d.silhouetteIou, 1 - 0.02 * tau) << tau;
        EXPECT_LE(d.foregroundPsnr, last + 1) << tau;
        last = d.foregroundPsnr;
    }
    EXPECT_LT(last, 40) << "a coarse cut must differ";
}

TEST_F(Errors, ReconstructionIsClosedAndKeepsTheSilhouette) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const render::Image image = draw(*backend, 1e-5, render::Mode::pullpush, 512, 512);
    reference::TraceSettings settings;
    settings.draw.lit = true;
    const auto traced = reference::trace({{store_, {}, {}}}, test::fitView(*store_, 512, 512), settings, *executor_);
    ASSERT_TRUE(traced);
    const auto d = differ(image, *traced);
    EXPECT_EQ(d.holes, 0u);
    EXPECT_GE(d.silhouetteIou, 0.99);
    EXPECT_GE(d.foregroundPsnr, 25);
}

TEST_F(Errors, TheSamePictureFarFromTheOrigin) {
    // ECEF-sized coordinates (hard case 1): the same integers, once near zero, once with a far offset.
    const test::TempFolder folder;
    std::vector<glm::ivec3> points;
    for (const auto& p : test::bumpySphere(60'000, 2)) points.push_back(glm::ivec3(glm::round(p.position * 2000.0)));
    const auto backend = cpu::makeCpuBackend(*executor_);
    std::array<render::Image, 2> images;
    size_t k = 0;
    for (const glm::dvec3& offset : {glm::dvec3(0), glm::dvec3(4.1e6, 5.2e5, 4.9e6)}) {
        test::writeLas(folder / "a.las", points, 0.001, offset);
        const auto store = test::buildAndOpen(folder / "a.las", folder / "a.stipple", *executor_);
        render::FrameSettings settings;
        settings.draw.lit = true;
        settings.draw.worldUp = {0, 0, 1};
        images.at(k++) = test::renderView(store, *backend, *executor_, test::fitView(*store, 640, 480), settings);
    }
    const auto d = reference::compareImages(images[0], images[1], 1, nullptr);
    ASSERT_TRUE(d);
    EXPECT_LE(d->differingFraction, 1e-4);
}

TEST(CompareImages, FindsWhatDiffers) {
    render::Image a, b;
    a.width = b.width = 10;
    a.height = b.height = 10;
    a.rgba.assign(100, 0xff000000u);
    b.rgba.assign(100, 0xff000000u);
    auto d = reference::compareImages(a, b, 4, nullptr);
    EXPECT_TRUE(std::isinf(d->psnr));
    EXPECT_EQ(d->maxDiff, 0);
    a.rgba[55] = 0xff0000ffu;
    a.rgba[44] = 0;
    d = reference::compareImages(a, b, 4, nullptr);
    EXPECT_EQ(d->maxDiff, 255);
    EXPECT_DOUBLE_EQ(d->differingFraction, 0.01);
    EXPECT_DOUBLE_EQ(d->silhouetteIou, 0.99);
    EXPECT_EQ(d->holes, 1u);
    EXPECT_NEAR(d->psnr, 10 * std::log10(300.0), 1e-9);
    b.width = 5;
    EXPECT_FALSE(reference::compareImages(a, b, 4, nullptr));
}

}  // namespace
}  // namespace stipple
