// Maps of patches in pictures: as the fp64 restatement shows them, and as what they were made from looks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "lod/primitives/patch_map.h"
#include "lod/primitives/patch_samples.h"
#include "tests/support/against_oracle.h"
#include "tests/support/glass.h"
#include "tests/support/patch_scene.h"
#include "tests/support/patch_shapes.h"

namespace stipple {
namespace {

using test::PatchScene;

constexpr uint32_t kRough = 0, kSmoothMetal = 15 | 15 << 4;  // of materialGrid()

/// A bent patch with holes, and a map that knows much more than its samples: colours, normals, two materials.
lod::Patch detailed(uint32_t density) {
    lod::Patch p = test::patchOfHeights(
        37, 33, [](double x, double y) { return 0.3 * x * x - 0.2 * y * y; }, 0.03);
    const auto texel = [](double i, double j) {
        const auto byte = [](double v) { return static_cast<uint32_t>(std::lround(128 + 100 * std::sin(v))); };
        const uint32_t material = std::fmod(0.5 * (i + j), 2) < 1 ? kRough : kSmoothMetal;
        return byte(3 * i) | byte(2.5 * j + 1) << 8 | byte(i - 2 * j) << 16 | material << 24;
    };
    const auto normal = [](double i, double j) { return glm::vec3(0.4 * std::sin(2 * i), 0.4 * std::cos(3 * j), 1); };
    if (density > 0) test::giveMap(p, density, texel, normal, true);
    return p;
}

class PatchMapImages : public test::AgainstOracle {
  protected:
    static render::DrawSettings settings(uint32_t as, bool isLit = true) {
        render::DrawSettings s;
        s.patchAs = as;
        s.lit = isLit;
        s.unlitTriangles = !isLit;
        s.worldUp = {0, 1, 0};
        return s;
    }
};

TEST_F(PatchMapImages, AreThoseOfTheOracle) {
    for (const uint32_t density : {1u, 3u}) {
        PatchScene scene({detailed(density)}), plain({detailed(0)});
        scene.setMaterials(lod::materialGrid());
        for (const auto& [eye, isOrthographic] : {std::pair{glm::dvec3(0.5, 1.4, 2.4), false},
                                                  {glm::dvec3(0.1, 0.2, 0.7), false},  // magnified
                                                  {glm::dvec3(2.0, 5.4, 9.4), false},  // minified
                                                  {glm::dvec3(0.5, 1.4, 2.4), true}})
            for (const uint32_t as : {shared::kPatchStrips, shared::kPatchSplats}) {
                const lod::View view = test::glassView(eye, 240, isOrthographic);
                const render::Image expected = scene.draw(*oracle_, view, render::Mode::splat, settings(as));
                for (const auto& [name, backend] : backends_) {
                    const render::Image image = scene.draw(*backend, view, render::Mode::splat, settings(as));
                    EXPECT_GE(likeness(image, expected), 50)
                        << name << ", as " << as << ", " << density << " " << eye.z;
                    EXPECT_LT(likeness(plain.draw(*backend, view, render::Mode::splat, settings(as)), expected), 30)
                        << "the control: without maps";
                    size_t seen = 0, off = 0, depths = 0;
                    for (size_t i = 0; i < image.rgba.size(); ++i) {
                        if (!(image.depth[i] > 0 && expected.depth[i] > 0)) continue;
                        ++seen;
                        depths += std::abs(image.depth[i] - expected.depth[i]) > 1e-3f * expected.depth[i] ? 1 : 0;
                        double along = 0;
                        for (size_t a = 0; a < 3; ++a)
                            along += double{image.normal[3 * i + a]} * expected.normal[3 * i + a];
                        off += along < std::cos(3.14159 / 180) ? 1 : 0;
                    }
                    EXPECT_GT(seen, 300u);
                    EXPECT_LE(off + depths, seen / 500) << name << ", as " << as << ": " << off << " + " << depths;
                }
            }
    }
}

// On a plane direct interpolation is correct, but for discs that reach beyond the border.
TEST_F(PatchMapImages, OfDirectSplatsAreThoseOfCorrectOnesOnAPlane) {
    const lod::Patch plain = test::patchOfHeights(37, 33, [](double, double) { return 0; });
    lod::Patch whole = plain;
    test::giveMap(whole, 3, [&](double i, double j) {
        return static_cast<uint32_t>(std::lround(128 + 60 * std::sin(2 * i) + 60 * std::sin(1.5 * j))) * 0x10101u;
    });
    PatchScene scene({whole}), without({plain});
    for (const auto& eye : {glm::dvec3(0, 0.2, 1.3), glm::dvec3(0, 0.2, 5.0)}) {
        const lod::View view = test::glassView(eye, 240);
        for (const auto& [name, backend] : backends_) {
            const auto drawn = [&](PatchScene& of, uint32_t as) {
                return of.draw(*backend, view, render::Mode::splat, settings(as, false));
            };
            const render::Image correct = drawn(scene, shared::kPatchSplats);
            EXPECT_GT(likeness(drawn(scene, shared::kPatchDirect), correct), 35) << name;
            EXPECT_LT(likeness(drawn(without, shared::kPatchDirect), correct), 20) << name << ", the control";
        }
    }
}

/// Squares of a checker, and light between the middles of them as a texture of one texel a square shows it.
constexpr int kSquares = 6;
double checker(double u, double v) {
    const auto at = [](double w) { return std::clamp(w * kSquares - 0.5, 0.0, kSquares - 1.0); };
    const double x = at(u), y = at(v), fx = x - std::floor(x), fy = y - std::floor(y);
    double sum = 0;
    for (int c = 0; c < 4; ++c) {
        const int i = static_cast<int>(x) + c % 2, j = static_cast<int>(y) + c / 2;
        sum += (c % 2 != 0 ? fx : 1 - fx) * (c > 1 ? fy : 1 - fy) * ((i + j) % 2 == 0 ? 0.9 : 0.1);
    }
    return sum;
}

/// A flat patch of four samples a side that shows the checker; with a colour a sample, or a map of 2^density texels.
lod::Patch fourSamples(uint32_t density) {
    lod::Patch p = test::patchOfHeights(4, 4, [](double, double) { return 0; });
    const auto texel = [](double i, double j) {
        const float light = static_cast<float>(checker(i / 3, j / 3));
        return 0x10101u * static_cast<uint32_t>(std::lround(255 * shared::srgbFromLinear(light)));
    };
    for (uint32_t s = 0; s < 16; ++s) p.colours[s] = texel(s % 4, s / 4);
    if (density > 0) test::giveMap(p, density, texel);
    return p;
}
/// The same of a mesh of two triangles, as a build makes it: a few samples more, which reach beyond it.
lod::Patch builtOfTwo(uint32_t texels) {
    lod::TriangleMesh mesh =
        test::sheet(1, 1, [](double u, double v) { return glm::dvec3(1.5 * u - 0.75, 1.5 * v - 0.75, 0); });
    mesh.uv.clear();
    for (const glm::dvec3& p : mesh.position) mesh.uv.emplace_back(p.x / 1.5 + 0.5, p.y / 1.5 + 0.5);
    mesh.surface.assign(4, 0);
    mesh.colour.assign(4, 0xffffffffu);
    mesh.normal.clear();
    lod::PatchSettings how;
    how.samples = 16;
    how.maps.texels = texels;
    how.looks = [](uint32_t, const glm::vec2& uv, float) {
        return lod::PlaceLook{glm::vec3(static_cast<float>(checker(double{uv.x}, double{uv.y})))};
    };
    lod::PatchSet set = test::patchesOf(mesh, how, 1);
    EXPECT_EQ(set.patches.size(), 1u);
    set.patches.at(0).origin += set.middle;
    return set.patches.at(0);
}

/// Mean of `light` (of a place of a square about the origin, both from 0 to 1) over the pixels of a view from above,
/// sRGB bytes; -1 beyond a margin.
std::vector<double> seenFromAbove(const lod::View& view, double height, double edge, int taps,
                                  const std::function<double(double u, double v)>& light) {
    std::vector<double> out(size_t{view.width} * view.height, -1);
    for (uint32_t y = 0; y < view.height; ++y)
        for (uint32_t x = 0; x < view.width; ++x) {
            double sum = 0;
            bool isIn = true;
            for (int t = 0; t < taps * taps; ++t) {
                const glm::dvec2 at(x + (t % taps + 0.5) / taps, y + (t / taps + 0.5) / taps);
                const glm::dvec2 off = (at - 0.5 * glm::dvec2(view.width, view.height)) * (height / view.focalPixels);
                const glm::dvec3 p = off.x * view.right + off.y * view.down;
                const double u = p.x / edge + 0.5, v = p.y / edge + 0.5;
                isIn = isIn && std::min({u, v, 1 - u, 1 - v}) > 0.02;
                if (isIn) sum += light(u, v);
            }
            if (isIn)
                out[size_t{y} * view.width + x] =
                    255 * double{shared::srgbFromLinear(static_cast<float>(sum / (taps * taps)))};
        }
    return out;
}
double decibels(const std::vector<double>& expected, const std::function<double(size_t)>& is) {
    double squares = 0, count = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
        if (expected[i] < 0) continue;
        squares += (is(i) - expected[i]) * (is(i) - expected[i]);
        ++count;
    }
    EXPECT_GT(count, 300);
    return 10 * std::log10(255 * 255 / std::max(squares / count, 1e-9));
}
lod::View fromAbove(double height, uint32_t width) {
    lod::View view;
    view.eye = {0, 0, height};
    view.forward = {0, 0, -1};
    view.right = {1, 0, 0};
    view.down = {0, -1, 0};
    view.width = view.height = width;
    view.focalPixels = 1.1 * width;
    view.nearPlane = 1e-3;
    return view;
}

TEST_F(PatchMapImages, OfFewSamplesAreTheTextureThatTheyWereMadeFrom) {
    const lod::View view = fromAbove(2.2, 200);
    const auto compare = [&](const lod::Patch& maps, const lod::Patch& plain, double edge) {
        const std::vector<double> expected = seenFromAbove(view, 2.2, edge, 4, checker);
        PatchScene fine({maps}), coarse({plain});
        for (const auto& [name, backend] : backends_)
            for (const uint32_t as : {shared::kPatchStrips, shared::kPatchSplats}) {
                const auto drawn = [&](PatchScene& scene) {
                    const render::Image image = scene.draw(*backend, view, render::Mode::splat, settings(as, false));
                    return decibels(expected, [&](size_t i) { return static_cast<double>(image.rgba[i] & 255u); });
                };
                EXPECT_GE(drawn(fine), 35) << name << ", as " << as;
                EXPECT_LT(drawn(coarse), 30) << name << ", the control: a colour a sample";
            }
    };
    compare(fourSamples(3), fourSamples(0), 3 * double{fourSamples(0).step});
    compare(builtOfTwo(8), builtOfTwo(1), 1.5);
}

// A checker far finer than pixels: mips are means of it, as a box filter has it.
TEST_F(PatchMapImages, ThatAreFinerThanPixelsDoNotAlias) {
    constexpr uint32_t kSide = 161;
    const auto isWhite = [](double i, double j) {
        return (static_cast<int>(std::floor(3.1 * i)) + static_cast<int>(std::floor(3.1 * j))) % 2 == 0;
    };
    // Slowly brighter from left to right, so that what is seen is not one colour alone.
    const auto white = [](double i) { return std::floor(100 + i / 1.1); };
    lod::Patch p = test::patchOfHeights(kSide, kSide, [](double, double) { return 0; });
    test::giveMap(p, 3,
                  [&](double i, double j) { return isWhite(i, j) ? 0x10101u * static_cast<uint32_t>(white(i)) : 0u; });
    PatchScene scene({p});
    const auto light = [&](double u, double v) {
        const double i = u * (kSide - 1), j = v * (kSide - 1);
        return isWhite(i, j) ? double{shared::linearFromSrgb(static_cast<float>(white(i) / 255))} : 0;
    };
    const double edge = (kSide - 1) * double{p.step};
    for (const double height : {1.8, 4.5}) {  // 1.5 and 3.6 cells a pixel
        const lod::View view = fromAbove(height, 96);
        const auto expected = seenFromAbove(view, height, edge, 24, light),
                   nearest = seenFromAbove(view, height, edge, 1, light);
        for (const auto& [name, backend] : backends_) {
            const render::Image image =
                scene.draw(*backend, view, render::Mode::splat, settings(shared::kPatchStrips, false));
            EXPECT_GE(decibels(expected, [&](size_t i) { return static_cast<double>(image.rgba[i] & 255u); }), 30)
                << name << " at " << height;
        }
        EXPECT_LT(decibels(expected, [&](size_t i) { return nearest[i]; }), 15) << "the control: the nearest texel";
    }
}

// As points they have the mip of one texel a sample.
TEST_F(PatchMapImages, SamplesHaveTheirTexels) {
    constexpr uint32_t kSide = 32;
    lod::Patch p = test::patchOfHeights(kSide, kSide, [](double, double) { return 0; });
    test::giveMap(p, 3, [](double i, double) { return 0x10101u * static_cast<uint32_t>(std::lround(60 + 4 * i)); });
    const PatchScene scene({p});
    lod::Chunk chunk = scene.chunk();
    lod::samplesAsPoints(scene.hierarchy(), 0, chunk);
    const auto points = lod::withoutEmpty(chunk.records);
    ASSERT_EQ(points.size(), size_t{kSide} * kSide);
    for (const shared::PointRecord& r : points) {
        const double x = (r.positionXY & 0xffffu) / 32768.0 - 1, i = x / double{p.step} + 0.5 * (kSide - 1);
        EXPECT_NEAR(r.colour & 255u, 60 + 4 * i, 2.5);
    }
    EXPECT_TRUE(chunk.patchMaps.empty());
}

}  // namespace
}  // namespace stipple
