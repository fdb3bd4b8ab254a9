// Debug views and modes against pictures that somebody has looked at. To renew them after an intended change:
// STIPPLE_RENEW_GOLDENS=1 ctest -R Golden, then look at tests/golden/*.png before committing. A renewing run fails.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "engine/cpu/cpu_backend.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

struct Case {
    const char* name;
    uint32_t debugView;
    render::Mode mode;
    double tau;
    friend void PrintTo(const Case& c, std::ostream* to) { *to << c.name; }
};

class Golden : public testing::TestWithParam<Case> {};

TEST_P(Golden, LooksAsItDid) {
    const Case& c = GetParam();
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(60'000, 1));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 1024);
    const auto backend = cpu::makeCpuBackend(*executor);
    render::FrameSettings settings;
    settings.mode = c.mode;
    settings.draw.lit = c.debugView == shared::kDebugNone;
    settings.draw.debugView = c.debugView;
    settings.budgets.errorPixels = c.tau;
    lod::View view = test::fitView(*store, 320, 240);
    view.eye += 1.2 * view.forward;  // near enough for several levels in one picture
    const render::Image image = test::renderView(store, *backend, *executor, view, settings);
    test::expectGolden(image, c.name);
}

INSTANTIATE_TEST_SUITE_P(Views, Golden,
                         testing::Values(Case{"pullpush", shared::kDebugNone, render::Mode::pullpush, 1},
                                         Case{"points", shared::kDebugNone, render::Mode::points, 1},
                                         Case{"level", shared::kDebugLevel, render::Mode::pullpush, 4},
                                         Case{"error", shared::kDebugError, render::Mode::pullpush, 4},
                                         Case{"holes", shared::kDebugHoles, render::Mode::pullpush, 1},
                                         Case{"normals", shared::kDebugNormals, render::Mode::pullpush, 1}),
                         [](const auto& one) { return std::string(one.param.name); });

TEST(ImageIo, AWrittenPictureComesBackAndFaultsAreErrors) {
    const test::TempFolder folder;
    render::Image image;
    image.width = 3;
    image.height = 2;
    image.rgba = {0xff0000ff, 0x00112233, 0x80445566, 0xff00ff00, 0xffffffff, 0};
    ASSERT_TRUE(image::writeImage(folder / "a.png", image));
    const auto back = image::readImage(folder / "a.png");
    ASSERT_TRUE(back) << back.error().line();
    EXPECT_EQ(back->rgba, image.rgba);
    EXPECT_FALSE(image::writeImage(folder / "a.jpg", image));
    EXPECT_FALSE(image::writeImage(folder / "no" + std::string("/such/a.png"), image));
    EXPECT_FALSE(image::readImage(folder / "nothing.png"));
}

}  // namespace
}  // namespace stipple
