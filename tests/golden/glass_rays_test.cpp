// Mirrors and glass against rays written for the test: the direction that a mirror ball reflects, and where rays leave
// a ball of glass, and in what direction. What ways and modes are off is printed; what is promised is tested.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/layers.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/materials.h"
#include "tests/support/glass.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;

dvec3 rayOf(const lod::View& v, uint32_t x, uint32_t y) {
    const double px = (x + 0.5 - 0.5 * v.width) / v.focalPixels, py = (y + 0.5 - 0.5 * v.height) / v.focalPixels;
    return glm::normalize(v.forward + px * v.right + py * v.down);
}
/// Distance to the unit sphere, the nearer; below 0: missed.
double toSphere(const dvec3& from, const dvec3& d) {
    const double b = glm::dot(from, d), k = b * b - glm::dot(from, from) + 1;
    return k < 0 ? -1 : -b - std::sqrt(k);
}
double degrees(const dvec3& a, const dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * 180 / M_PI;
}
double p95(std::vector<double> values) {
    EXPECT_GT(values.size(), 1000u);
    if (values.empty()) return 1e9;
    std::sort(values.begin(), values.end());
    return values[values.size() * 95 / 100];
}
dvec3 onPicture(const lod::View& v, const dvec3& p) {
    const dvec3 d = p - v.eye;
    const double z = glm::dot(d, v.forward);
    return {v.focalPixels * glm::dot(d, v.right) / z, v.focalPixels * glm::dot(d, v.down) / z, z};
}

/// The direction that light of the colour s (1 + d / 2) comes from, whatever s near 1 is.
dvec3 decoded(const dvec3& c) {
    // |2 (c / s - 1)| = 1: a quadratic in 1 / s.
    const double a = glm::dot(c, c), b = c.x + c.y + c.z, root = std::sqrt(std::max(0.0, b * b - a * 2.75));
    const double q1 = (b - root) / a, q2 = (b + root) / a;
    return 2.0 * (c * (std::abs(q1 - 1) < std::abs(q2 - 1) ? q1 : q2) - 1.0);
}

constexpr uint64_t kSamples = 9'858;  ///< of patches as many are asked for, and held within a fifth

class GlassRays : public testing::Test {
  protected:
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    std::unique_ptr<render::Backend> backend_ = cpu::makeCpuBackend(*executor_);
};

/// Of the direction that a mirror ball reflects, degrees, p95; and how much of it comes from where: from the place that
/// is drawn instead of the ball's, from the normal there, and from the maps of the environment.
struct Reflected {
    double off, place, normal, map;
};

Reflected offReflection(const render::Image& image, const lod::View& view) {
    std::vector<double> off, place, normal, map;
    for (uint32_t y = 0; y < view.height; ++y)
        for (uint32_t x = 0; x < view.width; ++x) {
            const size_t i = size_t{y} * view.width + x;
            const dvec3 d = rayOf(view, x, y);
            const double t = toSphere(view.eye, d);
            if (!(image.depth[i] > 0) || !(t > 0)) continue;
            const dvec3 n = view.eye + t * d;
            if (-glm::dot(n, d) < 0.2) continue;  // the rim, which is a pixel of many directions
            const dvec3 shown = decoded({image.linear[3 * i], image.linear[3 * i + 1], image.linear[3 * i + 2]});
            const dvec3 there = glm::normalize(view.eye + d * (double{image.depth[i]} / glm::dot(d, view.forward)));
            const dvec3 drawn =
                glm::normalize(dvec3(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]));
            off.push_back(degrees(shown, glm::reflect(d, n)));
            place.push_back(degrees(glm::reflect(d, there), glm::reflect(d, n)));
            normal.push_back(degrees(glm::reflect(d, drawn), glm::reflect(d, there)));
            map.push_back(degrees(shown, glm::reflect(d, drawn)));
        }
    return {p95(off), p95(place), p95(normal), p95(map)};
}

// Patches are of a ball of triangles half as long as their steps: of one with as many corners as there are samples they
// are chords of chords, which is the other control.
TEST_F(GlassRays, AMirrorBallReflectsTheDirectionsThatItShould) {
    test::writePly(folder_ / "a.ply", test::spherePoints(kSamples, 0xffffff));
    const auto points = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_),
               mesh = test::meshStore(test::ball(140), std::nullopt, folder_ / "b.stipple", *executor_),
               patches = test::patchStore(test::ball(280), kSamples, folder_ / "c.stipple", *executor_),
               chords = test::patchStore(test::ball(140), kSamples, folder_ / "d.stipple", *executor_);
    const lod::View view = test::glassView({0, 0, 3}, 480);
    const auto light = test::directionLight(2048);
    const auto off = [&](const char* name, const std::shared_ptr<const lod::Store>& store, render::Mode mode,
                         bool hasSharpMaps = true, uint32_t patchAs = shared::kPatchStrips) {
        render::FrameSettings settings = test::glassSettings(mode);
        settings.draw.pointMaterial = lod::packed(*lod::materialNamed("mirror"));
        settings.draw.patchAs = patchAs;
        settings.draw.environment =
            std::make_shared<const render::Environment>(render::makeEnvironment(light, 1, *executor_, hasSharpMaps));
        const Reflected r = offReflection(test::renderView(store, *backend_, *executor_, view, settings), view);
        std::printf("%-36s %.3f (places %.3f, normals %.3f, maps %.3f)\n", name, r.off, r.place, r.normal, r.map);
        return r;
    };
    std::printf("mirror ball of 9,858 samples, 19,600 triangles: reflected direction p95, degrees (from where)\n");
    constexpr render::Mode kUsual = render::Mode::pullpush;
    const Reflected triangles = off("triangles", mesh, kUsual), pullpush = off("pullpush", points, kUsual),
                    ewa = off("ewa", points, render::Mode::ewa),
                    usual = off("triangles by the usual maps", mesh, kUsual, false),
                    strips = off("patches as strips", patches, kUsual),
                    splats = off("patches as splats", patches, kUsual, true, shared::kPatchSplats),
                    coarse = off("strips of a ball of 19,600 triangles", chords, kUsual);
    off("splat", points, render::Mode::splat);
    off("patches as direct splats", patches, kUsual, true, shared::kPatchDirect);
    EXPECT_LT(triangles.off, 0.2);
    for (const Reflected& r : {strips, splats}) {
        EXPECT_LT(r.off, 0.2);
        EXPECT_LT(r.normal, 0.06) << "of which the rounding of mirrors' normals is most";
    }
    EXPECT_LT(ewa.off, 2);
    EXPECT_LT(pullpush.off, 2);
    EXPECT_GT(usual.off, triangles.off) << "the control";
    EXPECT_GT(coarse.place, 1.2 * strips.place) << "the other control";
}

/// Through a ball of glass, in fp64: where a ray leaves it, and in what direction; false if it misses it.
bool throughBall(const dvec3& eye, const dvec3& d, double ior, dvec3& exit, dvec3& out) {
    const double t = toSphere(eye, d);
    if (!(t > 0)) return false;
    const dvec3 n = eye + t * d;
    const double in = std::acos(-glm::dot(n, d)), inside = std::asin(std::sin(in) / ior);
    // In the plane of incidence it turns by the same angle at both interfaces.
    const dvec3 axis = glm::cross(d, -n);
    if (glm::length(axis) < 1e-12) {
        exit = -n;
        out = d;
        return true;
    }
    const dvec3 a = glm::normalize(axis), side = glm::cross(a, d);
    const double turn = in - inside;
    const dvec3 bent = std::cos(turn) * d + std::sin(turn) * side;
    exit = n + 2 * std::cos(inside) * bent;
    out = std::cos(2 * turn) * d + std::sin(2 * turn) * side;
    return true;
}

struct Off {
    double pixels, degrees, found;
};

/// Of a drawn ball: its own front and back, by the shared formulas, against rays.
Off offTruth(const render::FrameState& state, const lod::View& view, uint32_t way, double ior) {
    const render::LayerTables& glass = *state.draws.glass;
    const shared::LayerConstants& l = glass.constants;
    const shared::SeenTables seen{nullptr, glass.behind.data(), glass.back.data()};
    const render::Image& image = state.image;
    const auto toWorld = [&](const shared::vec3& c) {
        const dvec3 v(c);
        return v.x * view.right + v.y * view.down + v.z * view.forward;
    };
    const auto toCamera = [&](const dvec3& w) {
        return shared::vec3(glm::vec3(glm::dot(w, view.right), glm::dot(w, view.down), glm::dot(w, view.forward)));
    };
    std::vector<double> pixels, angles;
    size_t all = 0, found = 0;
    for (uint32_t y = 0; y < view.height; ++y)
        for (uint32_t x = 0; x < view.width; ++x) {
            const size_t i = size_t{y} * view.width + x;
            const dvec3 d = rayOf(view, x, y);
            dvec3 exit, out;
            if (!(image.depth[i] > 0) || !throughBall(view.eye, d, ior, exit, out)) continue;
            const dvec3 p = view.eye + d * (double{image.depth[i]} / glm::dot(d, view.forward));
            if (glm::length(p) > 1.05) continue;  // not of the ball
            const dvec3 n(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            const shared::vec3 pc = toCamera(p - view.eye), dc = toCamera(d), nc = toCamera(n);
            const auto c = static_cast<float>(std::clamp(-glm::dot(n, d), 1e-3, 1.0));
            const auto eta = static_cast<float>(1 / ior);
            const shared::vec3 t = shared::bentRay(dc, nc, c, eta, shared::bentCosine2(c, eta));
            dvec3 seenExit = p, seenOut = toWorld(t);
            ++all;
            if (way == shared::kRefractScreen) seenExit = p + double{glass.optics.at(1).thickness} * toWorld(t);
            if (way == shared::kRefractObject) {
                const shared::BodyExit e = shared::bodyExit(seen, l, pc, t);
                if (!e.isFound) continue;
                const float o = std::min(std::max(shared::dot(t, e.normal), 1e-3f), 1.0f),
                            k = shared::bentCosine2(o, static_cast<float>(ior));
                if (k < 0) continue;
                seenExit = p + double{e.path} * toWorld(t);
                seenOut = toWorld(shared::bentRay(t, shared::scaled(e.normal, -1), o, static_cast<float>(ior), k));
            }
            ++found;
            pixels.push_back(glm::length(dvec2(onPicture(view, seenExit)) - dvec2(onPicture(view, exit))));
            angles.push_back(degrees(seenOut, out));
        }
    return {p95(pixels), p95(angles), static_cast<double>(found) / static_cast<double>(all)};
}

constexpr std::array<const char*, 3> kWays{"environment", "screen", "object"};

/// A ball of glass before a board.
class GlassBall : public GlassRays {
  protected:
    Off measure(const std::shared_ptr<const lod::Store>& body, render::Mode mode, uint32_t way,
                uint32_t patchAs = shared::kPatchStrips) {
        render::FrameSettings settings = test::glassSettings(mode);
        settings.draw.refract = way;
        settings.draw.patchAs = patchAs;
        settings.draw.pointMaterial = lod::packed(*lod::materialNamed("glass"));
        settings.draw.optics = lod::opticsNamed("glass");
        std::vector<render::PlacedStore> placed{{board_, {}, {}}, {body, {}, {}}};
        for (render::PlacedStore& p : placed) p.patchesAreSamples = patchAs == lod::kPatchesAsSamples;
        auto state = render::makeFrameState(placed, *backend_, *executor_, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view_, settings));
        return offTruth(*state, view_, way, 1.5);
    }
    static void print(const char* of, uint32_t way, const Off& off) {
        std::printf("ball of glass, %s, %-11s: exit point p95 %.2f px, exit direction p95 %.2f degrees, of %.1f %%\n",
                    of, kWays.at(way), off.pixels, off.degrees, 100 * off.found);
    }
    std::shared_ptr<const lod::Store> board_ =
        test::meshStore(test::board(-2.5), scene::Material{}, folder_ / "board.stipple", *executor_);
    lod::View view_ = test::glassView({0.9, 0.7, 3.6}, 480);
};

TEST_F(GlassBall, OfTrianglesAndPointsBendsRaysTwice) {
    const auto mesh = test::meshStore(test::ball(400), test::glassMaterial(*lod::opticsNamed("glass")),
                                      folder_ / "mesh.stipple", *executor_);
    test::writePly(folder_ / "a.ply", test::spherePoints(60'000, 0xffffff));
    const auto points = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    std::array<Off, 3> triangles{};
    for (const uint32_t way : {0u, 1u, 2u}) {
        triangles.at(way) = measure(mesh, render::Mode::pullpush, way);
        print("triangles", way, triangles.at(way));
    }
    for (const auto& [name, mode] : {std::pair{"60,000 points in pullpush", render::Mode::pullpush},
                                     {"60,000 points in ewa", render::Mode::ewa}}) {
        const Off off = measure(points, mode, shared::kRefractObject);
        print(name, shared::kRefractObject, off);
        EXPECT_LE(off.pixels, 4) << name;
    }
    EXPECT_LE(triangles[2].pixels, 2);
    EXPECT_GE(triangles[2].found, 0.95);
    EXPECT_GT(triangles[0].pixels, 20) << "the control";
    EXPECT_GT(triangles[1].degrees, 5) << "the control";
}

TEST_F(GlassBall, OfPatchesBendsRaysTwiceHoweverTheyAreDrawn) {
    struct As {
        const char* name;
        uint32_t as;
        render::Mode mode;
        double pixels, degrees;  ///< `object` is not farther off
    };
    const auto patches = test::patchStore(test::ball(400), 60'000, folder_ / "patches.stipple", *executor_);
    for (const As& of : {As{"patches as strips", shared::kPatchStrips, render::Mode::pullpush, 0.25, 0.25},
                         {"patches as splats", shared::kPatchSplats, render::Mode::pullpush, 0.25, 0.25},
                         {"patches as direct splats", shared::kPatchDirect, render::Mode::pullpush, 0.25, 0.25},
                         {"patches as samples in pullpush", lod::kPatchesAsSamples, render::Mode::pullpush, 4, 2},
                         {"patches as samples in ewa", lod::kPatchesAsSamples, render::Mode::ewa, 2, 1}}) {
        SCOPED_TRACE(of.name);
        std::array<Off, 3> off{};
        for (const uint32_t way : {0u, 1u, 2u}) {
            off.at(way) = measure(patches, of.mode, way, of.as);
            print(of.name, way, off.at(way));
        }
        EXPECT_LE(off[2].pixels, of.pixels);
        EXPECT_LE(off[2].degrees, of.degrees);
        EXPECT_GE(off[2].found, 0.95);
        for (const uint32_t way : {0u, 1u}) {
            EXPECT_GT(off.at(way).pixels, 20) << "the control";
            EXPECT_GT(off.at(way).degrees, 5) << "the control";
        }
    }
}

}  // namespace
}  // namespace stipple
