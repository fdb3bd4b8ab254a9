// Orthographic views of every kind on every backend, against parallel rays o + t d in fp64 by brute force: every disc,
// ball, triangle and strip of a ribbon that is stored, without projections, slopes and quadratics of curves. And what
// they mean for cuts, and for eyes that are far away.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/decode.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec3;

/// What one ray meets first; world space.
struct Hit {
    double t = HUGE_VAL;
    dvec3 normal{0};
    bool isThere() const { return t < HUGE_VAL; }
};
using Meet = std::function<Hit(const dvec3& o, const dvec3& d)>;

/// A place in space where the ray passes a triangle on one side of all three edges.
void meetTriangle(const std::array<dvec3, 3>& p, const dvec3& o, const dvec3& d, bool isTwoSided, Hit& hit) {
    std::array<double, 3> side{};
    for (size_t k = 0; k < 3; ++k) side.at(k) = glm::dot(d, glm::cross(p.at(k) - o, p.at((k + 1) % 3) - o));
    const bool isFront = side[0] <= 0 && side[1] <= 0 && side[2] <= 0,
               isBack = side[0] >= 0 && side[1] >= 0 && side[2] >= 0;
    if (!isFront && !(isTwoSided && isBack)) return;
    const dvec3 n = glm::cross(p[1] - p[0], p[2] - p[0]);
    if (!(std::abs(glm::dot(n, d)) > 0)) return;
    const double t = glm::dot(n, p[0] - o) / glm::dot(n, d);
    if (t > 0 && t < hit.t) hit = {t, glm::normalize(glm::dot(n, d) > 0 ? -n : n)};
}

std::vector<reference::Segment> segmentsOf(const lod::Store& store) {
    std::vector<reference::Segment> out;
    for (uint32_t i = 0; i < store.hierarchy.nodes.size(); ++i) {
        if (!store.hierarchy.nodes[i].isLeaf()) continue;
        const auto chunk = lod::readChunk(store, i);
        EXPECT_TRUE(chunk);
        for (const auto& s : chunk->segments)
            out.push_back(reference::decodeSegment(store.hierarchy, store.hierarchy.nodes[i], s));
    }
    return out;
}

/// Tubes as many balls, ribbons as narrow strips of two triangles.
Meet rayThroughCurves(const std::vector<reference::Segment>& segments) {
    constexpr int kParts = 120;
    const auto edge = [](const reference::Segment& s, double u, double side) {
        return glm::mix(s.a, s.b, u) + side * glm::mix(s.radiusA * s.directionA, s.radiusB * s.directionB, u);
    };
    std::vector<std::pair<dvec3, double>> balls;
    struct Strip {
        std::array<dvec3, 3> corners;
        reference::Segment segment;
        double u;
    };
    std::vector<Strip> strips;
    for (const reference::Segment& s : segments)
        for (int k = 0; k <= kParts; ++k) {
            const double u = double(k) / kParts, next = double(k + 1) / kParts;
            if (s.isTube) {
                balls.emplace_back(glm::mix(s.a, s.b, u), glm::mix(s.radiusA, s.radiusB, u));
            } else if (k < kParts) {
                strips.push_back({{edge(s, u, -1), edge(s, u, 1), edge(s, next, 1)}, s, u});
                strips.push_back({{edge(s, u, -1), edge(s, next, 1), edge(s, next, -1)}, s, u});
            }
        }
    return [balls, strips, edge](const dvec3& o, const dvec3& d) {
        Hit hit;
        for (const auto& [centre, radius] : balls) {
            const double along = glm::dot(centre - o, d), off = glm::length(o + along * d - centre);
            const double t = along - std::sqrt(std::max(radius * radius - off * off, 0.0));
            if (off < radius && t > 0 && t < hit.t) hit = {t, (o + t * d - centre) / radius};
        }
        const Strip* nearest = nullptr;
        for (const Strip& strip : strips) {
            const double before = hit.t;
            meetTriangle(strip.corners, o, d, true, hit);
            if (hit.t < before) nearest = &strip;
        }
        if (nearest) {  // the normal is the surface's, by differences, and not the strip's
            const reference::Segment& s = nearest->segment;
            const double u = nearest->u + 0.5 / kParts, e = 1e-5;
            const dvec3 middle = edge(s, u, 0), across = edge(s, u, 1) - middle;
            const double side = glm::dot(o + hit.t * d - middle, across) / glm::dot(across, across);
            const dvec3 n = glm::normalize(
                glm::cross(edge(s, u, side + e) - edge(s, u, side - e), edge(s, u + e, side) - edge(s, u - e, side)));
            hit.normal = glm::dot(n, d) > 0 ? -n : n;
        }
        return hit;
    };
}

Meet rayThroughDiscs(const std::vector<reference::Disc>& discs) {
    return [discs](const dvec3& o, const dvec3& d) {
        Hit hit;
        for (const reference::Disc& disc : discs) {
            const double facing = glm::dot(disc.normal, d);
            if (!(std::abs(facing) > 1e-9)) continue;
            const double t = glm::dot(disc.normal, disc.position - o) / facing;
            if (t > 0 && t < hit.t && glm::length(o + t * d - disc.position) <= disc.radius)
                hit = {t, facing > 0 ? -disc.normal : disc.normal};
        }
        return hit;
    };
}

Meet rayThroughTriangles(const std::vector<test::Triangle>& triangles, bool isTwoSided) {
    return [triangles, isTwoSided](const dvec3& o, const dvec3& d) {
        Hit hit;
        for (const test::Triangle& t : triangles) meetTriangle(t, o, d, isTwoSided, hit);
        return hit;
    };
}

struct Figures {
    size_t covered = 0, wrong = 0;  ///< wrong: in or out of the picture though all rays around say otherwise
    double mean = 0, worst = 0;     ///< distance of both surfaces, pixels; worst: of 99 in 100 pixels
    double degrees = 0;             ///< between normals, of every second pixel (at joints two surfaces are one)
};

class Orthographic : public test::BackendsHere {
  protected:
    static constexpr uint32_t kWidth = 121, kHeight = 90;

    /// From 5 units away.
    static lod::View look(double azimuth, double elevation, double width, const dvec3& target = dvec3(0)) {
        scene::Camera camera;
        camera.target = target;
        camera.eye = target + 5.0 * dvec3(std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                                          std::cos(elevation) * std::cos(azimuth));
        camera.orthoWidth = width;
        return scene::makeView(camera, kWidth, kHeight, 1e-3);
    }

    std::vector<Hit> cast(const lod::View& view, double width, const Meet& meet) {
        std::vector<Hit> hits(size_t{kWidth} * kHeight);
        const double pixel = width / kWidth;
        executor_->parallelFor(hits.size(), 200, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) {
                const double x = double(i % kWidth) + 0.5 - 0.5 * kWidth, y = double(i / kWidth) + 0.5 - 0.5 * kHeight;
                hits[i] = meet(view.eye + pixel * (x * view.right + y * view.down), view.forward);
            }
        });
        return hits;
    }

    static Figures compare(const render::Image& image, const lod::View& view, const std::vector<Hit>& truth,
                           double width) {
        Figures f;
        const double pixel = width / kWidth;
        std::vector<double> apart, angles;
        for (uint32_t y = 1; y + 1 < kHeight; ++y)
            for (uint32_t x = 1; x + 1 < kWidth; ++x) {
                const size_t i = size_t{y} * kWidth + x;
                size_t around = 0;
                bool isSmooth = truth[i].isThere();
                for (uint32_t k = 0; k < 9; ++k) {
                    const Hit& h = truth[(y + k / 3 - 1) * kWidth + x + k % 3 - 1];
                    around += h.isThere() ? 1 : 0;
                    // Of one surface: no farther off than what is turned away by 85 degrees.
                    isSmooth = isSmooth && h.isThere() && std::abs(h.t - truth[i].t) < 16 * pixel;
                }
                const bool isDrawn = image.rgba[i] >> 24 != 0;
                f.covered += isDrawn ? 1 : 0;
                f.wrong += (isDrawn && around == 0) || (!isDrawn && around == 9) ? 1 : 0;
                if (!isDrawn || !isSmooth) continue;
                const Hit& hit = truth[i];
                const double facing = std::abs(glm::dot(hit.normal, view.forward));
                apart.push_back(std::abs(double{image.depth[i]} - hit.t) * facing / pixel);
                f.mean += apart.back();
                const dvec3 n(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
                angles.push_back(std::acos(std::min(glm::dot(n, hit.normal), 1.0)) * 57.29577951308232);
            }
        if (apart.empty()) return f;
        f.mean /= static_cast<double>(apart.size());
        for (const auto& [list, to, share] :
             {std::tuple{&apart, &f.worst, 0.99}, std::tuple{&angles, &f.degrees, 0.5}}) {
            const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(list->size() - 1));
            std::nth_element(list->begin(), list->begin() + place, list->end());
            *to = (*list)[static_cast<size_t>(place)];
        }
        return f;
    }

    struct Limits {
        double wrong, mean, worst, degrees, psnr;  ///< wrong: share of what is drawn
    };
    /// Every backend's picture against rays, and its colours against traced ones.
    void expectTrue(const std::shared_ptr<const lod::Store>& store, const lod::View& view, double width,
                    const Meet& meet, const Limits& limits, const std::string& what) {
        render::FrameSettings settings;
        settings.budgets.errorPixels = 1e-4;
        settings.wantDepthAndNormal = true;
        settings.draw.lit = true;
        settings.draw.worldUp = {0, 1, 0};
        settings.draw.exactCurves = 0.5f;
        const std::vector<Hit> truth = cast(view, width, meet);
        reference::TraceSettings trace;
        trace.samplesPerAxis = 1;
        trace.draw = settings.draw;
        auto traced = reference::trace({{store, {}, {}}}, view, trace, *executor_);
        ASSERT_TRUE(traced);
        const auto judge = [&](const render::Image& image, const std::string& name, bool isTraced) {
            SCOPED_TRACE(name + ": " + what);
            const Figures f = compare(image, view, truth, width);
            const auto colours = reference::compareImages(image, *traced, 4, nullptr);
            ASSERT_TRUE(colours);
            const double psnr = test::drawnPsnr(image, *traced);
            printf("%-10s %-34s %5zu pixels, %3zu wrong, depth %.4f (%.4f) px, normals %.3f degrees, %.1f dB\n",
                   name.c_str(), what.c_str(), f.covered, f.wrong, f.mean, f.worst, f.degrees, psnr);
            EXPECT_GE(f.covered, 400u);
            EXPECT_LE(double(f.wrong), limits.wrong * double(f.covered));
            EXPECT_LE(f.mean, limits.mean);
            EXPECT_LE(f.worst, limits.worst);
            EXPECT_LE(f.degrees, limits.degrees);
            if (!isTraced) EXPECT_GE(psnr, limits.psnr);
        };
        judge(*traced, "traced", true);
        for (const auto& [name, backend] : backends_)
            judge(test::draw({{store, {}, {}}}, *backend, *executor_, view, settings), name, false);
    }

    /// Discs on a square of edge 2 in the plane z = 0 that overlap.
    std::shared_ptr<const lod::Store> sheet() {
        std::vector<test::TestPoint> points;
        Rng rng(7);
        for (int y = 0; y < 80; ++y)
            for (int x = 0; x < 80; ++x) {
                const double u = (x + 0.5 + rng.uniform(-0.2, 0.2)) / 40 - 1,
                             v = (y + 0.5 + rng.uniform(-0.2, 0.2)) / 40 - 1;
                points.push_back({{u, v, 0}, {0, 0, 1}, 0x60a0c0, 0.03f});
            }
        test::writePly(folder_ / "sheet.ply", points, true, true);
        return test::buildAndOpen(folder_ / "sheet.ply", folder_ / "sheet.stipple", *executor_, 8192);
    }
};

TEST_F(Orthographic, DiscsLieInTheirPlane) {
    const auto store = sheet();
    const Meet meet = rayThroughDiscs(test::leafDiscs(*store));
    for (const double degrees : {0.0, 40.0, 70.0})
        expectTrue(store, look(degrees / 57.3, 0.1, 2.6), 2.6, meet, {0.01, 0.005, 0.02, 0.1, 25},
                   fmt::format("discs at {:.0f} degrees", degrees));
}

TEST_F(Orthographic, WideDiscsAreExact) {
    const auto store = sheet();
    const Meet meet = rayThroughDiscs(test::leafDiscs(*store));
    // Discs of 45 pixels: in the middle and at the sheet's corner.
    for (const dvec3& target : {dvec3(0), dvec3(0.98, 0.98, 0)})
        expectTrue(store, look(0.7, 0.3, 0.08, target), 0.08, meet, {0.002, 0.02, 0.05, 0.1, 40},
                   fmt::format("wide discs around {:.1f}", target.x));
}

TEST_F(Orthographic, FilledTubesAndRibbonsAreWhatRaysMeet) {
    for (const double ribbons : {0.0, 1.0}) {
        test::CurlRecipe recipe;
        recipe.count = 5;
        recipe.vertices = 12;
        recipe.radius = 0.12f;
        recipe.ribbons = ribbons;
        recipe.twist = 1;
        const auto store =
            test::buildCurves(test::curls(recipe), folder_ / fmt::format("{}.stipple", ribbons), *executor_);
        const Meet meet = rayThroughCurves(segmentsOf(*store));
        // (Balls have no bent normals: theirs are off by what a segment turns.)
        for (const double azimuth : {0.0, 1.1, 2.5})
            expectTrue(store, look(azimuth, 0.4, 3), 3, meet, {0.002, 0.005, 0.02, ribbons > 0 ? 0.5 : 5, 40},
                       fmt::format("{} from {}", ribbons > 0 ? "ribbons" : "tubes", azimuth));
    }
}

TEST_F(Orthographic, ReconstructedCurvesAreThoseOfTheOracle) {
    test::CurlRecipe recipe;
    recipe.count = 60;
    recipe.radius = 0.02f;
    const auto store = test::buildCurves(test::curls(recipe), folder_ / "curls.stipple", *executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    settings.wantDepthAndNormal = true;
    settings.draw.lit = true;
    for (const float exact : {2.0f, 100.0f}) {
        settings.draw.exactCurves = exact;
        const lod::View view = look(0.4, 0.3, 3);
        const auto truth = test::draw({{store, {}, {}}}, *oracle, *executor_, view, settings);
        for (const auto& [name, backend] : backends_) {
            const auto image = test::draw({{store, {}, {}}}, *backend, *executor_, view, settings);
            const auto d = reference::compareImages(image, truth, 4, nullptr);
            ASSERT_TRUE(d);
            EXPECT_GE(d->silhouetteIou, 0.995) << name;
            EXPECT_GE(d->foregroundPsnr, 40) << name << ' ' << exact;
        }
    }
}

TEST_F(Orthographic, TrianglesAreWhatRaysMeet) {
    for (const char* kind : {"rock", "building"}) {
        test::MeshRecipe recipe;
        recipe.grow.kind = kind;
        recipe.grow.triangles = 2000;
        recipe.grow.textureSize = 64;
        const auto store = test::growMeshStore(recipe, folder_ / (std::string(kind) + ".stipple"), *executor_);
        const auto& d = store->description;
        const dvec3 centre = 0.5 * (d.boundsMin + d.boundsMax);
        const double size = glm::length(d.boundsMax - d.boundsMin);
        lod::View view = look(0.6, 0.5, 1.1 * size, centre);
        view.eye = centre - view.forward * size;
        // (Normals are interpolated, and bumped by a texture.)
        expectTrue(store, view, 1.1 * size, rayThroughTriangles(test::leafTriangles(*store), false),
                   {0.001, 0.01, 0.05, 25, 38}, kind);
    }
}

#ifndef STIPPLE_ON_GPU
TEST_F(Orthographic, TheNearPlaneCutsWhereItIs) {
    test::MeshRecipe recipe;
    recipe.isTwoSided = true;
    recipe.grow.triangles = 2000;
    recipe.isTextured = false;
    const auto store = test::growMeshStore(recipe, folder_ / "cut.stipple", *executor_);
    const auto& d = store->description;
    const dvec3 centre = 0.5 * (d.boundsMin + d.boundsMax);
    const double size = glm::length(d.boundsMax - d.boundsMin);
    lod::View view = look(0.6, 0.5, size, centre);
    view.eye = centre;  // rays see the inside
    expectTrue(store, view, size, rayThroughTriangles(test::leafTriangles(*store), true), {0.001, 0.01, 0.05, 25, 38},
               "a rock from its middle");
}

TEST_F(Orthographic, FarAwayIsAsNear) {
    const auto points = sheet();
    test::CurlRecipe recipe;
    recipe.count = 30;
    recipe.radius = 0.06f;
    const auto curves = test::buildCurves(test::curls(recipe), folder_ / "far.stipple", *executor_);
    test::MeshRecipe rock;
    rock.grow.triangles = 2000;
    rock.isTextured = false;
    const auto mesh = test::growMeshStore(rock, folder_ / "rock.stipple", *executor_);
    render::FrameSettings settings;
    settings.wantDepthAndNormal = true;
    settings.draw.lit = true;
    settings.draw.worldUp = {0, 1, 0};
    const auto drawAt = [&](const dvec3& place, double back, render::Backend& backend) {
        lod::View view = look(0.5, 0.4, 3.5, place);
        view.eye -= view.forward * back;
        lod::Instance instance;
        instance.translation = place;
        return test::draw({{points, instance, {}}, {curves, instance, {}}, {mesh, instance, {}}}, backend, *executor_,
                          view, settings);
    };
    for (const auto& [name, backend] : backends_) {
        const auto near = drawAt(dvec3(0), 0, *backend);
        for (const auto& [place, back] :
             {std::pair{dvec3(500'000, 5'400'000, 300), 0.0}, {dvec3(0), 1e6}, {dvec3(500'000, 5'400'000, 300), 1e6}}) {
            const auto far = drawAt(place, back, *backend);
            const auto d = reference::compareImages(far, near, 2, nullptr);
            ASSERT_TRUE(d);
            EXPECT_GE(d->silhouetteIou, 0.9995) << name << ' ' << place.x << ' ' << back;
            EXPECT_GE(d->foregroundPsnr, 50) << name << ' ' << place.x << ' ' << back;
            size_t off = 0;
            for (size_t i = 0; i < near.depth.size(); ++i)  // a float of 1e6 has steps of 1/16
                off += near.depth[i] > 0 && far.depth[i] > 0 &&
                       std::abs(double{far.depth[i]} - back - double{near.depth[i]}) > (back > 0 ? 0.07 : 0.01);
            EXPECT_LE(off, 5u) << name << ' ' << place.x << ' ' << back;
        }
    }
}

TEST_F(Orthographic, CutsAreAsNearAsTheirPixelsSay) {
    test::MeshRecipe recipe;
    recipe.grow.triangles = 20000;
    recipe.isTextured = false;
    const auto mesh = test::growMeshStore(recipe, folder_ / "m.stipple", *executor_);
    test::writePly(folder_ / "s.ply", test::bumpySphere(20000, 3));
    const auto points = test::buildAndOpen(folder_ / "s.ply", folder_ / "s.stipple", *executor_);
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto leaves = test::leafTriangles(*mesh);
    const test::DiscField field(test::leafDiscs(*points));
    size_t coarser = 0;
    for (const double tau : {0.5, 2.0, 6.0})
        for (const double distance : {5.0, 5000.0}) {
            const double width = 6, pixel = width / kWidth;
            lod::View view = look(0.3, 0.4, width);
            view.eye = -view.forward * distance;  // it says nothing
            render::FrameSettings settings;
            settings.budgets.errorPixels = tau;
            auto state = render::makeFrameState({mesh}, *backend, *executor_, {});
            ASSERT_TRUE(*render::renderUntilComplete(*state, view, settings));
            const auto drawn = test::drawnTriangles(*mesh, state->cut.meshDraw);
            coarser += drawn.size() < leaves.size() ? 1 : 0;
            EXPECT_LE(test::largestDistance(drawn, leaves, 3000, 1), tau * pixel) << tau;
            state = render::makeFrameState({points}, *backend, *executor_, {});
            ASSERT_TRUE(*render::renderUntilComplete(*state, view, settings));
            double most = 0;
            for (const reference::Disc& disc : test::discsOfCut(*points, *state))
                most = std::max(most, field.distance(disc.position, 10));
            EXPECT_LE(most, tau * pixel) << tau;
            EXPECT_LE(state->cut.tauEffective, tau);
        }
    EXPECT_GE(coarser, 4u);
}

TEST_F(Orthographic, NothingBesideThePictureIsInTheCut) {
    test::writePly(folder_ / "s.ply", test::bumpySphere(20000, 3));
    const auto store = test::buildAndOpen(folder_ / "s.ply", folder_ / "s.stipple", *executor_);
    render::FrameSettings settings;
    settings.budgets.errorPixels = 0.25;
    // Tiles of the picture, put together, are the picture: culling leaves out nothing.
    const auto backend = cpu::makeCpuBackend(*executor_);
    settings.mode = render::Mode::points;
    const lod::View whole = look(0.3, 0.4, 3);
    FrameCounters all;
    const auto picture = test::draw({{store, {}, {}}}, *backend, *executor_, whole, settings, &all);
    lod::View part = whole;
    part.width = 40;
    part.height = 30;
    const double pixel = 3.0 / kWidth;
    size_t checked = 0;
    for (uint32_t y0 = 0; y0 + 30 <= kHeight; y0 += 30)
        for (uint32_t x0 = 0; x0 + 40 <= kWidth; x0 += 40) {
            part.eye =
                whole.eye + pixel * ((x0 + 20 - 0.5 * kWidth) * whole.right + (y0 + 15 - 0.5 * kHeight) * whole.down);
            FrameCounters counters;
            const auto tile = test::draw({{store, {}, {}}}, *backend, *executor_, part, settings, &counters);
            EXPECT_LT(counters.recordsDrawn, all.recordsDrawn);
            size_t differ = 0;
            for (uint32_t y = 0; y < 30; ++y)
                for (uint32_t x = 0; x < 40; ++x) {
                    const uint32_t c = picture.rgba[size_t{y0 + y} * kWidth + x0 + x];
                    checked += c >> 24 != 0 ? 1 : 0;
                    differ += tile.rgba[size_t{y} * 40 + x] != c ? 1 : 0;
                }
            EXPECT_LE(differ, 4u);  // points within rounding of a pixel's border
        }
    EXPECT_GE(checked, 2000u);
}
#endif

}  // namespace
}  // namespace stipple
