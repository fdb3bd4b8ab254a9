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

/// A square of one colour, facing +z.
scene::Primitive pane(double edge, const glm::vec3& colour) {
    scene::Primitive mesh;
    for (const auto& [x, y] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
        mesh.position.emplace_back(edge * x, edge * y, 0);
        mesh.normal.emplace_back(0, 0, 1);
        mesh.colour.emplace_back(colour, 1);
    }
    for (const uint32_t k : {0u, 1u, 2u, 0u, 2u, 3u}) mesh.indices.push_back(k);
    return mesh;
}

// Of more bodies than are kept apart the farthest are one, of which the nearest is seen at each pixel: what is behind
// all of them is still there, and no more is lost than what the others of them would have added.
TEST_F(Transparent, BehindMoreBodiesThanAreKeptApartIsWhatIsBehindTheLast) {
    constexpr size_t kPanes = 12, kApart = render::kMostBodies - 1, kTogether = kPanes - kApart;
    constexpr double kAlpha = 51.0 / 255, kEdge = 1.6, kRim = 0.03;
    const std::array colours{glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)};
    std::vector<std::shared_ptr<const lod::Store>> stores;
    for (size_t c = 0; c < colours.size(); ++c)
        stores.push_back(test::meshStore(pane(kEdge, colours.at(c)), blended(static_cast<float>(kAlpha), true),
                                         folder_ / ("pane" + std::to_string(c)), *executor_));
    const lod::View view = test::glassView({0.5, 0.4, 3.6}, 160);
    // The farthest first; each a little aside, so that numbers differ from pixel to pixel.
    std::vector<glm::dvec3> centres;
    for (size_t k = 0; k < kPanes; ++k)
        centres.emplace_back(0.04 * static_cast<double>(k % 4), 0.03 * static_cast<double>(k % 5),
                             -1.6 + 0.2 * static_cast<double>(k));
    std::vector<render::PlacedStore> placed{{board_, {}, {}}};
    for (size_t k = 0; k < kPanes; ++k) {
        const size_t other = 5 * k % kPanes;  // in any order
        placed.push_back({stores[other % stores.size()], {}, {}});
        placed.back().place.translation = centres[other];
    }
    for (auto& [name, backend] : backends_) {
        render::FrameSettings settings = test::glassSettings(render::Mode::surface);
        settings.draw.unlitTriangles = true;
        const render::Image behind = draw({{board_, {}, {}}}, *backend, settings),
                            all = draw(placed, *backend, settings);
        double off = 0, overBound = 0, lost = 0, withoutFar = 0, withoutBoard = 0;
        size_t deepest = 0, pixels = 0;
        for (size_t i = 0; i < all.rgba.size(); ++i) {
            const glm::dvec3 ray = view.forward + (double(i % 160) + 0.5 - 80) / view.focalPixels * view.right +
                                   (double(i / 160) + 0.5 - 80) / view.focalPixels * view.down;
            bool isAtRim = false;
            std::vector<size_t> met;
            for (size_t k = 0; k < kPanes; ++k) {
                const glm::dvec3 d = view.eye + (centres[k].z - view.eye.z) / ray.z * ray - centres[k];
                const double out = std::max(std::abs(d.x), std::abs(d.y)) - 0.5 * kEdge;
                isAtRim = isAtRim || std::abs(out) < kRim;
                if (out < 0) met.push_back(k);
            }
            if (isAtRim || met.empty()) continue;
            ++pixels;
            const auto isFar = [&](size_t k) { return k < kTogether; };
            const auto far = static_cast<size_t>(std::count_if(met.begin(), met.end(), isFar));
            deepest = std::max(deepest, far);
            const double passed = std::pow(1 - kAlpha, static_cast<double>(met.size() - far)),
                         bound = far < 2
                                     ? 0
                                     : passed * (1 - kAlpha) * (1 - std::pow(1 - kAlpha, static_cast<double>(far - 1)));
            for (size_t c = 0; c < 3; ++c) {
                const double board = behind.linear[3 * i + c], shown = all.linear[3 * i + c];
                // Over what is behind them, those from number `first` of them on.
                const auto over = [&](double under, size_t first) {
                    for (size_t m = first; m < met.size(); ++m)
                        under += kAlpha * (double{colours.at(met[m] % 3)[static_cast<int>(c)]} - under);
                    return under;
                };
                const double truth = over(board, 0), together = over(board, far > 0 ? far - 1 : 0);
                off = std::max(off, std::abs(shown - together));
                overBound = std::max(overBound, std::abs(shown - truth) - bound);
                lost = std::max(lost, std::abs(shown - truth));
                withoutFar = std::max(withoutFar, std::abs(shown - over(board, far)));
                withoutBoard = std::max(withoutBoard, std::abs(shown - over(0, far > 0 ? far - 1 : 0)));
            }
        }
        EXPECT_GT(pixels, 5'000u);
        EXPECT_EQ(deepest, kTogether);
        std::printf("%-8s %.4f off; of all of them apart %.3f\n", name.c_str(), off, lost);
        EXPECT_LE(off, 2e-3) << name;
        EXPECT_LE(overBound, 2e-3) << name;
        EXPECT_GT(lost, 0.02) << name << ", the control: they are not all apart";
        EXPECT_GT(withoutFar, 0.02) << name << ", the control: the farthest are there";
        EXPECT_GT(withoutBoard, 0.02) << name << ", the control: and what is behind them";
    }
}

/// What of its neighbours a pixel is: covered beside one that is not.
bool isRim(const render::Image& image, uint32_t width, size_t i) {
    const auto isIn = [&](size_t k) { return (image.rgba[k] >> 24) != 0; };
    return isIn(i) && !(isIn(i - 1) && isIn(i + 1) && isIn(i - width) && isIn(i + width));
}

// A body's picture ends where the body does, in every mode and of every kind: beside it there is what would be there
// without it, bit by bit; at its rim its own share over the rest of what is behind, and none of the background.
TEST_F(Transparent, NothingIsBesideTheRim) {
    constexpr uint32_t kWidth = 160;
    lod::Optics thin;
    thin.blends = true;
    thin.opacity = kShare;
    const lod::View view = test::glassView({0.5, 0.4, 3.6}, kWidth);
    const double pixelsOfUnit = view.focalPixels / glm::length(view.eye);
    const glm::vec3 bright(1, 0.6f, 0.9f);
    for (const render::Reconstruction& mode : render::reconstructions())
        for (const auto& body : {ball_, points_, curves_, patches_}) {
            const bool isRound = body != curves_ && !(body == points_ && mode.mode == render::Mode::points);
            for (auto& [name, backend] : backends_) {
                SCOPED_TRACE(testing::Message() << name << ", mode " << mode.name
                                                << (body == ball_     ? ", triangles"
                                                    : body == points_ ? ", points"
                                                    : body == curves_ ? ", curves"
                                                                      : ", patches"));
                render::FrameSettings settings = test::glassSettings(mode.mode);
                if (body != ball_) settings.draw.optics = thin;
                settings.draw.background = glm::vec3(0);
                const render::Image behind = draw({{board_, {}, {}}}, *backend, settings),
                                    with = draw({{board_, {}, {}}, {body, {}, {}}}, *backend, settings),
                                    alone = draw({{body, {}, {}}}, *backend, settings);
                settings.draw.background = bright;
                const render::Image before = draw({{board_, {}, {}}, {body, {}, {}}}, *backend, settings),
                                    aloneBefore = draw({{body, {}, {}}}, *backend, settings);
                size_t beside = 0, rims = 0, holes = 0, outside = 0;
                double off = 0, ofBackground = 0, control = 0, opaque = 0;
                for (size_t i = kWidth + 1; i + kWidth + 1 < with.rgba.size(); ++i) {
                    const double alpha = static_cast<double>(alone.rgba[i] >> 24) / 255;
                    const glm::dvec3 ray =
                        glm::normalize(view.forward + (double(i % kWidth) + 0.5 - 80) / view.focalPixels * view.right +
                                       (double(i / kWidth) + 0.5 - 80) / view.focalPixels * view.down);
                    const double from = (glm::length(glm::cross(view.eye, ray)) - 1) * pixelsOfUnit;
                    const double reach = body == points_ ? 4 : 2;
                    holes += isRound && from < -reach && alpha == 0 ? 1 : 0;
                    outside += isRound && from > reach && alpha > 0 ? 1 : 0;
                    rims += isRim(alone, kWidth, i) ? 1 : 0;
                    if (alpha == 0) {
                        ++beside;
                        ASSERT_EQ(with.rgba[i], behind.rgba[i]) << "at " << i;
                        ASSERT_EQ(with.depth[i], behind.depth[i]) << "at " << i;
                    }
                    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
                        const double under = behind.linear[c], own = alone.linear[c];
                        off = std::max(off, std::abs(double{with.linear[c]} - (own + (1 - alpha) * under)));
                        ofBackground =
                            std::max(ofBackground, std::abs(double{with.linear[c]} - double{before.linear[c]}));
                        if (!isRim(alone, kWidth, i)) continue;
                        control = std::max(control, std::abs(double{alone.linear[c]} - double{aloneBefore.linear[c]}));
                        opaque = std::max(opaque, std::abs(double{with.linear[c]} - under));
                    }
                }
                EXPECT_GT(beside, 2'000u);
                EXPECT_GT(rims, 100u);
                EXPECT_EQ(holes, 0u);
                EXPECT_EQ(outside, 0u);
                constexpr double kHalfByte = 0.5 / 255;  // coverage is a byte
                EXPECT_LE(off, kHalfByte + 1e-4);
                EXPECT_LE(ofBackground, kHalfByte + 1e-4);
                EXPECT_GT(control, 0.1) << "the control: without the board the background is seen there";
                EXPECT_GT(opaque, 0.05) << "the control: the rim is there";
            }
        }
}

}  // namespace
}  // namespace stipple
