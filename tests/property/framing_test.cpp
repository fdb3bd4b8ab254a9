// The default view fills the picture: whatever the scene's shape, its axis and the picture's, and whatever it really
// is.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/image/image_io.h"
#include "engine/scene/camera.h"
#include "engine/scene/curves.h"
#include "engine/scene/outline.h"
#include "engine/scene/scene.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

struct Span {
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300};
    void add(double x, double y) {
        lo[0] = std::min(lo[0], x);
        hi[0] = std::max(hi[0], x);
        lo[1] = std::min(lo[1], y);
        hi[1] = std::max(hi[1], y);
    }
    /// Of the side that is filled most.
    double share(double width, double height) const {
        return std::max((hi[0] - lo[0]) / width, (hi[1] - lo[1]) / height);
    }
    bool isInside(double width, double height) const {
        return lo[0] >= 0 && lo[1] >= 0 && hi[0] <= width && hi[1] <= height;
    }
    double offCentre(double width, double height) const {
        return std::max(std::abs(lo[0] + hi[0] - width) / width, std::abs(lo[1] + hi[1] - height) / height) / 2;
    }
};

Span projected(std::span<const glm::dvec3> points, const lod::View& v) {
    Span span;
    for (const glm::dvec3& p : points) {
        const double depth = glm::dot(p - v.eye, v.forward);
        EXPECT_GT(depth, 0);
        span.add(0.5 * v.width + glm::dot(p - v.eye, v.right) / depth * v.focalPixels,
                 0.5 * v.height + glm::dot(p - v.eye, v.down) / depth * v.focalPixels);
    }
    return span;
}

struct Shape {
    glm::dvec3 lo, hi, up;
    uint32_t width, height;
    double fov;
};
Shape anyShape(Rng& rng) {
    Shape s;
    const glm::dvec3 centre =
        std::exp2(rng.uniform(-5, 23)) * glm::dvec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
    const auto side = [&] { return std::exp2(rng.uniform(-3, 10)); };
    const glm::dvec3 half(side(), side(), side());
    s.lo = centre - half;
    s.hi = centre + half;
    s.up = lod::axisVector(static_cast<lod::UpAxis>(rng.below(3)));
    s.height = 200 + static_cast<uint32_t>(rng.below(2000));
    s.width = static_cast<uint32_t>(s.height * std::exp2(rng.uniform(-1.3, 1.3)));
    s.fov = rng.uniform(5, 75);
    return s;
}

TEST(Framing, ABoxSpansMostOfThePicturesTighterSide) {
    Rng rng(7);
    for (int i = 0; i < 2000; ++i) {
        const Shape s = anyShape(rng);
        const double aspect = static_cast<double>(s.width) / s.height;
        const lod::View v = makeView(fitCamera(s.lo, s.hi, s.up, aspect, s.fov), s.width, s.height, 1e-3);
        const Span span = projected(cornersOf(s.lo, s.hi), v);
        ASSERT_TRUE(span.isInside(s.width, s.height)) << i;
        ASSERT_GE(span.share(s.width, s.height), 0.80) << i;
        ASSERT_LE(span.share(s.width, s.height), 0.95) << i;
        ASSERT_LE(span.offCentre(s.width, s.height), 0.005) << i;
    }
}

TEST(Framing, AnOrbitNeverCutsAndIsFullOnce) {
    Rng rng(8);
    for (int i = 0; i < 100; ++i) {
        const Shape s = anyShape(rng);
        const auto corners = cornersOf(s.lo, s.hi);
        const CameraPath path = makeOrbit(corners, s.up, static_cast<double>(s.width) / s.height, 12, s.fov);
        double most = 0;
        for (const CameraKey& key : path.keys) {
            const lod::View v = makeView(key.camera, s.width, s.height, 1e-3);
            const Span span = projected(corners, v);
            ASSERT_TRUE(span.isInside(s.width, s.height));
            ASSERT_NEAR(glm::length(key.camera.eye - key.camera.target) /
                            glm::length(path.keys[0].camera.eye - path.keys[0].camera.target),
                        1, 1e-6);
            const glm::dvec2 middle(0.5 * s.width, 0.5 * s.height);
            most = std::max({most, (middle.x - span.lo[0]) / middle.x, (span.hi[0] - middle.x) / middle.x,
                             (middle.y - span.lo[1]) / middle.y, (span.hi[1] - middle.y) / middle.y});
        }
        ASSERT_NEAR(most, kFitShare, 0.01);
    }
}

TEST(Framing, FlatScenesAreSeenFromSteeperAbove) {
    const auto slope = [](double height) {
        const Camera c = fitCamera({0, 0, 0}, {100, 100, height}, {0, 0, 1}, 1.6);
        const glm::dvec3 back = glm::normalize(c.eye - c.target);
        return std::asin(back.z) * 57.29577951308232;
    };
    EXPECT_NEAR(slope(100), 25, 0.1);
    EXPECT_GT(slope(10), 40);
    EXPECT_LE(slope(0.001), 50.1);
}

TEST(Framing, SaysWhenAFlatSceneLooksZUp) {
    lod::StoreDescription d;
    d.up = {0, 1, 0};
    d.focusMax = {100, 80, 12};
    EXPECT_TRUE(looksZUp(d));
    d.up = {0, 0, 1};
    EXPECT_FALSE(looksZUp(d)) << "z is up already";
    d.up = {0, 1, 0};
    d.focusMax = {100, 12, 80};
    EXPECT_FALSE(looksZUp(d));
    d.focusMax = {1, 1, 0.8};
    EXPECT_FALSE(looksZUp(d)) << "a statue";
}

/// What is drawn of an input, in a picture of the program.
double drawnShare(const test::TempFolder& folder, const std::string& input, const std::string& options) {
    const int code =
        test::shell("export XDG_CACHE_HOME=" + folder / "cache",
                    "render " + input + " -o " + folder / "a.png" + " --alpha --quiet " + options, folder.path());
    EXPECT_EQ(code, 0) << test::slurp(folder / "err");
    const auto image = image::readImage(folder / "a.png");
    if (!image) return 0;
    Span span;
    for (uint32_t y = 0; y < image->height; ++y)
        for (uint32_t x = 0; x < image->width; ++x)
            if (image->rgba[size_t{y} * image->width + x] >> 24 != 0) {
                span.add(x, y);
                span.add(x + 1, y + 1);
            }
    return span.share(image->width, image->height);
}

TEST(Framing, ARoundSceneFillsThePictureToo) {
    const test::TempFolder folder;
    test::writePly(folder / "ball.ply", test::bumpySphere(20'000, 1), true);
    for (const char* size : {"--size 320x180", "--size 100x300"}) {
        const double share = drawnShare(folder, folder / "ball.ply", size);
        EXPECT_GE(share, 0.80) << size;
        EXPECT_LE(share, 0.95) << size;
    }
}

/// Vertices of a grown tree's tubes and ribbons, of its file.
std::vector<glm::dvec3> verticesOf(const std::string& path) {
    const auto tree = readScene(path, {});
    if (!tree) return {};
    return flattenCurves(*tree, placements(*tree)).position;
}

TEST(Framing, AGrownTreeIsWholeFromItsFootToItsTop) {
    const test::TempFolder folder;
    for (const std::string species : {"oak", "birch"}) {
        SCOPED_TRACE(species);
        const std::string tree = folder / (species + ".glb");
        const auto run = [&](const std::string& arguments) {
            return test::shell("export XDG_CACHE_HOME=" + folder / "cache", arguments, folder.path());
        };
        ASSERT_EQ(run("grow tree -o " + tree + " --species " + species), 0) << test::slurp(folder / "err");
        ASSERT_EQ(run("build " + tree + " -o " + folder / "a.stipple" + " --force --quiet"), 0);
        const auto store = lod::openStore(folder / "a.stipple");
        ASSERT_TRUE(store);
        const std::vector<glm::dvec3> vertices = verticesOf(tree);
        ASSERT_GT(vertices.size(), 10'000u);
        const lod::View v = makeView(fitCamera(outlineOf(*store), store->description.up, 16.0 / 9), 640, 360, 1e-3);
        const Span span = projected(vertices, v);
        EXPECT_TRUE(span.isInside(640, 360))
            << span.lo[0] << " " << span.lo[1] << " " << span.hi[0] << " " << span.hi[1];
        EXPECT_GE(span.share(640, 360), 0.80);
        // The program's picture: nothing reaches its border.
        ASSERT_EQ(run("render " + tree + " -o " + folder / "a.png" + " --alpha --quiet --size 640x360"), 0);
        const auto image = image::readImage(folder / "a.png");
        ASSERT_TRUE(image);
        size_t atBorder = 0;
        for (uint32_t y = 0; y < image->height; ++y)
            for (uint32_t x = 0; x < image->width; ++x)
                if (x < 3 || y < 3 || x + 3 >= image->width || y + 3 >= image->height)
                    atBorder += image->rgba[size_t{y} * image->width + x] >> 24 != 0 ? 1 : 0;
        EXPECT_EQ(atBorder, 0u);
    }
}

TEST(Framing, RealScansAndMeshesFillThePicture) {
    const test::TempFolder folder;
    for (const char* name : {"01_meshes/bunny/bun_zipper.ply", "02_scans/forest_tls_TreeLS/spruce.laz",
                             "02_scans/als_lasR_misc/Topography.laz", "04_plants/gltf/flower_blue.glb"}) {
        const std::string path = test::dataFile(name);
        if (path.empty()) continue;
        const double share = drawnShare(folder, path, "--size 640x360");
        EXPECT_GE(share, 0.80) << name;
        EXPECT_LE(share, 0.96) << name;
    }
}

}  // namespace
}  // namespace stipple::scene
