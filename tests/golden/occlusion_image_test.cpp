// Ambient occlusion: what the oracle says, what rays all around say, nothing on what is flat, and no crawling.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/constants.hpp>

#include "engine/reference/reference.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/mixed_store.h"
#include "tests/support/shapes.h"

namespace stipple {
namespace {

using glm::dvec3;
using render::FrameSettings;
using render::Image;
using test::lookingAt;
using test::Shapes;

/// Light from all around alone: a light of the scene's own that gives none.
FrameSettings inAmbientLight(double radius, bool isFull, render::Mode mode = render::Mode::surface) {
    FrameSettings s = test::drawnAs(mode, 1);
    render::WorldLight none;
    none.colour = glm::vec3(0);
    s.draw.lights = {none};
    s.draw.parameters.occlusion = {radius, isFull ? 1.0 : 0.0};
    if (radius > 0) s.draw.effects = {"occlusion"};
    return s;
}

class AmbientOcclusion : public test::BackendsHere {
  protected:
    /// What of the light gets to each pixel: the picture with it over the one without; -1 where nothing is seen.
    std::vector<double> openness(const std::shared_ptr<const lod::Store>& store, const lod::View& view, double radius,
                                 bool isFull, render::Mode mode = render::Mode::surface) {
        const Image with = draw(store, usual(), view, inAmbientLight(radius, isFull, mode)),
                    without = draw(store, usual(), view, inAmbientLight(0, isFull, mode));
        std::vector<double> open(with.rgba.size(), -1);
        for (size_t i = 0; i < open.size(); ++i)
            if (without.depth[i] > 0) open[i] = double(with.linear[3 * i]) / double(without.linear[3 * i]);
        return open;
    }
    Image draw(const std::shared_ptr<const lod::Store>& store, render::Backend& backend, const lod::View& view,
               const FrameSettings& settings) {
        return test::renderView(store, backend, *executor_, view, settings);
    }
    /// Share of the pixels with a channel more than 3 of 255 apart.
    static double unlike(const Image& a, const Image& b) {
        size_t count = 0;
        for (size_t i = 0; i < a.rgba.size(); ++i) {
            bool isUnlike = false;
            for (uint32_t shift = 0; shift < 32; shift += 8)
                isUnlike = isUnlike || std::abs(int(a.rgba[i] >> shift & 255u) - int(b.rgba[i] >> shift & 255u)) > 3;
            count += isUnlike ? 1 : 0;
        }
        return double(count) / double(a.rgba.size());
    }
    static std::vector<lod::View> bothViews(const dvec3& target, const dvec3& from) {
        return {lookingAt(target, from), lookingAt(target, from, true)};
    }
};

TEST_F(AmbientOcclusion, IsWhatTheOracleDraws) {
    Shapes floor;
    floor.square({0, 0, -1}, {4, 0, 0}, {0, 4, 0});
    test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 3));
    std::vector<render::PlacedStore> placed{
        {test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_), {}, {}},
        {test::buildCurves(test::curls({.count = 40, .radius = 0.06f}), folder_ / "b.stipple", *executor_), {}, {}},
        {floor.built(folder_ / "c.stipple", *executor_), {}, {}}};
    placed[1].place.translation = {1.7, 0.4, 0};
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Reconstruction& mode : render::reconstructions())
        for (lod::View view : bothViews({0.5, 0, -0.3}, {0, -5, 3}))
            for (const bool isFull : {false, true}) {
                view.width = 160;
                view.height = 120;
                FrameSettings settings = inAmbientLight(0.6, isFull, mode.mode);
                const Image truth = test::draw(placed, *oracle, *executor_, view, settings);
                for (auto& [name, backend] : backends_) {
                    const Image image = test::draw(placed, *backend, *executor_, view, settings);
                    const auto off = reference::compareImages(image, truth, 4, nullptr);
                    const std::string what =
                        fmt::format("{}, mode {}, parallel {}, full {}", name, mode.name, view.isOrthographic, isFull);
                    ASSERT_TRUE(off) << what;
                    EXPECT_GE(off->psnr, 50) << what;
                    EXPECT_LE(off->differingFraction, 1e-3) << what;
                }
                settings.draw.effects.clear();
                EXPECT_GT(unlike(test::draw(placed, *oracle, *executor_, view, settings), truth), 0.02)
                    << "(it is seen)";
            }
}

TEST_F(AmbientOcclusion, WhatIsFlatIsOpen) {
    Shapes shapes;
    shapes.square({0, 0, 0}, {8, 0, 0}, {0, 8, 0});
    std::vector<test::TestPoint> points;
    for (int y = -200; y <= 200; ++y)
        for (int x = -200; x <= 200; ++x) points.push_back({dvec3(0.04 * x, 0.04 * y, 0), {0, 0, 1}, 0xc0c0c0});
    test::writePly(folder_ / "p.ply", points);
    for (const auto& store : {shapes.built(folder_ / "t.stipple", *executor_),
                              test::buildAndOpen(folder_ / "p.ply", folder_ / "p.stipple", *executor_)})
        for (const double height : {0.7, 3.0, 9.0})  // seen at 13, 45 and 72 degrees
            for (const lod::View& view : bothViews({0, 0, 0}, {0, -3, height}))
                for (const bool isFull : {false, true}) {
                    size_t seen = 0;
                    double least = 1;
                    for (const double open : openness(store, view, 0.5, isFull)) {
                        seen += open >= 0 ? 1 : 0;
                        if (open >= 0) least = std::min(least, open);
                    }
                    EXPECT_GT(seen, 5'000u);
                    // Colours of the surface buffer are rounded by a thousandth; 254 of 255 is four of them.
                    EXPECT_GT(least, 1 - 2.5e-3) << "from " << height << (view.isOrthographic ? ", orthographic" : "");
                }
}

/// What rays from a place meet first.
using Trace = std::function<double(const dvec3& origin, const dvec3& direction)>;
double onPlane(const dvec3& o, const dvec3& d, int axis, double at) {
    const double t = (at - o[axis]) / d[axis];
    return t > 1e-9 ? t : HUGE_VAL;
}

/// By rays all around, in the light's own proportion: what hides it hides less of it from afar.
double tracedOpenness(const dvec3& place, const dvec3& normal, double radius, const Trace& trace) {
    constexpr int kRays = 48;
    constexpr double kOff = 1e-4;  // places are made of depths in fp32: what is flat must not hide itself
    const dvec3 aside = glm::normalize(glm::cross(normal, std::abs(normal.x) < 0.7 ? dvec3(1, 0, 0) : dvec3(0, 1, 0))),
                along = glm::cross(normal, aside);
    double hidden = 0;
    for (int i = 0; i < kRays * kRays; ++i) {
        const double u = (i % kRays + 0.5) / kRays, a = 2 * glm::pi<double>() * (i / kRays + 0.5) / kRays;
        const dvec3 d = std::sqrt(u) * (std::cos(a) * aside + std::sin(a) * along) + std::sqrt(1 - u) * normal;
        const double t = trace(place + kOff * normal, d);
        hidden += t < radius ? 1 - t * t / (radius * radius) : 0;
    }
    return 1 - hidden / (kRays * kRays);
}

/// Of pixels of one or more pictures, how far they are from what rays say.
class Difference {
  public:
    /// Of one pixel of seven, so that each place of the pattern (of four by four) is met.
    void add(const Image& geometry, const std::vector<double>& open, const lod::View& view, double radius,
             const Trace& trace) {
        for (size_t i = 0; i < open.size(); i += 7) {
            if (open[i] < 0) continue;
            const double x = double(i % view.width) + 0.5 - 0.5 * view.width,
                         y = double(i / view.width) + 0.5 - 0.5 * view.height;
            const dvec3 ray = view.forward + x / view.focalPixels * view.right + y / view.focalPixels * view.down;
            const dvec3 n(geometry.normal[3 * i], geometry.normal[3 * i + 1], geometry.normal[3 * i + 2]);
            const double truth = tracedOpenness(view.eye + double(geometry.depth[i]) * ray, n, radius, trace);
            off_.push_back(std::abs(open[i] - truth));
            sum_ += off_.back();
            hidden_ += 1 - truth;
        }
    }
    size_t pixels() const { return off_.size(); }
    double mean() const { return sum_ / double(off_.size()); }
    double blind() const { return hidden_ / double(off_.size()); }  ///< the mean where nothing is computed
    double p95() {
        std::sort(off_.begin(), off_.end());
        return off_[off_.size() * 95 / 100];
    }

  private:
    std::vector<double> off_;
    double sum_ = 0, hidden_ = 0;
};

TEST_F(AmbientOcclusion, IsNearWhatRaysAllAroundSay) {
    constexpr double kRadius = 1;
    Shapes ball, corner;
    ball.square({0, 0, 0}, {6, 0, 0}, {0, 6, 0});
    ball.ball({0, 0, 1}, 1);
    corner.square({0, 0, 0}, {6, 0, 0}, {0, 6, 0});
    corner.square({0, 6, 0}, {6, 0, 0}, {0, 0, 6});
    corner.square({-6, 0, 0}, {0, 6, 0}, {0, 0, 6});
    const Trace onBall = [](const dvec3& o, const dvec3& d) {
        const dvec3 c = o - dvec3(0, 0, 1);
        const double b = glm::dot(c, d), root = b * b - (glm::dot(c, c) - 1);
        const double t = root > 0 ? -b - std::sqrt(root) : -1;
        return std::min(t > 1e-6 ? t : HUGE_VAL, onPlane(o, d, 2, 0));
    };
    const Trace onCorner = [](const dvec3& o, const dvec3& d) {
        return std::min({onPlane(o, d, 0, -6), onPlane(o, d, 1, 6), onPlane(o, d, 2, 0)});
    };
    struct Case {
        const char* name;
        Shapes& shapes;
        const Trace& trace;
        dvec3 target, from;
    };
    // The 95th percentile of one picture goes from 0.054 to 0.060 with where the pattern falls on the ball's borders:
    // that of four pictures is of what is computed, not of where the camera stands.
    for (const Case& c : {Case{"sphere on a plane", ball, onBall, {0, 0, 0.6}, {0, -5, 2.5}},
                          Case{"corner of a box", corner, onCorner, {-5, 5, 0.7}, {-2, 1, 3}}}) {
        const auto store = c.shapes.built(folder_ / "s.stipple", *executor_);
        for (const bool isFull : {false, true}) {
            Difference d;
            for (const double aside : {0.0, 0.01, 0.02, 0.03}) {
                const lod::View view = lookingAt(c.target + dvec3(aside, 0, 0), c.from + dvec3(aside, 0, 0));
                const Image geometry = draw(store, usual(), view, inAmbientLight(0, true));
                d.add(geometry, openness(store, view, kRadius, isFull), view, kRadius, c.trace);
            }
            ASSERT_GT(d.pixels(), 4'000u);
            const double p95 = d.p95();
            fmt::print("{}, {}: mean {:.4f}, p95 {:.4f} of the light off ({} pixels; without it {:.4f})\n", c.name,
                       isFull ? "full" : "half", d.mean(), p95, d.pixels(), d.blind());
            EXPECT_LT(d.mean(), 0.015);
            EXPECT_LT(p95, 0.06);
            EXPECT_LT(d.mean(), 0.35 * d.blind()) << "it has to be worth something";
        }
    }
}

/// The pattern stands still on the screen: where a picture moves by whole pixels below it, what is left of the pattern
/// after the mean is what changes.
TEST_F(AmbientOcclusion, DoesNotCrawlWhereTheCameraPans) {
    Shapes shapes;
    shapes.square({0, 0, 0}, {6, 0, 0}, {0, 6, 0});
    shapes.ball({0, 0, 1}, 1);
    const auto store = shapes.built(folder_ / "s.stipple", *executor_);
    const lod::View view = lookingAt({0, 0, 0.6}, {0, -5, 2.5});
    for (const bool isFull : {false, true}) {
        const Image still = draw(store, usual(), view, inAmbientLight(1, isFull));
        for (const glm::ivec2 pan : {glm::ivec2(1, 0), glm::ivec2(2, 1), glm::ivec2(0, 3)}) {
            lod::View moved = view;
            moved.shift = glm::dvec2(pan);
            const Image now = draw(store, usual(), moved, inAmbientLight(1, isFull));
            std::vector<double> change;
            double mean = 0;
            for (int y = 8; y < int(view.height) - 8; ++y)
                for (int x = 8; x < int(view.width) - 8; ++x) {
                    const auto from = size_t(y) * view.width + size_t(x),
                               to = size_t(y + pan.y) * view.width + size_t(x + pan.x);
                    if (!(still.depth[from] > 0)) continue;
                    ASSERT_NEAR(now.depth[to] / still.depth[from], 1, 1e-4) << "the picture is the same one, moved";
                    change.push_back(std::abs(double(now.linear[3 * to]) - double(still.linear[3 * from])) /
                                     double(still.linear[3 * from]));
                    mean += change.back();
                }
            ASSERT_GT(change.size(), 5'000u);
            mean /= double(change.size());
            std::sort(change.begin(), change.end());
            const double p95 = change[change.size() * 95 / 100], p99 = change[change.size() * 99 / 100];
            fmt::print("pan {}, {}, {}: mean {:.4f}, p95 {:.4f}, p99 {:.4f}\n", pan.x, pan.y, isFull ? "full" : "half",
                       mean, p95, p99);
            // Half of what it may be off the truth on the mean; no more than that at p95.
            EXPECT_LT(mean, 0.0075);
            EXPECT_LT(p95, 0.06);
        }
    }
}

TEST_F(AmbientOcclusion, OfAnyRadiusIsAPictureAndOfNoPixelIsNothing) {
    test::writeMixedStore(folder_ / "m.stipple");
    const auto store = std::make_shared<const lod::Store>(*lod::openStore(folder_ / "m.stipple"));
    const lod::View view = test::fitView(*store, 160, 120);
    const auto state = render::makeFrameState({store}, usual(), *executor_, {});
    for (const double radius : {-1.0, double(NAN), double(INFINITY), 1e300, 1e15})
        for (const bool isFull : {false, true}) {
            FrameSettings s = inAmbientLight(1, isFull);
            s.draw.parameters.occlusion.radius = radius;
            s.wantDepthAndNormal = true;
            ASSERT_TRUE(render::renderUntilComplete(*state, view, s)) << radius;
            for (const float x : state->image.linear) ASSERT_TRUE(x >= 0 && x <= 1) << radius;
        }
    const FrameSettings little = inAmbientLight(1e-9, false);
    ASSERT_TRUE(render::renderUntilComplete(*state, view, little));
    const auto passes = state->counters.passes;
    const Image image = state->image;
    ASSERT_TRUE(render::renderUntilComplete(*state, view, inAmbientLight(0, false)));
    EXPECT_EQ(state->counters.passes, passes);
    EXPECT_TRUE(state->image.rgba == image.rgba && state->image.linear == image.linear);
}

}  // namespace
}  // namespace stipple
