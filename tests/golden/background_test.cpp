// The environment's picture behind everything: against functions of the direction that the pictures are made of, the
// directions computed from angles, in perspective and parallel views; on edges, in layers and under tone against one
// colour in its place; and against fp64 on every kind in every mode.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "engine/reference/reference.h"
#include "engine/render/accumulation.h"
#include "engine/render/backdrop.h"
#include "engine/scene/camera.h"
#include "tests/support/backends_here.h"
#include "tests/support/effect_scenes.h"

namespace stipple::render {
namespace {

using glm::dvec3;
using Light = std::function<dvec3(const dvec3& direction)>;

constexpr double kPi = 3.14159265358979323846;

/// Of a picture of the world whose y is up: columns from behind over the left (-x), ahead (-z), the right and behind.
HdrImage panorama(uint32_t width, uint32_t height, const Light& light) {
    HdrImage image{width, height, {}};
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const double around = 2 * kPi * (x + 0.5) / width, down = kPi * (y + 0.5) / height;
            const dvec3 c =
                light({-std::sin(down) * std::sin(around), std::cos(down), std::sin(down) * std::cos(around)});
            for (int k = 0; k < 3; ++k) image.rgb.push_back(static_cast<float>(c[k]));
        }
    return image;
}
/// Another value on every axis and on both sides of it.
dvec3 slanted(const dvec3& d) { return {0.5 + 0.4 * d.x, 0.5 + 0.4 * d.y, 0.5 + 0.4 * d.z}; }

class BackgroundImages : public test::BackendsHere {
  protected:
    std::shared_ptr<const Backdrop> backdrop(const HdrImage& image, float scale = 1) {
        return std::make_shared<const Backdrop>(makeBackdrop(image, scale, *executor_));
    }
    std::shared_ptr<const Backdrop> even(float grey) {
        return backdrop({16, 8, std::vector<float>(size_t{3} * 16 * 8, grey)});
    }
    std::vector<PlacedStore>& scene() {
        if (placed_.empty()) placed_ = test::effectStores(folder_.path(), *executor_);
        return placed_;
    }
    static FrameSettings plain() {
        FrameSettings s;
        s.draw.worldUp = {0, 1, 0};
        s.draw.unlitTriangles = true;
        s.wantDepthAndNormal = true;
        s.budgets.errorPixels = 1;
        return s;
    }
    Image draw(Backend& backend, const lod::View& view, const FrameSettings& s) {
        return test::draw(scene(), backend, *executor_, view, s);
    }
    static dvec3 at(const Image& image, size_t pixel) {
        return {image.linear[3 * pixel], image.linear[3 * pixel + 1], image.linear[3 * pixel + 2]};
    }
    static lod::View towards(const dvec3& direction, double fov, uint32_t width = 48, uint32_t height = 32) {
        scene::Camera camera;
        camera.eye = {0.4, 1.2, 5};
        camera.target = camera.eye + direction;
        camera.up = std::abs(direction.y) > 0.9 * glm::length(direction) ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
        camera.fovDegrees = fov;
        return scene::makeView(camera, width, height, 0.02);
    }
    /// The direction of a pixel's ray: by the angles between it and the axes of the view.
    static dvec3 rayOf(const lod::View& v, size_t pixel) {
        const double x = double(pixel % v.width) + 0.5 - 0.5 * v.width,
                     y = double(pixel / v.width) + 0.5 - 0.5 * v.height;
        if (v.isOrthographic) return v.forward;
        const double off = std::atan(std::hypot(x, y) / v.focalPixels), turn = std::atan2(y, x);
        return std::cos(off) * v.forward + std::sin(off) * (std::cos(turn) * v.right + std::sin(turn) * v.down);
    }
    /// The farthest of any pixel that nothing covers from `light` in its direction, and how many there are.
    struct Off {
        double most = 0;
        size_t pixels = 0;
    };
    static Off offFrom(const Image& image, const lod::View& view, const Light& light) {
        Off off;
        for (size_t i = 0; i < image.rgba.size(); ++i) {
            if (image.rgba[i] >> 24 != 0) continue;
            const dvec3 d = glm::abs(at(image, i) - light(rayOf(view, i)));
            off.most = std::max({off.most, d.x, d.y, d.z});
            ++off.pixels;
        }
        return off;
    }
    /// A thousandth is what texels keep; beside it what bilinear means as wide as a pixel make of a curved function.
    static double tolerance(const lod::View& v) {
        const double angle = v.isOrthographic ? 0 : 1 / v.focalPixels;
        return 1.1e-3 + 0.2 * angle * angle;
    }
    std::vector<PlacedStore> placed_;
};

TEST_F(BackgroundImages, ShowsWhatComesFromEachDirection) {
    FrameSettings s = plain();
    s.draw.backdrop = backdrop(panorama(512, 256, slanted));
    const std::vector<dvec3> looks{{0, 0, -1}, {0, 0, 1},  {1, 0, 0},    {-1, 0, 0},
                                   {0, 1, 0},  {0, -1, 0}, {1, -2, 0.5}, {-0.6, 0.4, 1}};
    for (const auto& [name, backend] : backends_)
        for (const dvec3& look : looks)
            for (const double fov : {10.0, 60.0, 120.0}) {
                const lod::View view = towards(look, fov);
                const Image image = draw(*backend, view, s);
                const Off off = offFrom(image, view, slanted);
                EXPECT_LE(off.most, tolerance(view))
                    << name << " towards " << look.x << ", " << look.y << ", " << look.z;
                EXPECT_GT(off.pixels, 200u) << name;
                // The control: mirrored it is another one.
                EXPECT_GT(offFrom(
                              image, view,
                              [](const dvec3& d) {
                                  return slanted({-d.x, d.y, d.z});
                              }).most +
                              offFrom(image, view,
                                      [](const dvec3& d) {
                                          return slanted({d.x, -d.y, d.z});
                                      })
                                  .most,
                          0.05)
                    << name;
            }
}

TEST_F(BackgroundImages, FollowsTheScenesUp) {
    FrameSettings s = plain();
    s.draw.backdrop = backdrop(panorama(256, 128, slanted), 0.5f);
    for (const auto& [name, backend] : backends_) {
        const lod::View view = towards({0.3, 0.2, 1}, 90);
        s.draw.worldUp = {0, 0, 1};  // north, what the picture has ahead, is y
        EXPECT_LE(offFrom(draw(*backend, view, s), view,
                          [](const dvec3& d) {
                              return 0.5 * slanted({d.x, d.z, -d.y});
                          })
                      .most,
                  tolerance(view))
            << name;
        s.draw.worldUp = {1, 0, 0};
        EXPECT_LE(offFrom(draw(*backend, view, s), view,
                          [](const dvec3& d) {
                              return 0.5 * slanted({d.z, d.x, d.y});
                          })
                      .most,
                  tolerance(view))
            << name;
    }
}

TEST_F(BackgroundImages, IsOneColourWhereRaysAreParallel) {
    FrameSettings s = plain();
    s.draw.backdrop = backdrop(panorama(256, 128, slanted));
    for (const auto& [name, backend] : backends_) {
        lod::View view = towards({0.5, -0.3, -1}, 50);
        view.isOrthographic = true;
        view.focalPixels = 8;
        const Image image = draw(*backend, view, s);
        const Off off = offFrom(image, view, slanted);
        EXPECT_LE(off.most, tolerance(view)) << name;
        EXPECT_GT(off.pixels, 200u) << name;
    }
}

/// A sun of 200 on a sky of 0.25, about places where a picture is hard to look up: its seam, next to a pole, on one.
TEST_F(BackgroundImages, ShowsASunWhereItStands) {
    constexpr double kRadius = 8 * kPi / 180, kTexel = kPi / 512;
    for (const dvec3& sun : {dvec3(0, 0.1, 1), dvec3(0.02, 1, 0.1), dvec3(0, -1, 0), dvec3(0.7, 0.3, -0.6)}) {
        const auto light = [&](const dvec3& d) {
            return dvec3(std::acos(glm::dot(glm::normalize(d), glm::normalize(sun))) < kRadius ? 200 : 0.25);
        };
        FrameSettings s = plain();
        s.draw.backdrop = backdrop(panorama(1024, 512, light));
        for (const auto& [name, backend] : backends_) {
            const lod::View view = towards(sun, 40, 96, 64);
            const Image image = draw(*backend, view, s);
            const double margin = 2 * kTexel + 1.5 / view.focalPixels;
            size_t inside = 0, outside = 0, wrong = 0;
            for (size_t i = 0; i < image.rgba.size(); ++i) {
                if (image.rgba[i] >> 24 != 0) continue;
                const double away = std::acos(std::min(glm::dot(rayOf(view, i), glm::normalize(sun)), 1.0)) - kRadius;
                if (std::abs(away) < margin) continue;
                (away < 0 ? inside : outside) += 1;
                const double expected = away < 0 ? 200 : 0.25;
                wrong += std::abs(at(image, i).y / expected - 1) > 2e-3 ? 1 : 0;
            }
            EXPECT_EQ(wrong, 0u) << name << ", sun at " << sun.x << ", " << sun.y << ", " << sun.z;
            EXPECT_GT(inside, 100u) << name;
            EXPECT_GT(outside, 100u) << name;
        }
    }
}

/// Texels of 0 and 1 by turns are grey where a pixel sees many of them; on the finest level alone they would not be.
TEST_F(BackgroundImages, IsTheMeanOfWhatAPixelSees) {
    HdrImage board{2048, 1024, {}};
    for (uint32_t y = 0; y < board.height; ++y)
        for (uint32_t x = 0; x < board.width; ++x) board.rgb.insert(board.rgb.end(), 3, float((x / 2 + y / 2) % 2));
    FrameSettings s = plain(), naive = plain();
    s.draw.backdrop = backdrop(board);
    Backdrop finest = *s.draw.backdrop;
    finest.levels = 1;
    naive.draw.backdrop = std::make_shared<const Backdrop>(std::move(finest));
    const Light grey = [](const dvec3&) { return dvec3(0.5); };
    for (const auto& [name, backend] : backends_)
        for (const dvec3& look : {dvec3(1, 0.2, 0), dvec3(0, 1, 0)}) {
            const lod::View view = towards(look, 100, 64, 48);
            EXPECT_LE(offFrom(draw(*backend, view, s), view, grey).most, 0.02) << name;
            EXPECT_GT(offFrom(draw(*backend, view, naive), view, grey).most, 0.4) << name << ": the control";
        }
}

TEST_F(BackgroundImages, WhatIsNoLightIsNone) {
    HdrImage broken{8, 4, std::vector<float>(96, 0.25f)};
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    for (size_t i = 0; i < broken.rgb.size(); ++i) broken.rgb[i] = std::array{nan, inf, -inf, -4.0f}.at(i % 4);
    FrameSettings s = plain();
    s.draw.backdrop = backdrop(broken);
    for (const auto& [name, backend] : backends_)
        EXPECT_EQ(offFrom(draw(*backend, towards({1, 0, 0}, 60), s), towards({1, 0, 0}, 60),
                          [](const dvec3&) { return dvec3(0); })
                      .most,
                  0)
            << name;
    for (float& v : broken.rgb) v = 1e30f;
    s.draw.backdrop = backdrop(broken);
    for (const auto& [name, backend] : backends_)
        EXPECT_LE(offFrom(draw(*backend, towards({1, 0, 0}, 60), s), towards({1, 0, 0}, 60),
                          [](const dvec3&) { return dvec3(6e4); })
                      .most,
                  64)
            << name;
}

/// A surrounding of one grey is what a background of that grey is: on edges that are covered in part, behind what is
/// transparent, in means of frames; with tone it is the background of the grey that tone makes of it.
TEST_F(BackgroundImages, OfOneGreyIsABackgroundOfThatGrey) {
    constexpr float kGrey = 0.375f;
    for (const auto& [name, backend] : backends_)
        for (const Mode mode : {Mode::pullpush, Mode::ewa, Mode::surface})
            for (const char* how : {"", "tone", "opacity", "opacity tone", "metered", "accumulated"}) {
                const std::string_view what(how);
                FrameSettings flat = plain();
                flat.mode = mode;
                if (what.find("tone") != std::string_view::npos) flat.draw.parameters.tone = {1.5, 1, 0};
                if (what == "metered") flat.draw.parameters.tone = {1, 1, 1};
                if (what.find("tone") != std::string_view::npos || what == "metered") flat.draw.effects = {"tone"};
                if (what.find("opacity") != std::string_view::npos) flat.draw.opacity = 0.5f;
                FrameSettings with = flat;
                with.draw.backdrop = even(kGrey);
                const auto filmic = [](double x) {
                    return std::min((2.51 * x * x + 0.03 * x) / (2.43 * x * x + 0.59 * x + 0.14), 1.0);
                };
                double grey = double{kGrey};
                if (what.find("tone") != std::string_view::npos) grey = filmic(1.5 * grey);
                flat.draw.background = glm::vec3(static_cast<float>(grey));
                const auto drawn = [&](const FrameSettings& s) {
                    if (what != "accumulated") return draw(*backend, test::effectView(96, 72), s);
                    auto state = makeFrameState(scene(), *backend, *executor_, {});
                    EXPECT_TRUE(renderUntilComplete(*state, test::effectView(96, 72), s));
                    EXPECT_TRUE(expose(
                        {4, {}, 0, 0}, [](double) { return test::effectView(96, 72); }, s,
                        [&](const lod::View& v, const FrameSettings& f) -> Result<void> {
                            STIPPLE_TRY(renderUntilComplete(*state, v, f));
                            return {};
                        },
                        state->image, *executor_));
                    return state->image;
                };
                const Image a = drawn(with), b = drawn(flat);
                if (what == "metered") {  // of the same surfaces: where they cover all of a pixel
                    for (size_t i = 0; i < a.rgba.size(); ++i)
                        if (a.rgba[i] >> 24 == 255) ASSERT_NEAR(at(a, i).x, at(b, i).x, 2e-3) << name << " pixel " << i;
                    continue;
                }
                double most = 0;
                size_t between = 0;
                for (size_t i = 0; i < a.rgba.size(); ++i) {
                    ASSERT_EQ(a.rgba[i] >> 24, b.rgba[i] >> 24) << name;
                    between += a.rgba[i] >> 24 != 0 && a.rgba[i] >> 24 != 255 ? 1 : 0;
                    const dvec3 d = glm::abs(at(a, i) - at(b, i));
                    most = std::max({most, d.x, d.y, d.z});
                }
                const std::string where = fmt::format("{}, {}, '{}'", name, reconstructionOf(mode).name, how);
                EXPECT_LE(most, 2e-3) << where;
                if (mode == Mode::ewa || what == "accumulated" || what.find("opacity") != std::string_view::npos)
                    EXPECT_GT(between, 20u) << where << ": pixels that are covered in part";
                with.draw.backdrop = even(2 * kGrey);
                EXPECT_TRUE(drawn(with).rgba != b.rgba) << where << ": the control";
            }
}

TEST_F(BackgroundImages, AreThoseOfTheOracleOnEveryKindAndInEveryMode) {
    auto oracle = reference::makeReferenceBackend(*executor_);
    const Light busy = [](const dvec3& d) {
        return slanted(d) + dvec3(0.3 * std::sin(20 * d.x) * std::cos(17 * d.y), 0.2 * std::sin(15 * d.z), 0);
    };
    FrameSettings s = plain();
    s.draw.backdrop = backdrop(panorama(256, 128, busy));
    for (const bool isOrthographic : {false, true})
        for (const Reconstruction& r : reconstructions())
            for (const bool hasTone : {false, true}) {
                s.mode = r.mode;
                s.draw.effects.clear();
                if (hasTone) s.draw.effects = {"tone"};
                s.draw.parameters.tone = {1.5, 1, 0};
                lod::View v = test::effectView(330, 72);  // rows of several tiles, some of which show nothing
                v.isOrthographic = isOrthographic;
                if (isOrthographic) v.focalPixels = 24;
                const Image expected = draw(*oracle, v, s);
                for (const auto& [name, backend] : backends_) {
                    const auto off = reference::compareImages(draw(*backend, v, s), expected, 4, nullptr);
                    ASSERT_TRUE(off);
                    const std::string where =
                        fmt::format("{}, {}, parallel {}, tone {}", name, r.name, isOrthographic, hasTone);
                    EXPECT_GE(off->psnr, 50) << where;
                    EXPECT_LE(off->differingFraction, 1e-3) << where;
                }
            }
}

#ifndef STIPPLE_ON_GPU
TEST_F(BackgroundImages, AreBehindTracedRays) {
    reference::TraceSettings trace{2, plain().draw};
    trace.draw.backdrop = backdrop(panorama(512, 256, slanted));
    const lod::View view = towards({-0.1, -0.2, -1}, 90);
    const auto image = reference::trace(scene(), view, trace, *executor_);
    ASSERT_TRUE(image) << image.error().line();
    const Off off = offFrom(*image, view, slanted);
    EXPECT_LE(off.most, tolerance(view));
    EXPECT_GT(off.pixels, 200u);
    EXPECT_LT(off.pixels, size_t{48} * 32) << "something is seen";
}

TEST(Backdrops, KeepTheLightOfTheWholePictureOnEveryLevel) {
    const auto executor = makeTbbExecutor(0);
    const Light uneven = [](const dvec3& d) { return dvec3(d.y > 0.9 ? 50 : 0.1, d.x > 0.5 ? 3 : 0, 0.5 + 0.5 * d.z); };
    for (const auto& [width, height] :
         {std::pair{512u, 256u}, std::pair{300u, 131u}, std::pair{7u, 5u}, std::pair{1u, 1u}}) {
        const HdrImage image = panorama(width, height, uneven);
        const Backdrop b = makeBackdrop(image, 2, *executor);
        dvec3 exact(0);
        double all = 0;
        for (uint32_t y = 0; y < height; ++y) {
            const double share = std::cos(kPi * y / height) - std::cos(kPi * (y + 1) / height);
            for (uint32_t x = 0; x < width; ++x)
                for (int k = 0; k < 3; ++k)
                    exact[k] += share * double{image.rgb[3 * (size_t{y} * width + x) + static_cast<size_t>(k)]};
            all += share * width;
        }
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(b.mean[k], 2 * exact[k] / all, 0.02 * exact[k] / all + 1e-6) << width;
        // Of the level that is two texels high: both halves of the sphere.
        ASSERT_GE(b.levels, 1u);
        const uint32_t last = b.levels - 1, texels = std::max(width >> last, 1u);
        dvec3 sum(0);
        for (uint32_t x = 0; x < texels; ++x)
            sum += dvec3(glm::vec3(shared::backdropLight(b.texels[b.first.at(last) + x])));
        for (int k = 0; k < 3; ++k)
            EXPECT_NEAR(sum[k] / texels, exact[k] / all, 0.02 * exact[k] / all + 0.06) << width << "x" << height;
    }
}
#endif

}  // namespace
}  // namespace stipple::render
