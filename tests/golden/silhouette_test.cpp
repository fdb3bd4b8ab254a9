// Outlines of pictures of modes surface and pullpush against those of the discs that they are made of, traced, and
// against the surface that the discs were sampled from, by rays in fp64.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

struct Overlap {
    size_t both = 0, either = 0;
    void add(bool a, bool b) {
        both += a && b;
        either += a || b;
    }
    double share() const { return static_cast<double>(both) / static_cast<double>(std::max<size_t>(either, 1)); }
};
struct Outlines {
    Overlap drawnAndDiscs, drawnAndSurface, discsAndSurface;
    size_t onlyDrawn = 0, onlyDiscs = 0;
};

/// Is the coverage by discs the same at all pixels within three of this one, and drawn so?
bool isFarFromOutline(const test::RayHits& hits, int64_t x, int64_t y) {
    const int64_t w = hits.width, h = hits.height;
    const bool own = hits.isCovered(static_cast<size_t>(y * w + x));
    for (int64_t k = 0; k < 49; ++k) {
        const int64_t nx = std::clamp<int64_t>(x + k % 7 - 3, 0, w - 1),
                      ny = std::clamp<int64_t>(y + k / 7 - 3, 0, h - 1);
        if (hits.isCovered(static_cast<size_t>(ny * w + nx)) != own) return false;
    }
    return true;
}

/// `isSurface(x, y)`: does the ray of that pixel's centre meet the true surface? Asked near outlines only.
template <typename F>
void compare(const render::Image& image, const test::RayHits& hits, const F& isSurface, Outlines& o) {
    for (int64_t y = 0; y < image.height; ++y)
        for (int64_t x = 0; x < image.width; ++x) {
            const auto i = static_cast<size_t>(y * image.width + x);
            const bool isDrawn = image.depth[i] > 0, isDisc = hits.isCovered(i);
            const bool isSure = isDrawn == isDisc && isFarFromOutline(hits, x, y);
            const bool isTrue = isSure ? isDisc : isSurface(x, y);
            o.drawnAndDiscs.add(isDrawn, isDisc);
            o.drawnAndSurface.add(isDrawn, isTrue);
            o.discsAndSurface.add(isDisc, isTrue);
            o.onlyDrawn += isDrawn && !isDisc;
            o.onlyDiscs += isDisc && !isDrawn;
        }
}

constexpr std::array kModes{render::Mode::surface, render::Mode::pullpush};

// Overlap (IoU) with the surface is at most 0.003 less than that of the discs; where discs are as small as pixels,
// 0.01: there a pixel is drawn wherever the centre of a disc lies in it, so that outlines are half a pixel farther
// out. (Left open, such a pixel would be a hole where a triangle or another surface is behind: a pixel keeps its front
// splat only.)
TEST(Silhouettes, AreThoseOfTheDiscs) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    struct Case {
        double apart;  ///< of the points, px
        uint32_t size;
        double overlap, less;
    };
    for (const test::Shape shape : {test::Shape::statue, test::Shape::torus})
        for (const Case& c : {Case{1, 400, 0.9895, 0.0105}, {4, 512, 0.9965, 0.003}, {12, 1000, 0.9955, 0.003}}) {
            const double pixels = 0.322 * c.size;  // of a unit, in the middle
            const double unit = test::spacingOf(shape, 1);
            test::writePly(folder / "a.ply",
                           test::samplesOf(shape, static_cast<size_t>(std::pow(unit * pixels / c.apart, 2)), 3));
            const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 8192);
            const auto discs = test::leafDiscs(*store);
            const char* name = shape == test::Shape::statue ? "statue" : "torus";
            std::array<Outlines, kModes.size()> outlines;
            for (const auto& [azimuth, elevation] : {std::pair{20.0, 25.0}, {110.0, 5.0}, {250.0, -40.0}}) {
                const lod::View view = test::lookAt(*store, azimuth, elevation, 0.88, c.size);
                const test::RayHits hits = test::hitDiscs(discs, view);
                const auto isSurface = [&, e = view](int64_t x, int64_t y) {
                    return test::meetsShape(
                        shape, e.eye, test::rayThrough(e, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5));
                };
                for (size_t m = 0; m < kModes.size(); ++m)
                    compare(test::renderView(store, *backend, *executor, view, test::drawnAs(kModes[m])), hits,
                            isSurface, outlines[m]);
            }
            for (size_t m = 0; m < kModes.size(); ++m) {
                const Outlines& o = outlines[m];
                const char* const mode = render::reconstructionOf(kModes[m]).name;
                const double less = o.discsAndSurface.share() - o.drawnAndSurface.share();
                std::printf(
                    "%-8s %-6s %2.0f px: overlap with discs %.4f (+%zu -%zu of %zu); with the surface: drawn %.4f, "
                    "discs %.4f, less %.4f\n",
                    mode, name, c.apart, o.drawnAndDiscs.share(), o.onlyDrawn, o.onlyDiscs, o.drawnAndDiscs.both,
                    o.drawnAndSurface.share(), o.discsAndSurface.share(), less);
                EXPECT_GT(o.drawnAndDiscs.both, 40'000u);
                EXPECT_GE(o.drawnAndDiscs.share(), c.overlap) << mode << " " << name << " " << c.apart;
                EXPECT_LE(less, kModes[m] == render::Mode::pullpush ? c.less : 0.003)
                    << mode << " " << name << " " << c.apart;
            }
        }
}

// Wanted is 0.997; the limits are what is reached. Of mode surface it is 0.993 from afar, where what stands alone shows
// the pixel that holds it, and 0.999 and more else.
TEST(Silhouettes, OfAScanAreThoseOfItsDiscs) {
    const std::string path = test::dataFile("01_meshes/misc/lucy.ply");
    if (path.empty()) return;
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    const auto store = test::buildAndOpen(path, folder / "a.stipple", *executor, 8192);
    const auto discs = test::leafDiscs(*store);
    struct Case {
        double distance, overlap;
    };
    for (const Case& c : {Case{1.8, 0.975}, {0.9, 0.983}, {0.35, 0.985}}) {
        const lod::View view = test::lookAt(*store, 30, 10, c.distance, 512);
        const test::RayHits hits = test::hitDiscs(discs, view);
        for (const render::Mode mode : kModes) {
            const render::Image image = test::renderView(store, *backend, *executor, view, test::drawnAs(mode));
            Outlines o;
            compare(
                image, hits, [](int64_t, int64_t) { return false; }, o);
            std::printf("%-8s lucy, %.2f diagonals away: overlap with discs %.4f (+%zu -%zu of %zu)\n",
                        render::reconstructionOf(mode).name, c.distance, o.drawnAndDiscs.share(), o.onlyDrawn,
                        o.onlyDiscs, o.drawnAndDiscs.both);
            EXPECT_GE(o.drawnAndDiscs.share(), mode == render::Mode::pullpush ? c.overlap : 0.993) << c.distance;
        }
    }
}

}  // namespace
}  // namespace stipple
