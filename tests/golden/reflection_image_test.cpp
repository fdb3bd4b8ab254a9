// Reflections of the screen: what a mirror shows and where, what it does not, and that nothing of it comes at once.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/reference/reference.h"
#include "engine/render/effect_status.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/mixed_store.h"
#include "tests/support/shapes.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;
using render::FrameSettings;
using render::Image;
using test::lookingAt;
using test::Shapes;

constexpr double kRadius = 0.7;
/// Frames with the effect keep the surface buffer, whose colours and normals are rounded.
constexpr double kRounding = 2e-3;
const dvec3 kMiddle{0.1, 0.6, 1.3}, kColour{0.8, 0.06, 0.1};

scene::Material mirror(float roughness, float metallic = 1) {
    scene::Material m;
    m.baseColour = {0.95f, 0.95f, 0.95f, 1};
    m.roughness = roughness;
    m.metallic = metallic;
    return m;
}
/// It sends that colour whatever falls on it.
scene::Material glowing(const dvec3& colour = kColour) {
    scene::Material m;
    m.baseColour = glm::vec4(glm::vec3(colour), 1);
    m.isUnlit = true;
    return m;
}
Shapes ballAbove(const scene::Material& floor) {
    Shapes shapes;
    shapes.paint(floor);
    shapes.square({0, 0, 0}, {6, 0, 0}, {0, 6, 0});
    shapes.paint(glowing());
    shapes.ball(kMiddle, kRadius);
    return shapes;
}
FrameSettings with(bool isOn, render::Mode mode = render::Mode::surface) {
    FrameSettings s = test::drawnAs(mode, 1);
    s.draw.parameters.reflection.distance = 100;
    if (isOn) s.draw.effects = {"reflection"};
    return s;
}
dvec3 linearAt(const Image& image, size_t i) {
    return {image.linear[3 * i], image.linear[3 * i + 1], image.linear[3 * i + 2]};
}
double most(const dvec3& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

struct PlaceAndRay {
    dvec3 place, ray;  ///< ray: from the eye there, unit
};
PlaceAndRay seenAt(const Image& image, const lod::View& v, size_t i) {
    const dvec2 at = (dvec2(double(i % v.width) + 0.5, double(i / v.width) + 0.5) - v.principal()) / v.focalPixels;
    const dvec3 aside = at.x * v.right + at.y * v.down;
    const double depth = image.depth[i];
    if (v.isOrthographic) return {v.eye + aside + depth * v.forward, v.forward};
    return {v.eye + depth * (v.forward + aside), glm::normalize(v.forward + aside)};
}
/// Of a ray to the ball: how near it comes to its middle, and where it meets it (or HUGE_VAL).
struct ToBall {
    double nearest, way;
};
ToBall toBall(const dvec3& from, const dvec3& direction) {
    const dvec3 to = kMiddle - from;
    const double along = glm::dot(to, direction), nearest = std::sqrt(glm::dot(to, to) - along * along);
    if (along < 0 || nearest > kRadius) return {along < 0 ? HUGE_VAL : nearest, HUGE_VAL};
    return {nearest, along - std::sqrt(kRadius * kRadius - nearest * nearest)};
}

class ScreenReflections : public test::BackendsHere {
  protected:
    Image draw(const std::shared_ptr<const lod::Store>& store, render::Backend& backend, const lod::View& view,
               const FrameSettings& settings) {
        return test::renderView(store, backend, *executor_, view, settings);
    }
    std::shared_ptr<const lod::Store> built(const Shapes& shapes) {
        return shapes.built(folder_ / fmt::format("{}.stipple", ++stores_), *executor_);
    }
    /// What it adds to each pixel, linear.
    std::vector<dvec3> added(const std::shared_ptr<const lod::Store>& store, const lod::View& view) {
        const Image on = draw(store, usual(), view, with(true)), off = draw(store, usual(), view, with(false));
        std::vector<dvec3> out;
        for (size_t i = 0; i < on.rgba.size(); ++i) out.push_back(linearAt(on, i) - linearAt(off, i));
        return out;
    }
    int stores_ = 0;
};

/// Of the floor's pixels: the mirror image of the ball is there where rays say that the mirror sees a side of it that
/// the camera sees, too, in the ball's colour; elsewhere nothing has changed.
TEST_F(ScreenReflections, AMirrorShowsTheBallWhereRaysSay) {
    const auto store = built(ballAbove(mirror(0.02f)));
    for (const bool isOrthographic : {false, true})
        for (const auto& [name, backend] : backends_) {
            const lod::View view = lookingAt({0, 0.6, 0.6}, {0, -6, 1.6}, isOrthographic);
            const Image on = draw(store, *backend, view, with(true)), off = draw(store, *backend, view, with(false));
            EXPECT_TRUE(on.depth == off.depth) << name << ": light is all that it changes";
            ASSERT_EQ(on.normal.size(), off.normal.size());
            for (size_t k = 0; k < on.normal.size(); ++k) ASSERT_NEAR(on.normal[k], off.normal[k], kRounding) << name;
            size_t shown = 0, wrong = 0, beside = 0, changed = 0;
            double farthest = 0;
            for (size_t i = 0; i < on.rgba.size(); ++i) {
                if (!(off.depth[i] > 0)) continue;
                const auto [place, ray] = seenAt(off, view, i);
                const dvec3 more = linearAt(on, i) - linearAt(off, i);
                if (std::abs(place.z) > 1e-3) {
                    EXPECT_LT(most(more), kRounding) << "the ball is no mirror";
                    continue;
                }
                const dvec3 up(ray.x, ray.y, -ray.z);
                const ToBall ball = toBall(place, up);
                const double pixel = (view.isOrthographic ? 1 : double(off.depth[i])) / view.focalPixels;
                const dvec3 n = glm::normalize(place + std::min(ball.way, 1e6) * up - kMiddle);
                const dvec3 met = place + std::min(ball.way, 1e6) * up,
                            toEye = view.isOrthographic ? -view.forward : glm::normalize(view.eye - met);
                if (ball.way < 1e6 && ball.nearest < kRadius - 3 * pixel && glm::dot(n, toEye) > 0.15 &&
                    glm::dot(n, up) < -0.3) {
                    ++shown;
                    // What it shows in the place of the sky, by each channel.
                    const double sky = 0.25 + 0.15 * (0.98 * up.z + 0.02);
                    const dvec3 share = more / (kColour - sky);
                    const bool isRight = most(share - share.y) < 0.02 && share.y > 0.85 && share.y < 1;
                    farthest = std::max(farthest, std::abs(share.y - 0.95));
                    wrong += isRight ? 0 : 1;
                } else if (ball.nearest > kRadius + 3 * pixel) {
                    ++beside;
                    changed += most(more) > kRounding ? 1 : 0;
                }
            }
            const std::string what = fmt::format("{}, parallel {}", name, isOrthographic);
            fmt::print("{}: {} pixels show the ball, {} not so; {} beside it, {} changed; share at most {:.3f} off\n",
                       what, shown, wrong, beside, changed, farthest);
            EXPECT_GT(shown, 200u) << what;
            EXPECT_LE(wrong, shown / 100) << what << ": it fades";
            EXPECT_GT(beside, 5'000u) << what;
            EXPECT_LE(changed, beside / 2000) << what;
        }
}

TEST_F(ScreenReflections, GoWithRoughnessAndAreNothingBeyondTheRoughest) {
    const lod::View view = lookingAt({0, 0.6, 0.6}, {0, -6, 1.6});
    double before = HUGE_VAL;
    for (const float roughness : {0.02f, 0.15f, 0.2f, 0.25f, 0.29f}) {
        double sum = 0;
        for (const dvec3& c : added(built(ballAbove(mirror(roughness))), view)) sum += most(c);
        EXPECT_LT(sum, 0.95 * before) << roughness;
        EXPECT_GT(sum, 0) << roughness;
        before = sum;
    }
    // Beyond it, on what keeps its colours, and where nothing is lit: no pass, and the same picture.
    scene::Material unlit = mirror(0);
    unlit.isUnlit = true;
    for (const scene::Material& floor : {mirror(0.305f), mirror(1), unlit}) {
        const auto store = built(ballAbove(floor));
        const auto state = render::makeFrameState({store}, usual(), *executor_, {});
        ASSERT_TRUE(render::renderUntilComplete(*state, view, with(false)));
        const Image off = state->image;
        const auto passes = state->counters.passes;
        ASSERT_TRUE(render::renderUntilComplete(*state, view, with(true)));
        for (size_t i = 0; i < off.rgba.size(); ++i)
            ASSERT_LT(most(linearAt(state->image, i) - linearAt(off, i)), kRounding) << i;
        if (floor.isUnlit) continue;
        EXPECT_TRUE(state->image.rgba == off.rgba && state->image.linear == off.linear);
        EXPECT_EQ(state->counters.passes, passes);
    }
}

/// In whatever is smooth: triangles, points, patches; of whatever is seen.
class MirrorsOfAllKinds : public ScreenReflections {
  protected:
    std::vector<render::PlacedStore> placed() {
        Shapes floor;
        floor.paint(mirror(0.05f));
        floor.square({0, 0, -1}, {4, 0, 0}, {0, 4, 0});
        floor.paint(mirror(0.15f, 0));
        floor.ball({-1.6, 0.8, -0.2}, 0.6);
        test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 3));
        std::vector<render::PlacedStore> out{
            {test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_), {}, {}},
            {test::buildCurves(test::curls({.count = 40, .radius = 0.06f}), folder_ / "b.stipple", *executor_), {}, {}},
            {built(floor), {}, {}}};
        out[1].place.translation = {1.7, 0.4, 0};
        return out;
    }
};

/// Steps of a pixel and less: the oracle goes from pixel to pixel.
constexpr double kOfAPixel = 240;

/// Shares of the pixels with a channel more than 12 and more than 64 of 255 apart.
struct Unlike {
    double some = 0, much = 0;
};
Unlike unlike(const Image& a, const Image& b) {
    Unlike u;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        int off = 0;
        for (uint32_t shift = 0; shift < 24; shift += 8)
            off = std::max(off, std::abs(int(a.rgba[i] >> shift & 255u) - int(b.rgba[i] >> shift & 255u)));
        u.some += off > 12 ? 1 : 0;
        u.much += off > 64 ? 1 : 0;
    }
    return {u.some / double(a.rgba.size()), u.much / double(a.rgba.size())};
}

TEST_F(MirrorsOfAllKinds, AreThoseOfTheOracleInEveryMode) {
    const auto placed = this->placed();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Reconstruction& mode : render::reconstructions())
        for (const bool isOrthographic : {false, true})
            for (const bool areAllMirrors : {false, true}) {
                lod::View view = lookingAt({0.5, 0, -0.3}, {0, -5, 2}, isOrthographic);
                view.width = 160;
                view.height = 120;
                FrameSettings settings = with(true, mode.mode), without = with(false, mode.mode);
                settings.draw.parameters.reflection.steps = kOfAPixel;
                for (FrameSettings* s : {&settings, &without}) {
                    s->draw.lit = true;
                    if (areAllMirrors) s->draw.pointMaterial = shared::packPointMaterial(0.05f, 1);
                }
                const Image truth = test::draw(placed, *oracle, *executor_, view, settings),
                            blind = test::draw(placed, *oracle, *executor_, view, without);
                EXPECT_GT(unlike(truth, blind).some, 0.03) << "(it is seen)";
                for (auto& [name, backend] : backends_) {
                    const Image image = test::draw(placed, *backend, *executor_, view, settings);
                    const Unlike u = unlike(image, truth);
                    const std::string what = fmt::format("{}, mode {}, parallel {}, points mirror {}", name, mode.name,
                                                         isOrthographic, areAllMirrors);
                    fmt::print("{}: {:.4f} and {:.4f} of the pixels unlike ({:.4f} without it)\n", what, u.some, u.much,
                               unlike(truth, blind).some);
                    EXPECT_LE(u.some, 0.015) << what;
                    EXPECT_LE(u.much, 0.006) << what;
                }
            }
}

TEST_F(MirrorsOfAllKinds, OfPatchesAndShadowsAreThoseOfTheOracle) {
    test::writeMixedStore(folder_ / "m.stipple");
    const auto store = std::make_shared<const lod::Store>(*lod::openStore(folder_ / "m.stipple"));
    const auto oracle = reference::makeReferenceBackend(*executor_);
    const lod::View view = test::fitView(*store, 160, 120);
    for (const bool isShadowed : {false, true}) {
        FrameSettings s = with(true);
        s.draw.parameters.reflection.steps = kOfAPixel;
        s.draw.lit = true;
        s.draw.pointMaterial = shared::packPointMaterial(0.05f, 1);
        if (isShadowed) {
            render::WorldLight sun;
            sun.kind = shared::kLightDirectional;
            sun.direction = glm::normalize(dvec3(0.6, 0.5, -0.8));
            sun.castsShadow = true;
            s.draw.lights = {sun};
            s.draw.effects.emplace_back("shadow");
        }
        const Image truth = draw(store, *oracle, view, s);
        for (auto& [name, backend] : backends_) {
            const Unlike u = unlike(draw(store, *backend, view, s), truth);
            fmt::print("{}, shadows {}: {:.4f} and {:.4f} of the pixels unlike\n", name, isShadowed, u.some, u.much);
            EXPECT_LE(u.some, 0.01) << name;
        }
    }
}

/// The camera turns until the ball has left the picture through its border: what mirrors show of it fades on the way
/// and does not vanish at once.
TEST_F(ScreenReflections, FadeWhereTheCameraMoves) {
    const auto store = built(ballAbove(mirror(0.02f)));
    constexpr int kViews = 120;
    std::vector<double> sums;
    double largest = 0, step = 0;
    for (int k = 0; k < kViews; ++k) {
        lod::View view = lookingAt({0, 0.6, 0.6}, {0, -6, 1.6});
        view.shift = dvec2(0, -1.5 * k);  // the ball leaves at the top before its mirror image does
        double sum = 0;
        for (const dvec3& c : added(store, view)) sum += most(c);
        if (!sums.empty()) step = std::max(step, std::abs(sum - sums.back()));
        largest = std::max(largest, sum);
        sums.push_back(sum);
    }
    fmt::print("a step of 1.5 px changes what is mirrored by {:.3f} of it at most; last {:.3f}\n", step / largest,
               sums.back() / largest);
    EXPECT_LT(step, 0.1 * largest);
    EXPECT_LT(sums.back(), 0.02 * largest) << "it has left";
}

/// From one view to one next to it pixels change no more than by what moves in them.
TEST_F(ScreenReflections, DoNotJumpBetweenTwoNearViews) {
    const auto store = built(ballAbove(mirror(0.02f)));
    std::vector<double> change;
    Image before;
    for (int k = 0; k < 12; ++k) {
        const lod::View view = lookingAt({0, 0.6, 0.6}, {0.004 * k, -6, 1.6});
        const Image now = draw(store, usual(), view, with(true));
        for (size_t i = 0; k > 0 && i < now.rgba.size(); ++i)
            if (now.depth[i] > 0) change.push_back(most(linearAt(now, i) - linearAt(before, i)));
        before = now;
    }
    std::sort(change.begin(), change.end());
    const double p99 = change[change.size() * 99 / 100], p999 = change[change.size() * 999 / 1000];
    fmt::print("change between views 0.15 px apart: p99 {:.4f}, p99.9 {:.4f}\n", p99, p999);
    EXPECT_LT(p99, 0.05);
    EXPECT_LT(p999, 0.25);
}

TEST_F(ScreenReflections, OfAnyDistanceAndNumberOfStepsAreAPicture) {
    const auto store = built(ballAbove(mirror(0.02f)));
    const lod::View view = lookingAt({0, 0.6, 0.6}, {0, -6, 1.6});
    for (const double value : {-1.0, 0.0, double(NAN), double(INFINITY), 1e300, 1e-30, 3.5})
        for (const bool isSteps : {false, true}) {
            FrameSettings s = with(true);
            (isSteps ? s.draw.parameters.reflection.steps : s.draw.parameters.reflection.distance) = value;
            for (const float x : draw(store, usual(), view, s).linear) ASSERT_TRUE(x >= 0 && x <= 2) << value;
        }
    FrameSettings near = with(true);
    near.draw.parameters.reflection.distance = 0.3;
    const Image off = draw(store, usual(), view, with(false)), on = draw(store, usual(), view, near);
    for (size_t i = 0; i < off.rgba.size(); ++i)
        ASSERT_LT(most(linearAt(on, i) - linearAt(off, i)), kRounding)
            << "the ball is farther from the floor than that";
}

#ifndef STIPPLE_ON_GPU
TEST_F(ScreenReflections, AreCalledForWhereOpaqueMaterialsAreSmooth) {
    scene::Material glass = mirror(0, 0);
    glass.optics = *lod::opticsNamed("glass");
    const auto call = [&](const scene::Material& floor, const render::DrawSettings& s) {
        const std::vector<std::shared_ptr<const lod::Store>> stores{built(ballAbove(floor))};
        return render::factsOf(stores, s).hasMirrors;
    };
    render::DrawSettings unlit;
    unlit.unlitTriangles = true;
    EXPECT_TRUE(call(mirror(0.29f), {}));
    EXPECT_TRUE(call(mirror(0.29f, 0), {})) << "no metal, but a mirror where it is seen at grazing angles";
    EXPECT_FALSE(call(mirror(0.31f), {}));
    EXPECT_FALSE(call(mirror(0.1f), unlit));
    EXPECT_FALSE(call(glass, {}));
}

TEST_F(MirrorsOfAllKinds, AreTheSameBytesForAnyThreadsAndOnEveryInstructionSet) {
    const auto placed = this->placed();
    const lod::View view = lookingAt({0.5, 0, -0.3}, {0, -5, 2});
    FrameSettings settings = with(true);
    settings.draw.lit = true;
    settings.draw.pointMaterial = shared::packPointMaterial(0.05f, 1);
    const Image first = test::draw(placed, usual(), *executor_, view, settings);
    for (const unsigned threads : {1u, 3u}) {
        const auto executor = makeTbbExecutor(threads);
        const auto backend = cpu::makeCpuBackend(*executor);
        EXPECT_TRUE(test::draw(placed, *backend, *executor, view, settings).rgba == first.rgba) << threads;
    }
    size_t count = 0;
    const cpu::Kernels* const* const tables = cpu::availableKernels(count);
    for (size_t t = 0; t < count; ++t) {
        const auto backend = cpu::makeCpuBackend(*executor_, tables[t]);
        EXPECT_TRUE(test::draw(placed, *backend, *executor_, view, settings).rgba == first.rgba) << tables[t]->name;
    }
}
#endif

}  // namespace
}  // namespace stipple
