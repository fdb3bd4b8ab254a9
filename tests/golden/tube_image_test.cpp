// Wide tubes from every side, straight along their axes and at the rim of wide pictures, on every backend: depth,
// normal, coverage and colour against a march along each ray through the distance to the union of balls that a tube is
// (none of the quadratics of the engine, and none of its projections).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/kernels.h"
#include "engine/reference/decode.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "lod/store/store.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;
using reference::Segment;

constexpr double kDegree = 0.017453292519943295;

/// Of a store of tubes: what is stored, decoded by the description of the format.
std::vector<Segment> leafSegments(const lod::Store& store) {
    std::vector<Segment> out;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        if (!h.nodes[i].isLeaf()) continue;
        const auto chunk = lod::readChunk(store, i);
        EXPECT_TRUE(chunk);
        for (const shared::CurveSegment& s : chunk->segments) out.push_back(reference::decodeSegment(h, h.nodes[i], s));
    }
    return out;
}

struct Nearest {
    double distance = 1e300;
    dvec3 centre{0};  ///< of the ball that is nearest
};
/// Distance to the balls between both ends of a segment: convex in the place, so that a golden-section search finds it.
Nearest distanceTo(const Segment& s, const dvec3& p) {
    const auto at = [&](double u) {
        return glm::length(p - glm::mix(s.a, s.b, u)) - glm::mix(s.radiusA, s.radiusB, u);
    };
    constexpr double kGolden = 0.6180339887498949;
    double lo = 0, hi = 1, u0 = 1 - kGolden, u1 = kGolden, d0 = at(u0), d1 = at(u1);
    for (int i = 0; i < 45; ++i) {
        if (d0 < d1) {
            hi = u1;
            u1 = u0;
            d1 = d0;
            u0 = hi - kGolden * (hi - lo);
            d0 = at(u0);
        } else {
            lo = u0;
            u0 = u1;
            d0 = d1;
            u1 = lo + kGolden * (hi - lo);
            d1 = at(u1);
        }
    }
    double u = 0.5 * (lo + hi);
    for (const double end : {0.0, 1.0})
        if (at(end) < at(u)) u = end;
    return {at(u), glm::mix(s.a, s.b, u)};
}

struct Seen {
    bool isHit = false;
    double depth = 0, clearance = 1e300;  ///< clearance: how near the ray comes to the surface, over its pixel's size
    dvec3 normal{0};                      ///< world
};

/// Marches along a ray from the eye; the distance to the nearest ball is always free.
Seen march(const std::vector<Segment>& segments, const dvec3& eye, const dvec3& ray, double farthest, double pixel) {
    Seen seen;
    const double length = glm::length(ray);
    for (double t = 0; t < farthest;) {
        const dvec3 p = eye + t * ray;
        Nearest best;
        for (const Segment& s : segments) {
            // The ball around a segment's middle tells most of them apart.
            const double least =
                glm::length(p - 0.5 * (s.a + s.b)) - 0.5 * glm::length(s.b - s.a) - std::max(s.radiusA, s.radiusB);
            if (least > best.distance) continue;
            const Nearest n = distanceTo(s, p);
            if (n.distance < best.distance) best = n;
        }
        if (t > 0) seen.clearance = std::min(seen.clearance, best.distance / (t * pixel));
        if (best.distance < 1e-9) {
            seen.isHit = true;
            seen.depth = t;
            seen.normal = glm::normalize(p - best.centre);
            return seen;
        }
        t += best.distance / length;
    }
    return seen;
}

struct Figures {
    double psnr = 0;                        ///< of colours, where both see the tube
    double depthPixels = 0;                 ///< largest distance between both surfaces, over the pixel's size there
    double degrees = 0;                     ///< between normals, 99.9 of 100 pixels
    size_t covered = 0, wrongCoverage = 0;  ///< wrong: farther than a hundredth of a pixel from the silhouette
};

Figures compare(const render::Image& image, const lod::View& view, const std::vector<Seen>& truth, const dvec3& colour,
                const shared::FrameConstants& frame) {
    Figures f;
    double squares = 0;
    size_t both = 0;
    std::vector<double> angles;
    for (size_t i = 0; i < truth.size(); ++i) {
        const bool isDrawn = image.rgba[i] >> 24 != 0;
        f.covered += truth[i].isHit ? 1 : 0;
        const dvec2 at(double(i % view.width) + 0.5 - 0.5 * view.width,
                       double(i / view.width) + 0.5 - 0.5 * view.height);
        const double stretch = glm::length(dvec3(at, view.focalPixels)) / view.focalPixels;
        if (isDrawn != truth[i].isHit) {
            // The march says how near a ray passes; a hit has no such distance, its normal's slant stands for it.
            const dvec3 ray = view.right * at.x + view.down * at.y + view.forward * view.focalPixels;
            const double graze = std::abs(glm::dot(glm::normalize(ray), truth[i].normal));
            f.wrongCoverage += (truth[i].isHit ? graze > 0.03 : truth[i].clearance > 0.01) ? 1 : 0;
            continue;
        }
        if (!isDrawn) continue;
        ++both;
        const dvec3 n(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
        const dvec3 camera(glm::dot(truth[i].normal, view.right), glm::dot(truth[i].normal, view.down),
                           glm::dot(truth[i].normal, view.forward));
        const double light = reference::lightOn(camera, frame, false);
        for (size_t c = 0; c < 3; ++c) {
            const auto index = static_cast<glm::length_t>(c);
            const double expected = reference::encodeSrgb(colour[index] * light), got = image.rgba[i] >> 8 * c & 255u;
            squares += (expected - got) * (expected - got) / 3;
        }
        angles.push_back(std::acos(std::clamp(glm::dot(n, truth[i].normal), -1.0, 1.0)) / kDegree);
        // Along the normal: a surface that is seen at a grazing angle has no depth to speak of.
        const double off = std::abs(double(image.depth[i]) - truth[i].depth) * stretch;
        const dvec3 ray = glm::normalize(view.right * at.x + view.down * at.y + view.forward * view.focalPixels);
        f.depthPixels =
            std::max(f.depthPixels, off * std::abs(glm::dot(ray, truth[i].normal)) * view.focalPixels / truth[i].depth);
    }
    f.psnr = both > 0 && squares > 0 ? 10 * std::log10(255.0 * 255.0 * double(both) / squares) : 99;
    if (!angles.empty()) {
        std::sort(angles.begin(), angles.end());
        f.degrees = angles[angles.size() - 1 - angles.size() / 1000];
    }
    return f;
}

class Tubes : public test::BackendsHere {
  protected:
    struct Case {
        const char* name;
        std::vector<dvec3> places;
        std::vector<float> radii;
    };
    static std::vector<Case> cases() {
        std::vector<Case> all{{"cylinder", {}, {}}, {"cone", {}, {}}, {"stub", {}, {}}};
        for (int i = 0; i <= 4; ++i) {
            all[0].places.emplace_back(0, 0, -0.5 + 0.25 * i);
            all[0].radii.push_back(0.1f);
            all[1].places.emplace_back(0, 0, -0.5 + 0.25 * i);
            all[1].radii.push_back(0.2f - 0.03f * static_cast<float>(i));
        }
        all[2].places = {{0, 0, -0.02}, {0, 0, 0.02}};  // shorter than wide
        all[2].radii = {0.2f, 0.15f};
        return all;
    }
    std::shared_ptr<const lod::Store> build(const Case& c) {
        lod::CurveSet set;
        for (size_t i = 0; i < c.places.size(); ++i) set.addVertex(c.places[i], c.radii[i], glm::vec3(0), 0x60a0d0);
        set.endCurve(false);
        return test::buildCurves(lod::cleanCurves(std::move(set), 0), folder_ / (std::string(c.name) + ".stipple"),
                                 *executor_);
    }
    /// Looks at the origin from `degrees` off the axis; `aside`: how far from the picture's middle it is seen.
    static lod::View look(double degrees, double distance, double fov, const dvec2& aside) {
        scene::Camera camera;
        camera.eye = distance * dvec3(std::sin(degrees * kDegree), 0, std::cos(degrees * kDegree));
        camera.target = {0, 0, 0};
        camera.up = {0, 1, 0};
        camera.fovDegrees = fov;
        lod::View view = scene::makeView(camera, 140, 112, 1e-3);
        // Turned about the eye.
        const dvec3 f = glm::normalize(view.forward - view.right * std::tan(aside.x * kDegree) -
                                       view.down * std::tan(aside.y * kDegree));
        view.forward = f;
        view.right = glm::normalize(view.right - f * glm::dot(view.right, f));
        view.down = glm::cross(f, view.right);
        return view;
    }
    static dvec3 rayOf(const lod::View& view, size_t pixel) {
        const dvec2 at(double(pixel % view.width) + 0.5 - 0.5 * view.width,
                       double(pixel / view.width) + 0.5 - 0.5 * view.height);
        return view.forward + (view.right * at.x + view.down * at.y) / view.focalPixels;
    }
    void expectTrue() {
        render::FrameSettings settings;
        settings.draw.lit = true;
        settings.draw.worldUp = {0, 1, 0};
        settings.draw.exactCurves = 0.5f;
        settings.budgets.errorPixels = 1e-4;
        settings.wantDepthAndNormal = true;
        std::map<std::string, Figures> worst;
        for (const Case& c : cases()) {
            const auto store = build(c);
            ASSERT_TRUE(store);
            const std::vector<Segment> segments = leafSegments(*store);
            for (const double degrees : {0.0, 0.05, 1.0, 5.0, 29.0, 60.0, 90.0, 151.0, 180.0})
                for (const auto& [distance, fov, aside] :
                     {std::tuple{6.0, 8.0, dvec2(0)}, std::tuple{1.2, 120.0, dvec2(0)},
                      std::tuple{0.9, 120.0, dvec2(50, 0)}, std::tuple{1.0, 120.0, dvec2(40, 35)}}) {
                    const lod::View view = look(degrees, distance, fov, aside);
                    std::vector<Seen> truth(size_t{view.width} * view.height);
                    executor_->parallelFor(truth.size(), 2000, [&](size_t from, size_t to) {
                        for (size_t i = from; i < to; ++i)
                            truth[i] = march(segments, view.eye, rayOf(view, i), 2 * distance, 1 / view.focalPixels);
                    });
                    render::DrawList draws;
                    render::makeDrawList({}, {}, {}, view, settings.draw, draws);
                    for (const auto& [name, backend] : backends_) {
                        const render::Image image = test::draw({{store, {}, {}}}, *backend, *executor_, view, settings);
                        const Figures f = compare(image, view, truth, segments[0].colourA, draws.frame);
                        SCOPED_TRACE(fmt::format("{}, {} at {} degrees, fov {}, aside {}, {}", name, c.name, degrees,
                                                 fov, aside.x, aside.y));
                        EXPECT_GE(f.covered, 25u);
                        EXPECT_EQ(f.wrongCoverage, 0u) << "of " << f.covered;
                        EXPECT_GE(f.psnr, 50);
                        EXPECT_LE(f.depthPixels, 0.05);
                        EXPECT_LE(f.degrees, 1.0);
                        Figures& w = worst[name];
                        w.psnr = w.covered == 0 ? f.psnr : std::min(w.psnr, f.psnr);
                        w.covered += f.covered;
                        w.depthPixels = std::max(w.depthPixels, f.depthPixels);
                        w.degrees = std::max(w.degrees, f.degrees);
                        w.wrongCoverage = std::max(w.wrongCoverage, f.wrongCoverage);
                    }
                }
        }
        for (const auto& [name, w] : worst)
            printf("%s: %.1f dB, depth %.4f px, normals %.3f degrees, %zu pixels of wrong coverage at worst\n",
                   name.c_str(), w.psnr, w.depthPixels, w.degrees, w.wrongCoverage);
    }
};

TEST_F(Tubes, AreWhatRaysMeetFromEverySide) { expectTrue(); }

#ifndef STIPPLE_ON_GPU
TEST_F(Tubes, KeepTheirOutlineAndTheirCoverageInWidePictures) {
    // 120 degrees: what is seen beside the middle is stretched by the picture, narrow curves alike.
    const auto backend = cpu::makeCpuBackend(*executor_);
    scene::Camera camera;
    camera.eye = {0, 0, 1.3};
    camera.target = {0, 0, 0};
    camera.up = {0, 1, 0};
    camera.fovDegrees = 120;
    const lod::View view = scene::makeView(camera, 320, 240, 1e-3);
    render::FrameSettings settings;
    settings.draw.lit = true;
    settings.draw.worldUp = {0, 1, 0};
    settings.budgets.errorPixels = 1e-4;
    const auto traced = [&](const std::shared_ptr<const lod::Store>& store, uint32_t samples) {
        reference::TraceSettings t;
        t.samplesPerAxis = samples;
        t.draw = settings.draw;
        auto image = reference::trace({{store, {}, {}}}, view, t, *executor_);
        EXPECT_TRUE(image);
        return std::move(*image);
    };
    for (const double ribbons : {0.0, 1.0}) {
        test::CurlRecipe recipe;
        recipe.count = 12;
        recipe.radius = 0.1f;
        recipe.ribbons = ribbons;
        const auto store = test::buildCurves(test::curls(recipe), folder_ / "wide.stipple", *executor_);
        settings.draw.exactCurves = 0.5f;
        const auto d = reference::compareImages(test::draw({{store, {}, {}}}, *backend, *executor_, view, settings),
                                                traced(store, 1), 4, nullptr);
        ASSERT_TRUE(d);
        printf("120 degrees, %s: IoU %.4f, %.1f dB\n", ribbons > 0 ? "ribbons" : "tubes", d->silhouetteIou,
               d->foregroundPsnr);
        EXPECT_GE(d->silhouetteIou, 0.999);
        EXPECT_GE(d->foregroundPsnr, ribbons > 0 ? 47 : 50);
    }
    test::CurlRecipe recipe;
    recipe.count = 300;
    recipe.radius = 0.0008f;
    for (const double ribbons : {0.0, 1.0}) {
        recipe.ribbons = ribbons;
        const auto store = test::buildCurves(test::curls(recipe), folder_ / "narrow.stipple", *executor_);
        double expected = 0, got = 0;
        for (const uint32_t c : traced(store, 12).rgba) expected += (c >> 24) / 255.0;
        constexpr uint32_t kFrames = 32;
        for (uint32_t f = 0; f < kFrames; ++f) {
            settings.draw.coverageSeed = f;
            for (const uint32_t c : test::draw({{store, {}, {}}}, *backend, *executor_, view, settings).rgba)
                got += c >> 24 != 0 ? 1.0 / kFrames : 0;
        }
        printf("120 degrees, narrow %s: %.1f pixels, rays %.1f\n", ribbons > 0 ? "ribbons" : "tubes", got, expected);
        EXPECT_NEAR(got / expected, 1, 0.05) << ribbons;
    }
}

#endif

}  // namespace
}  // namespace stipple
