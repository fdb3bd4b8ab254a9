// Transparency: what is behind a body shows through it as far as alpha says, of every kind, in every mode, on every
// backend; what is opaque of it is drawn as ever, and hides; nothing of it is there where nothing is transparent.
#include <gtest/gtest.h>

#include "engine/reference/reference.h"
#include "engine/render/layered_frame.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/glass.h"

namespace stipple {
namespace {

constexpr float kShare = 0.4f;

/// A square of the picture's middle, facing +z, whose alpha goes from 0 on its left to 1 on its right.
scene::Primitive fadingSquare(double z, double edge) {
    scene::Primitive mesh;
    constexpr int kStrips = 16;
    for (int i = 0; i <= kStrips; ++i)
        for (const double y : {-0.5, 0.5}) {
            const float share = static_cast<float>(i) / kStrips;
            mesh.position.emplace_back(edge * (share - 0.5), edge * y, z);
            mesh.normal.emplace_back(0, 0, 1);
            mesh.colour.emplace_back(0.2f, 0.9f, 0.3f, share);
        }
    for (uint32_t i = 0; i < kStrips; ++i)
        for (const uint32_t k : {0u, 2u, 3u, 0u, 3u, 1u}) mesh.indices.push_back(2 * i + k);
    return mesh;
}

scene::Material blended(float alpha, bool isUnlit = false) {
    scene::Material m;
    m.metallic = 0;
    m.roughness = 0.8f;
    m.isUnlit = isUnlit;
    m.isDoubleSided = true;
    m.baseColour.a = alpha;
    m.alphaMode = scene::AlphaMode::blend;
    m.optics.blends = true;
    return m;
}

class Transparent : public test::BackendsHere {
  protected:
    void SetUp() override {
        test::BackendsHere::SetUp();
        scene::Material paint;
        paint.metallic = 0;
        paint.roughness = 0.9f;
        board_ = test::meshStore(test::board(-2.5), paint, folder_ / "board.stipple", *executor_);
        ball_ = test::meshStore(test::ball(120), blended(kShare), folder_ / "ball.stipple", *executor_);
        solid_ = test::meshStore(test::ball(120), paint, folder_ / "solid.stipple", *executor_);
        fading_ = test::meshStore(fadingSquare(0, 2), blended(1), folder_ / "fading.stipple", *executor_);
        test::writePly(folder_ / "a.ply", test::spherePoints(20'000, 0xe0f0e8));
        points_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "points.stipple", *executor_);
        curves_ = test::buildCurves(test::curls({.count = 40, .radius = 0.06f}), folder_ / "c.stipple", *executor_);
        patches_ = test::patchStore(test::ball(100), 6'000, folder_ / "patches.stipple", *executor_);
    }
    render::Image draw(const std::vector<render::PlacedStore>& placed, render::Backend& backend,
                       const render::FrameSettings& settings, bool isOrthographic = false) {
        return test::draw(placed, backend, *executor_, test::glassView({0.5, 0.4, 3.6}, 160, isOrthographic), settings);
    }
    std::shared_ptr<const lod::Store> board_, ball_, solid_, fading_, points_, curves_, patches_;
};

/// Share of the pixels whose coverage, depth or normal is another.
double otherGeometry(const render::Image& a, const render::Image& b) {
    size_t count = 0;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        const double za = a.depth[i], zb = b.depth[i];
        const auto normal = [i](const render::Image& of) {
            return glm::dvec3(of.normal[3 * i], of.normal[3 * i + 1], of.normal[3 * i + 2]);
        };
        const int alpha = std::abs(static_cast<int>(a.rgba[i] >> 24) - static_cast<int>(b.rgba[i] >> 24));
        count += alpha > 1 || std::abs(za - zb) > 1e-4 * zb || glm::length(normal(a) - normal(b)) > 0.01 ? 1 : 0;
    }
    return static_cast<double>(count) / static_cast<double>(a.rgba.size());
}

/// By hand: the share of what is in front and the rest of what is behind, of linear light; the largest difference.
double offBy(const render::Image& image, const render::Image& behind, const render::Image& front, double opacity,
             size_t& covered) {
    double most = 0;
    covered = 0;
    for (size_t i = 0; i < image.rgba.size(); ++i) {
        const bool isFront = front.depth[i] > 0 && (behind.depth[i] <= 0 || front.depth[i] < behind.depth[i]);
        covered += isFront;
        for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
            const double wanted = isFront ? opacity * double{front.linear[c]} + (1 - opacity) * double{behind.linear[c]}
                                          : double{behind.linear[c]};
            most = std::max(most, std::abs(double{image.linear[c]} - wanted));
        }
    }
    return most;
}

TEST_F(Transparent, OfEveryKindIsTheShareOfItAndTheRestOfWhatIsBehind) {
    for (auto& [name, backend] : backends_)
        for (const auto& body : {solid_, points_, curves_, patches_}) {
            render::FrameSettings settings = test::glassSettings(render::Mode::surface);
            const render::Image behind = draw({{board_, {}, {}}}, *backend, settings),
                                front = draw({{body, {}, {}}}, *backend, settings);
            render::FrameSettings through = settings;
            through.draw.opacity = kShare;
            // The board is let through as well: what is behind it is the background.
            const render::Image boardThrough = draw({{board_, {}, {}}}, *backend, through),
                                both = draw({{board_, {}, {}}, {body, {}, {}}}, *backend, through);
            size_t covered = 0;
            EXPECT_LE(offBy(both, boardThrough, front, kShare, covered), 2e-3) << name;
            EXPECT_GT(covered, 800u) << name;
            const render::Image opaque = draw({{board_, {}, {}}, {body, {}, {}}}, *backend, settings);
            EXPECT_GT(offBy(opaque, boardThrough, front, kShare, covered), 0.05) << "the control";
        }
}

TEST_F(Transparent, MaterialsAreThoseOfTheOracleInEveryMode) {
    const auto oracle = reference::makeReferenceBackend(*executor_);
    backends_.erase("fp64");
    render::PlacedStore before{fading_, {}, {}};
    before.place.translation = {0.2, 0.1, 1.2};
    const std::vector<render::PlacedStore> placed{{board_, {}, {}}, {ball_, {}, {}}, before};
    for (const render::Reconstruction& mode : render::reconstructions())
        for (const bool isOrthographic : {false, true}) {
            render::FrameSettings settings = test::glassSettings(mode.mode);
            settings.draw.unlitTriangles = mode.mode == render::Mode::splat;
            const render::Image truth = draw(placed, *oracle, settings, isOrthographic);
            render::FrameSettings cut = settings;
            cut.draw.transparency = false;
            const render::Image control = draw(placed, *oracle, cut, isOrthographic);
            EXPECT_LT(test::drawnPsnr(control, truth), 30) << mode.name << ": the control";
            const render::Image without = draw({placed[0], placed[1]}, *oracle, settings, isOrthographic);
            EXPECT_GT(otherGeometry(without, truth), 0.05) << mode.name << ": the control";
            for (auto& [name, backend] : backends_) {
                const render::Image image = draw(placed, *backend, settings, isOrthographic);
                const auto off = reference::compareImages(image, truth, 4, nullptr);
                ASSERT_TRUE(off);
                EXPECT_LE(otherGeometry(image, truth), 1e-3) << name << ", mode " << mode.name << isOrthographic;
                EXPECT_GE(off->psnr, 50) << name << ", mode " << mode.name << isOrthographic;
                EXPECT_LE(off->differingFraction, 1e-3) << name << ", mode " << mode.name << isOrthographic;
            }
        }
}

TEST_F(Transparent, IsTheShareThatAlphaSaysAtEveryPixel) {
    const lod::View view = test::glassView({0.5, 0.4, 3.6}, 160);
    const glm::dvec3 own(0.2, 0.9, 0.3);  // to 8 bits of sRGB
    for (auto& [name, backend] : backends_) {
        render::FrameSettings settings = test::glassSettings(render::Mode::surface);
        settings.draw.unlitTriangles = true;
        const render::Image behind = draw({{board_, {}, {}}}, *backend, settings),
                            both = draw({{board_, {}, {}}, {fading_, {}, {}}}, *backend, settings);
        double most = 0;
        size_t inside = 0;
        for (size_t i = 0; i < both.rgba.size(); ++i) {
            const glm::dvec3 ray = view.forward + (double(i % 160) + 0.5 - 80) / view.focalPixels * view.right +
                                   (double(i / 160) + 0.5 - 80) / view.focalPixels * view.down;
            const double t = -view.eye.z / ray.z;
            const glm::dvec3 at = view.eye + t * ray;
            if (std::abs(at.x) > 0.97 || std::abs(at.y) > 0.97) continue;
            ++inside;
            const double alpha = at.x / 2 + 0.5;
            for (int c = 0; c < 3; ++c) {
                const double under = behind.linear[3 * i + size_t(c)];
                most =
                    std::max(most, std::abs(both.linear[3 * i + size_t(c)] - (alpha * own[c] + (1 - alpha) * under)));
            }
            if (std::abs(alpha - 0.5) > 0.01)
                EXPECT_EQ(both.depth[i]<behind.depth[i] - 1, alpha> 0.5) << name << ", alpha " << alpha;
        }
        EXPECT_GT(inside, 5'000u);
        EXPECT_LE(most, 0.5 / 255 + 0.004 + 0.002) << name << ": alpha and colours of 8 bits";
    }
}

TEST_F(Transparent, WhatIsOpaqueAllOverIsDrawnAsEver) {
    const auto opaque = test::meshStore(test::ball(120), blended(1), folder_ / "opaque.stipple", *executor_);
    EXPECT_TRUE(opaque->description.optics.empty());
    for (auto& [name, backend] : backends_) {
        const render::FrameSettings settings = test::glassSettings(render::Mode::surface);
        auto state = render::makeFrameState({{board_, {}, {}}, {opaque, {}, {}}}, *backend, *executor_, {});
        const lod::View view = test::glassView({0.5, 0.4, 3.6}, 96);
        ASSERT_TRUE(renderUntilComplete(*state, view, settings));
        EXPECT_FALSE(render::hasLayers(*state, view, settings)) << name;
        EXPECT_EQ(state->layered, nullptr) << name << ": nothing of it is held";
    }
}

TEST_F(Transparent, TexturesThatAreCutOutDoNotBlend) {
    scene::Scene scene;
    scene.materials = {blended(1)};
    scene.materials[0].baseColourTexture.texture = 0;
    scene.textures.resize(1);
    scene.textures[0].image = 0;
    scene.images.resize(1);
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {test::board(0)};
    scene.meshes[0].primitives[0].material = 0;
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    const auto blends = [&](const std::vector<uint32_t>& alphas) {
        scene::DecodedImage image{static_cast<uint32_t>(alphas.size()), 1, {}};
        for (const uint32_t alpha : alphas) image.rgba.push_back(alpha << 24);
        const auto optics = scene::surfaceOptics(scene, scene::placements(scene), {&image, 1});
        return !optics.empty() && optics[0].blends;
    };
    EXPECT_FALSE(blends({0, 0, 0, 255, 255, 255, 255, 128})) << "a leaf and its rim";
    EXPECT_FALSE(blends({255, 255}));
    EXPECT_TRUE(blends({0, 128, 128, 255, 255}));
    EXPECT_TRUE(blends({100}));
    scene.materials[0].baseColour.a = 0.5f;
    EXPECT_TRUE(blends({255, 255}));
    EXPECT_FALSE(scene::surfaceOptics(scene, scene::placements(scene)).empty()) << "textures are not known";
}

TEST_F(Transparent, NothingHidesWhatIsBeforeIt) {
    render::PlacedStore front{solid_, {}, {}};
    front.place.translation = {0, 0, 1.5};
    front.place.scale = 0.4;
    for (auto& [name, backend] : backends_) {
        const render::FrameSettings settings = test::glassSettings(render::Mode::surface);
        const render::Image with = draw({{board_, {}, {}}, {ball_, {}, {}}, front}, *backend, settings),
                            alone = draw({{board_, {}, {}}, front}, *backend, settings);
        size_t seen = 0;
        for (size_t i = 0; i < with.rgba.size(); ++i)
            if (alone.depth[i] > 0 && alone.depth[i] < 2.6f) {
                ++seen;
                ASSERT_EQ(with.rgba[i], alone.rgba[i]) << name << " at " << i;
            }
        EXPECT_GT(seen, 300u) << name;
    }
}

TEST_F(Transparent, LeavesTheAlphaOfPicturesWhatIsCovered) {
    for (auto& [name, backend] : backends_) {
        const render::Image alone = draw({{ball_, {}, {}}}, *backend, test::glassSettings(render::Mode::surface));
        uint32_t least = 255, most = 0;
        for (const uint32_t word : alone.rgba) {
            least = std::min(least, word >> 24);
            most = std::max(most, word >> 24);
        }
        EXPECT_EQ(least, 0u) << name;
        EXPECT_NEAR(most, 255 * kShare, 1) << name;
    }
}

}  // namespace
}  // namespace stipple
