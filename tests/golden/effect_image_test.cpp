// What effects look like: against closed forms on planes, whose depths are known, and against fp64 on every kind of
// primitives, in perspective and orthographic views, in every mode.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "engine/reference/reference.h"
#include "engine/render/effects/table.h"
#include "engine/scene/camera.h"
#include "lod/builder/mesh/mesh_build.h"
#include "shaders/shared/fade.h"
#include "shaders/shared/tone.h"
#include "tests/support/backends_here.h"
#include "tests/support/effect_scenes.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec3;

constexpr uint32_t kSize = 64;

/// Squares across the view, which looks along -z from the origin.
struct Square {
    dvec3 centre;
    double half;
    uint32_t colour;
};
lod::TriangleMesh squares(const std::vector<Square>& all) {
    lod::TriangleMesh mesh;
    for (const Square& s : all) {
        const auto first = static_cast<uint32_t>(mesh.position.size());
        for (int k = 0; k < 4; ++k) {
            mesh.position.push_back(s.centre + s.half * dvec3(k % 2 * 2 - 1, k / 2 * 2 - 1, 0));
            mesh.normal.emplace_back(0, 0, 1);
            mesh.uv.emplace_back(0);
            mesh.colour.push_back(s.colour | 0xff000000u);
            mesh.surface.push_back(0);
        }
        for (const uint32_t corner : {0u, 1u, 3u, 0u, 3u, 2u}) mesh.indices.push_back(first + corner);
    }
    return mesh;
}

class EffectImages : public test::BackendsHere {
  protected:
    std::shared_ptr<const lod::Store> build(const std::vector<Square>& all) {
        lod::MeshBuildSettings settings;
        settings.description.materials.emplace_back();
        settings.description.materials.back().baseColour = {1, 1, 1};
        settings.description.materials.back().alpha = 1;
        const std::string path = folder_ / fmt::format("squares{}.stipple", ++stores_);
        Progress progress(false);
        const auto built = lod::buildMeshStore(lod::sourceOf(squares(all)), path, settings, *executor_, progress);
        EXPECT_TRUE(built) << built.error().line();
        auto store = lod::openStore(path);
        EXPECT_TRUE(store);
        return std::make_shared<const lod::Store>(std::move(*store));
    }
    static scene::Camera ahead() {
        scene::Camera c;
        c.eye = {0, 0, 0};
        c.target = {0, 0, -1};
        c.up = {0, 1, 0};
        c.fovDegrees = 50;
        return c;
    }
    static lod::View view(double nearPlane = 1e-3) { return scene::makeView(ahead(), kSize, kSize, nearPlane); }
    static render::FrameSettings unlit() {
        render::FrameSettings s;
        s.draw.worldUp = {0, 1, 0};
        s.draw.unlitTriangles = true;
        s.wantDepthAndNormal = true;
        s.budgets.errorPixels = 1e-3;
        return s;
    }
    /// Colours against fp64, every kind in every mode, in perspective and in parallel; depths and coverage are those of
    /// the same backend without the effects, bit by bit, normals to half a step of what they are kept in.
    void expectThoseOfTheOracle(const std::function<render::FrameSettings(bool isOrthographic)>& settings) {
        const auto placed = test::effectStores(folder_.path(), *executor_);
        auto oracle = reference::makeReferenceBackend(*executor_);
        for (const bool isOrthographic : {false, true})
            for (const render::Reconstruction& r : render::reconstructions()) {
                render::FrameSettings s = settings(isOrthographic), without = s;
                s.mode = without.mode = r.mode;
                s.budgets.errorPixels = without.budgets.errorPixels = 1;
                without.draw.effects.clear();
                lod::View v = test::effectView(128, 96);
                if (isOrthographic) {
                    v.isOrthographic = true;
                    v.focalPixels = 24;
                }
                const render::Image expected = test::draw(placed, *oracle, *executor_, v, s);
                for (const auto& [name, backend] : backends_)
                    if (name != "fp64")
                        expectLike(test::draw(placed, *backend, *executor_, v, s),
                                   test::draw(placed, *backend, *executor_, v, without), expected,
                                   fmt::format("{}, {}, parallel {}", name, r.name, isOrthographic));
            }
    }
    static void expectLike(const render::Image& image, const render::Image& without, const render::Image& expected,
                           const std::string& what) {
        const auto off = reference::compareImages(image, expected, 4, nullptr);
        ASSERT_TRUE(off);
        EXPECT_GE(off->psnr, 50) << what;
        EXPECT_LE(off->differingFraction, 1e-3) << what;
        EXPECT_TRUE(image.rgba != without.rgba) << what << ": nothing is seen of it";
        EXPECT_TRUE(image.depth == without.depth) << what;
        // Normals lie between passes in 16 bits of each octahedral coordinate: half a step in x and y is a whole one in
        // z, sqrt(6) halves together, before a vector no shorter than 1 / sqrt(3) is normalised.
        ASSERT_EQ(image.normal.size(), without.normal.size());
        for (size_t i = 0; i < image.normal.size(); ++i)
            ASSERT_NEAR(image.normal[i], without.normal[i], std::sqrt(18.0) * 0x1p-16) << what << ", number " << i;
        for (size_t i = 0; i < image.rgba.size(); ++i)
            ASSERT_EQ(image.rgba[i] >> 24, without.rgba[i] >> 24) << what << ", coverage of pixel " << i;
    }
    static dvec3 at(const render::Image& image, uint32_t x, uint32_t y) {
        const size_t i = 3 * (size_t{y} * image.width + x);
        return {image.linear[i], image.linear[i + 1], image.linear[i + 2]};
    }
    int stores_ = 0;
};

/// Where a far plane begins behind the edge of a near one, three of eight neighbours are nearer.
TEST_F(EffectImages, EyeDomeLightingOfAStepIsTheClosedForm) {
    // The near square covers the left half of the picture.
    const double near = 2, far = 3;
    const auto store = build({{{-20, 0, -near}, 20, 0xffffff}, {{0, 0, -far}, 40, 0xffffff}});
    for (const auto& [strength, radius] : {std::pair{1.0, 1.0}, std::pair{4.0, 1.0}, std::pair{4.0, 4.0}}) {
        render::FrameSettings s = unlit();
        s.draw.effects = {"edl"};
        s.draw.parameters.edl = {strength, radius, 1, 0};
        const auto reach = static_cast<uint32_t>(std::lround(radius));
        for (const auto& [name, backend] : backends_) {
            const render::Image image = test::draw({{store, {}, {}}}, *backend, *executor_, view(), s);
            const double white = at(image, 2, 2).x;
            EXPECT_NEAR(white, 1, 2e-3) << "nothing is nearer than the near one";
            const double expected = std::exp(-strength * 3 / 8 * std::log2(far / near));
            // Colours lie between passes in 11 bits of their root.
            EXPECT_NEAR(at(image, kSize / 2, 20).x, expected, 2e-3) << name << ", strength " << strength;
            EXPECT_NEAR(at(image, kSize / 2 + reach + 1, 20).x, 1, 2e-3) << name << ": beyond the radius";
            // A depth of 0 where nothing is would make all borders black.
            EXPECT_NEAR(at(image, kSize - 1, 20).x, 1, 2e-3) << name << ": beyond the picture it is far";
        }
    }
}

TEST_F(EffectImages, EyeDomeLightingKnowsNoUnitOfLength) {
    // The same scene a million times as large, and from as far away.
    std::map<std::string, std::vector<uint32_t>> pictures;
    for (const double scale : {1.0, 1048576.0}) {
        const auto store = build({{{-20, 0, -2}, 20, 0x80c0ff}, {{0, 0, -3}, 40, 0x80c0ff}});
        render::PlacedStore placed{store, {}, {}};
        placed.place.scale = scale;
        render::FrameSettings s = unlit();
        s.draw.effects = {"edl"};
        s.draw.parameters.edl.scales = 3;
        for (const auto& [name, backend] : backends_) {
            const render::Image image = test::draw({placed}, *backend, *executor_, view(1e-3 * scale), s);
            if (pictures[name].empty())
                pictures[name] = image.rgba;
            else
                EXPECT_TRUE(pictures[name] == image.rgba) << name;
        }
    }
}

TEST_F(EffectImages, EyeDomeLightingIsThatOfTheOracleOnEveryKindAndInEveryMode) {
    expectThoseOfTheOracle([](bool) {
        render::FrameSettings s = unlit();
        s.draw.effects = {"edl"};
        s.draw.parameters.edl = {20, 1.4, 2, 0};
        return s;
    });
}

TEST(Fade, IsExactOverManyDecadesWhereTheNaiveFormulaIsNot) {
    double worst = 0, worstNaive = 0, worstOver = 0;
    for (double exponent = -9; exponent <= 3; exponent += 1.0 / 512) {
        const auto x = static_cast<float>(std::pow(10.0, exponent));
        const double exact = -std::expm1(-double{x});
        worst = std::max(worst, std::abs(shared::fade(x) / exact - 1));
        worstOver = std::max(worstOver, std::abs(shared::fadeOver(x) * double{x} / exact - 1));
        worstNaive = std::max(worstNaive, std::abs((1.0f - std::exp(-x)) / exact - 1));
    }
    EXPECT_LE(worst, 1e-5);
    EXPECT_LE(worstOver, 1e-5);
    EXPECT_GT(worstNaive, 0.5) << "the difference of two numbers that are nearly 1";
    EXPECT_EQ(shared::fade(0), 0.0f);
    EXPECT_EQ(shared::fadeOver(0), 1.0f);
}

TEST(Fade, LogarithmsAreThoseOfTheLibrary) {
    for (double exponent = -30; exponent <= 30; exponent += 1.0 / 256) {
        const auto d = static_cast<float>(std::pow(10.0, exponent));
        const double exact = std::log2(double{d});
        EXPECT_NEAR(shared::log2Of(d), exact, 2e-7 + 6e-8 * std::abs(exact)) << d;
    }
    for (double x = -100; x <= 100; x += 0.125)
        EXPECT_NEAR(shared::exp2Of(static_cast<float>(x)) / std::exp2(x), 1, 3e-7) << x;
}

/// Black in white fog sends what is scattered in: 1 - exp(-density * distance), of any size, brought up by exposure.
TEST_F(EffectImages, FogIsTheClosedFormOverManyDecades) {
    constexpr double kDepth = 3;
    const auto store = build({{{0, 0, -kDepth}, 40, 0x000000}});
    for (int decade = -9; decade <= 3; ++decade) {
        render::FrameSettings s = unlit();
        s.draw.effects = {"fog", "tone"};
        const double x = std::pow(10.0, decade),
                     distance = kDepth * std::sqrt(1 + 2 * std::pow(0.5 / view().focalPixels, 2));
        s.draw.parameters.fog.density = x / distance;
        s.draw.parameters.fog.colour = {255, 255, 255};
        const double exposure = decade < 0 ? std::min(1e6, std::pow(10.0, -decade)) : 1;
        s.draw.parameters.tone.exposure = exposure;
        for (const auto& [name, backend] : backends_) {
            const render::Image image = test::draw({{store, {}, {}}}, *backend, *executor_, view(), s);
            EXPECT_NEAR(at(image, kSize / 2, kSize / 2).x / (exposure * -std::expm1(-x)), 1, 1e-5) << name << ", " << x;
        }
    }
}

/// Air that thins out: the optical depth of a way up is density * H * (1 - exp(-rise / H)) over the sine of its angle.
TEST_F(EffectImages, FogThatThinsOutIsTheIntegralOfItsDensity) {
    constexpr double kDepth = 3, kDensity = 0.3;
    const auto store = build({{{0, 0, -kDepth}, 40, 0x000000}});
    for (const double height : {0.05, 0.5, 5.0, 1e6}) {
        render::FrameSettings s = unlit();
        s.draw.effects = {"fog"};
        s.draw.parameters.fog = {kDensity, height, 0, {255, 255, 255}, 0};
        const lod::View v = view();
        for (const auto& [name, backend] : backends_) {
            const render::Image image = test::draw({{store, {}, {}}}, *backend, *executor_, v, s);
            for (const uint32_t y : {2u, kSize / 2, kSize - 3}) {
                const dvec3 along((kSize / 2 + 0.5 - 0.5 * kSize) / v.focalPixels,
                                  (0.5 * kSize - y - 0.5) / v.focalPixels, 1);
                const double way = kDepth * glm::length(along);
                // By Simpson's rule: no closed form is trusted here.
                constexpr int kParts = 2000;
                double integral = 0;
                for (int k = 0; k <= kParts; ++k)
                    integral += (k == 0 || k == kParts ? 1
                                 : k % 2 == 1          ? 4
                                                       : 2) *
                                std::exp(-kDepth * along.y * k / kParts / height);
                integral *= kDensity * way / (3.0 * kParts);
                EXPECT_NEAR(at(image, kSize / 2, y).x, -std::expm1(-integral), 1e-4)
                    << name << ", H " << height << ", row " << y;
            }
        }
    }
}

TEST_F(EffectImages, FogAndToneAreThoseOfTheOracleOnEveryKindAndInEveryMode) {
    expectThoseOfTheOracle([](bool isOrthographic) {
        render::FrameSettings s = unlit();
        s.draw.unlitTriangles = isOrthographic;  // one of both is lit
        s.draw.lit = !isOrthographic;
        s.draw.effects = {"fog", "tone"};
        s.draw.parameters.fog = {0.15, 1, 0, {200, 210, 255}, 1};
        s.draw.parameters.tone = {1.5, 1};
        return s;
    });
}

TEST(Tone, RisesFromBlackToWhiteAndIsNothingWithoutACurve) {
    float last = -1;
    for (double x = 0; x < 100; x += 1.0 / 64) {
        const float y = shared::filmic(static_cast<float>(x));
        EXPECT_GE(y, last);
        EXPECT_LE(y, 1.0f);
        last = y;
    }
    EXPECT_EQ(shared::filmic(0), 0.0f);
    EXPECT_EQ(shared::filmic(1e6f), 1.0f);
    EXPECT_EQ(shared::toned({1, 0}, 0.73f), 0.73f);
}

}  // namespace
}  // namespace stipple
