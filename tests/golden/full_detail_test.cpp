// How far what a picture shows lies from the full detail: the place of each pixel (its depth, along its ray) and the
// nearest of all leaf discs, in fp64. Stated is tau; half a pixel more is the sample's own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// Pixels that are farther from the full detail than that, by what is there.
struct Beyond {
    size_t drawn = 0;
    size_t outline = 0;  ///< within two pixels of where nothing is drawn: a splat's plane goes on beyond its disc
    size_t closed = 0;   ///< no disc covers the pixel's centre, all around is drawn: a gap was closed
    size_t between = 0;  ///< the ray meets several discs, and the pixel lies between them: layers were joined
    size_t edge = 0;     ///< the same with discs that rays of pixels near by meet: a fold, or a surface behind
    size_t other = 0;
    size_t ofDiscs = 0;  ///< of the first discs that rays meet, without any reconstruction
    double worst = 0;    ///< px
    size_t all() const { return outline + closed + between + edge + other; }
    double share(size_t n) const { return 100.0 * static_cast<double>(n) / static_cast<double>(drawn); }
};

/// Depths of the discs that rays of the 5 x 5 pixels around one meet first.
struct Around {
    bool isBesideNothing = false;
    double nearest = 1e300, farthest = 0;
};
Around lookAround(const render::Image& image, const test::RayHits& hits, size_t pixel) {
    Around a;
    const int64_t w = hits.width, h = hits.height;
    for (int64_t k = 0; k < 25; ++k) {
        const int64_t x = static_cast<int64_t>(pixel) % w + k % 5 - 2, y = static_cast<int64_t>(pixel) / w + k / 5 - 2;
        if (x < 0 || y < 0 || x >= w || y >= h) continue;
        const auto at = static_cast<size_t>(y * w + x);
        if (!hits.isCovered(at)) {
            a.isBesideNothing = a.isBesideNothing || image.depth[at] <= 0;
            continue;
        }
        a.nearest = std::min(a.nearest, hits.depths[at].front());
        a.farthest = std::max(a.farthest, hits.depths[at].front());
    }
    return a;
}

/// The member of `b` that pixel `i` at depth `z` belongs to. `slack`: world units.
size_t& classOf(Beyond& b, const render::Image& image, const test::RayHits& hits, size_t i, double z, double slack) {
    const Around around = lookAround(image, hits, i);
    const auto isWithin = [&](double first, double last) { return first - slack < z && z < last + slack; };
    const auto& own = hits.depths[i];
    if (around.isBesideNothing) return b.outline;
    if (own.empty()) return b.closed;
    if (isWithin(own.front(), own.back())) return b.between;
    return isWithin(around.nearest, around.farthest) ? b.edge : b.other;
}

Beyond measure(const std::shared_ptr<const lod::Store>& store, const test::DiscField& full, const lod::View& view,
               double tau, Executor& executor, render::Mode mode = render::Mode::pullpush) {
    const auto backend = cpu::makeCpuBackend(executor);
    auto state = render::makeFrameState(std::vector<render::PlacedStore>{{store, {}, {}}}, *backend, executor, {});
    render::FrameSettings settings;
    settings.budgets.errorPixels = tau;
    settings.wantDepthAndNormal = true;
    settings.mode = mode;
    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings).value_or(false));
    const render::Image& image = state->image;
    const test::RayHits hits = test::hitDiscs(test::discsOfCut(*store, *state), view);
    Beyond b;
    const auto pixelsAway = [&](size_t i, double depth) {
        const double x = static_cast<double>(i % view.width) + 0.5, y = static_cast<double>(i / view.width) + 0.5;
        const double pixel = depth / view.focalPixels;
        return full.distance(view.eye + depth * test::rayThrough(view, x, y), 50 * pixel) / pixel;
    };
    for (size_t i = 0; i < image.depth.size(); ++i) {
        const double z = image.depth[i];
        if (hits.isCovered(i)) b.ofDiscs += pixelsAway(i, hits.depths[i].front()) > tau + 0.5;
        if (z <= 0) continue;
        ++b.drawn;
        const double away = pixelsAway(i, z);
        if (away <= tau + 0.5) continue;
        b.worst = std::max(b.worst, away);
        ++classOf(b, image, hits, i, z, (tau + 0.5) * z / view.focalPixels);
    }
    return b;
}

/// Most of the pixels of a view that may be beyond, %: along outlines, and where layers are joined (all other classes),
/// at half a pixel and at two.
struct Look {
    const char* name;
    double elevation, distance;
    double outlineHalf, joinedHalf, outlineTwo, joinedTwo;
};
void expectWithin(const char* name, const std::shared_ptr<const lod::Store>& store, std::initializer_list<Look> looks,
                  Executor& executor) {
    const test::DiscField full(test::leafDiscs(*store));
    for (const Look& look : looks)
        for (const double tau : {0.5, 1.0, 2.0, 4.0}) {
            const lod::View view = test::lookAt(*store, 30, look.elevation, look.distance, 400);
            const Beyond b = measure(store, full, view, tau, executor);
            std::printf(
                "%-6s %-8s tau %.1f: %zu drawn, beyond %.4f %% (outline %zu, closed %zu, between %zu, edge %zu, "
                "other %zu), worst %.1f px; of traced discs %zu\n",
                name, look.name, tau, b.drawn, b.share(b.all()), b.outline, b.closed, b.between, b.edge, b.other,
                b.worst, b.ofDiscs);
            std::fflush(stdout);
            SCOPED_TRACE(testing::Message() << name << ", " << look.name << ", tau " << tau);
            EXPECT_GT(b.drawn, 20'000u);
            EXPECT_EQ(b.ofDiscs, 0u) << "what is chosen keeps the bound; only the reconstruction does not";
            EXPECT_LE(b.share(b.outline), tau < 2 ? look.outlineHalf : look.outlineTwo);
            EXPECT_LE(b.share(b.all() - b.outline), tau < 2 ? look.joinedHalf : look.joinedTwo);
        }
}

// Wanted are 0.01 %. Two classes are above: along outlines, where a splat seen nearly edge-on stands for a pixel that
// its disc does not reach, the plane goes on too far; and behind folds, where discs lie within each other's thickness,
// their planes are averaged. Hardly any are in closed gaps.
TEST(FullDetail, OfGrownSurfacesIsWhereThePictureSays) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    for (const test::Shape shape : {test::Shape::statue, test::Shape::torus}) {
        const bool isStatue = shape == test::Shape::statue;
        test::writePly(folder / "a.ply", test::samplesOf(shape, 40'000, 3));
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
        if (isStatue)
            expectWithin("statue", store,
                         {{"overview", 35, 0.9, 0.07, 0.02, 0.02, 0.01},
                          {"close", 25, 0.5, 0.005, 0.6, 0.002, 0.003},
                          {"grazing", -5, 0.7, 0.05, 0.03, 0.02, 0.01}},
                         *executor);
        else
            expectWithin("torus", store,
                         {{"overview", 35, 0.9, 0.13, 0.01, 0.02, 0.01},
                          {"close", 25, 0.5, 0.04, 0.01, 0.01, 0.003},
                          {"grazing", -5, 0.7, 0.06, 0.01, 0.02, 0.003}},
                         *executor);
    }
}

// Wanted are 0.01 % here, too; the limits are what is reached, so that it does not get worse. Scans are rough:
// neighbouring discs lie at heights and angles of their own, and what averages them lies between them.
TEST(FullDetail, OfScansIsWhereThePictureSays) {
    const auto executor = makeTbbExecutor(2);
    const test::TempFolder folder;
    if (const std::string path = test::dataFile("01_meshes/misc/lucy.ply"); !path.empty())
        expectWithin("lucy", test::buildAndOpen(path, folder / "a.stipple", *executor, 2048),
                     {{"overview", 35, 0.9, 0.6, 0.55, 0.2, 0.2},
                      {"close", 25, 0.5, 0.25, 1.3, 0.1, 0.25},
                      {"grazing", -5, 0.7, 0.6, 1.4, 0.3, 0.65}},
                     *executor);
    if (const std::string path = test::dataFile("02_scans/als_ahn3_delft/ahn3_cropped_2.laz"); !path.empty())
        expectWithin("als", test::buildAndOpen(path, folder / "b.stipple", *executor, 2048),
                     {{"overview", 35, 0.9, 0.8, 2.6, 0.25, 0.6},
                      {"close", 25, 0.25, 0.5, 2.3, 0.15, 0.35},
                      {"grazing", 4, 0.7, 1.6, 4.5, 0.75, 2.5}},
                     *executor);
}

/// Most of `ewa`'s pixels that may be beyond, %. It shows places within half a pixel of the disc in front, so that only
/// rough scans have them: where a coarse disc is drawn wider than it is, so that its neighbours' kernels meet.
double mostOfEwa(const std::string& name, double tau) {
    if (name != "02_scans/als_ahn3_delft/ahn3_cropped_2.laz" && name != "01_meshes/misc/lucy.ply") return 0.01;
    return tau < 1 ? 1.0 : tau < 2 ? 0.15 : 0.02;
}

// What modes surface (and with it splat, SurfaceMode.IsWhereSplatIs) and pullpush-exact draw keeps the bound at 0.01 %
// of the pixels and less: each pixel lies on a disc that was chosen. So does `points`, whose pixels lie within the
// discs of their points, but for those of small discs that are seen beside them.
TEST(FullDetail, OfSplatsIsWhereThePictureSays) {
    const auto executor = makeTbbExecutor(2);
    const test::TempFolder folder;
    std::vector<std::pair<std::string, std::string>> inputs;
    for (const test::Shape shape : {test::Shape::statue, test::Shape::torus}) {
        const std::string name = shape == test::Shape::statue ? "statue" : "torus";
        test::writePly(folder / (name + ".ply"), test::samplesOf(shape, 40'000, 3));
        inputs.emplace_back(name, folder / (name + ".ply"));
    }
    for (const char* name : {"01_meshes/misc/lucy.ply", "02_scans/als_ahn3_delft/ahn3_cropped_2.laz"})
        if (const std::string path = test::dataFile(name); !path.empty()) inputs.emplace_back(name, path);
    for (const auto& [name, path] : inputs) {
        const auto store = test::buildAndOpen(path, folder / "a.stipple", *executor, 2048);
        const test::DiscField full(test::leafDiscs(*store));
        for (const auto& [elevation, distance] : {std::pair{35.0, 0.9}, {25.0, 0.5}, {4.0, 0.7}})
            for (const double tau : {0.5, 1.0, 4.0}) {
                const lod::View view = test::lookAt(*store, 30, elevation, distance, 400);
                for (const render::Mode mode :
                     {render::Mode::surface, render::Mode::pullpushExact, render::Mode::ewa, render::Mode::points}) {
                    const char* const modeName = render::reconstructionOf(mode).name;
                    const Beyond b = measure(store, full, view, tau, *executor, mode);
                    std::printf("%-14s %s from %.0f degrees, tau %.1f: %zu drawn, beyond %.4f %%, worst %.1f px\n",
                                modeName, name.c_str(), elevation, tau, b.drawn, b.share(b.all()), b.worst);
                    std::fflush(stdout);
                    EXPECT_GT(b.drawn, mode == render::Mode::points ? 3'000u : 20'000u);
                    const bool isEwa = mode == render::Mode::ewa;
                    EXPECT_LE(b.share(b.all()), isEwa ? mostOfEwa(name, tau) : 0.01)
                        << modeName << " " << name << " " << elevation << " " << tau;
                    EXPECT_LE(b.worst, isEwa ? 4.0 : mode == render::Mode::points ? 2.0 : 1e300);
                }
            }
    }
}

}  // namespace
}  // namespace stipple
