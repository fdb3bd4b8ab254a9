// The formulas that C++ and GLSL share, attacked in fp64.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/reference/decode.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/pyramid.h"
#include "shaders/shared/shade.h"
#include "shaders/shared/texture.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

glm::dvec3 randomDirection(Rng& rng) { return glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())); }

TEST(Octahedral, StaysWithinItsBoundEverywhere) {
    Rng rng(1);
    double worst = 0;
    const auto check = [&](const glm::dvec3& n) {
        const auto decoded = glm::dvec3(shared::octDecode(lod::octEncode(glm::vec3(n))));
        worst = std::max(worst, 2 * std::asin(0.5 * glm::length(decoded - n)));
        ASSERT_NEAR(glm::length(decoded), 1, 4e-7);
    };
    for (int i = 0; i < 1 << 20; ++i) check(randomDirection(rng));
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z)
                if (x || y || z) check(glm::normalize(glm::dvec3(x, y, z)));
    EXPECT_LE(worst * 180 / M_PI, 0.0037);
    EXPECT_EQ(glm::vec3(shared::octDecode(lod::octEncode({0, 0, 1}))), glm::vec3(0, 0, 1));
}

TEST(NormalPerp, GoesThereAndBackForAnyViewDirection) {
    Rng rng(2);
    for (int i = 0; i < 200'000; ++i) {
        glm::dvec3 v = randomDirection(rng);
        v.z = std::abs(v.z) + 1e-3;
        v = glm::normalize(v);
        glm::dvec3 n = randomDirection(rng);
        if (glm::dot(n, v) > 0) n = -n;
        const glm::vec3 vf(v), nf(n);
        const shared::vec2 p = shared::perpFromNormal(nf, vf);
        // The length of the components across the view is the sine of the angle to it, whatever the view.
        ASSERT_NEAR(std::hypot(double(p.x), double(p.y)), glm::length(glm::cross(n, v)), 2e-6);
        if (glm::dot(n, v) > -0.02) continue;  // the square root loses bits at the rim
        const glm::dvec3 back(shared::normalFromPerp(p, vf));
        ASSERT_LE(glm::length(back - n), 3e-5);
    }
}

TEST(PackedNormal, StaysWithinItsBoundHoweverTheNormalStands) {
    Rng rng(5);
    double worst = 0, acrossTheView = 0, ofComponents = 0;
    for (int i = 0; i < 1'000'000; ++i) {
        glm::dvec3 v = randomDirection(rng);
        v.z = std::abs(v.z) + 1e-3;
        v = glm::normalize(v);
        // Evenly, and half of them ever nearer to being across the view.
        const double facing = i % 2 == 0 ? rng.uniform() : std::exp2(-rng.uniform(0, 40));
        const glm::dvec3 aside = glm::normalize(glm::cross(v, randomDirection(rng)));
        const glm::dvec3 n = glm::normalize(std::sqrt(1 - facing * facing) * aside - facing * v);
        const shared::vec2 perp = shared::perpFromNormal(glm::vec3(n), glm::vec3(v));
        const auto degreesOff = [&](const shared::vec2& p) {
            const glm::dvec3 back(shared::normalFromPerp(p, glm::vec3(v)));
            return 2 * std::asin(std::min(1.0, 0.5 * glm::length(back - n))) * 180 / M_PI;
        };
        const double off = degreesOff(shared::unpackNormal(shared::packNormal(perp)));
        const uint32_t pair = shared::packPair(perp.x, perp.y);
        ofComponents = std::max(ofComponents, degreesOff({shared::unpackLow(pair), shared::unpackHigh(pair)}));
        double& largest = facing > std::sin(0.5 * M_PI / 180) ? worst : acrossTheView;
        largest = std::max(largest, off);
    }
    std::printf("normals of texels: %.4f degrees, across the view %.4f; two components %.3f\n", worst, acrossTheView,
                ofComponents);
    EXPECT_LE(worst, 0.004);
    EXPECT_LE(acrossTheView, 0.04);
    EXPECT_GE(ofComponents, 0.3) << "the control: components across the view, rounded";
}

TEST(PackTexel, KeepsEveryFieldWithinItsStatedError) {
    Rng rng(3);
    for (int i = 0; i < 200'000; ++i) {
        shared::Texel t;
        t.depth = static_cast<float>(std::exp2(rng.uniform(-20, 20)));
        t.radius = static_cast<float>(std::exp2(rng.uniform(-1, 14)));
        t.thickness = static_cast<float>(std::exp2(rng.uniform(-3, 14)));
        t.offset = {t.radius * static_cast<float>(rng.uniform(-15, 15)),
                    t.radius * static_cast<float>(rng.uniform(-15, 15))};
        const double along = rng.uniform(0, 2 * M_PI), sine = std::sqrt(rng.uniform());
        t.normalPerp = {static_cast<float>(sine * std::cos(along)), static_cast<float>(sine * std::sin(along))};
        t.colour = {static_cast<float>(rng.uniform()), static_cast<float>(rng.uniform()),
                    static_cast<float>(rng.uniform())};
        const shared::Texel u = shared::unpackTexel(shared::packTexel(t));
        ASSERT_EQ(u.depth, t.depth);
        ASSERT_NEAR(u.radius, t.radius, t.radius / 256);
        ASSERT_NEAR(u.thickness, t.thickness, t.thickness / 256);
        ASSERT_NEAR(u.offset.x, t.offset.x, t.radius * 16 / 32767);
        ASSERT_NEAR(u.offset.y, t.offset.y, t.radius * 16 / 32767);
        ASSERT_NEAR(u.normalPerp.x, t.normalPerp.x, 1.1 / 32767);
        ASSERT_NEAR(std::sqrt(u.colour.x), std::sqrt(t.colour.x), 0.6 / 2047);
        ASSERT_NEAR(std::sqrt(u.colour.z), std::sqrt(t.colour.z), 0.6 / 1023);
    }
}

shared::Texel plainTexel(float depth, float radius) {
    shared::Texel t{};
    t.depth = depth;
    t.radius = radius;
    t.thickness = radius * 0.25f;
    t.colour = {0.5f, 0.25f, 1.0f};
    return t;
}

/// On the axis of a lens of 1000 px.
shared::Texel push(const shared::Texel& fine, const std::array<shared::Texel, 4>& coarse, float sx, float sy,
                   float fineSize) {
    const auto disc = [&](size_t i) { return shared::coarseDisc(coarse.at(i), 0, 0, shared::lensOf(1000, false)); };
    return shared::pushTexel(fine, coarse[0], coarse[1], coarse[2], coarse[3], disc(0), disc(1), disc(2), disc(3), sx,
                             sy, 0, 0, fineSize, shared::lensOf(1000, false));
}

TEST(Pull, ConstantInGivesConstantOut) {
    const shared::Texel c = plainTexel(10, 3);
    const shared::Texel t = shared::pullTexels(c, c, c, c, 1, shared::lensOf(1000, false));
    EXPECT_FLOAT_EQ(t.depth, 10);
    EXPECT_EQ(t.radius, 3);
    EXPECT_EQ(t.colour.x, 0.5f);
    EXPECT_NEAR(t.offset.x, 0, 1e-6);
}

// Normals are turned to the eye: those of the surface before an outline and behind it are opposite across the view, and
// their mean faced the eye.
TEST(Pull, DiscsOnBothSidesOfAnOutlineStayEdgeOn) {
    shared::Texel before = plainTexel(10, 3), behind = plainTexel(10, 3);
    before.normalPerp = {0.96f, 0.1f};
    behind.normalPerp = {-0.98f, 0.05f};
    const shared::Lens lens = shared::lensOf(1000, false);
    for (const auto& [a, b] : {std::pair{before, behind}, {behind, before}}) {
        const shared::Texel t = shared::pullTexels(a, b, a, b, 1, lens);
        EXPECT_GT(std::abs(t.normalPerp.x), 0.96f);
    }
    // What is seen from its front alone keeps its mean.
    before.normalPerp = {0.5f, 0.0f};
    behind.normalPerp = {-0.5f, 0.0f};
    EXPECT_NEAR(shared::pullTexels(before, behind, before, behind, 1, lens).normalPerp.x, 0, 1e-6f);
}

TEST(Pull, ManyThinLayersDoNotChain) {
    // A staircase 0.9 thickness apart: only what touches the front layer may be merged (hard case 42).
    const float inverseFocal = 0.001f;
    const shared::Lens lens = shared::lensOf(1000, false);
    shared::Texel c[4];
    const float world = shared::thicknessWorld(plainTexel(10, 4), lens, inverseFocal);
    for (int i = 0; i < 4; ++i) c[i] = plainTexel(10 + 1.8f * world * static_cast<float>(i), 4);
    const shared::Texel t = shared::pullTexels(c[3], c[1], c[2], c[0], 1, lens);
    EXPECT_LE(t.depth + shared::thicknessWorld(t, lens, inverseFocal),
              10 + 2.01f * shared::thicknessWorld(c[1], lens, inverseFocal));
    EXPECT_LT(t.depth, c[2].depth);
}

TEST(Push, WhatLiesInFrontStaysAndWhatLiesBehindGoes) {
    const shared::Texel q = plainTexel(10, 4);
    const auto pushed = [&](float depth) { return push(plainTexel(depth, 1), {q, q, q, q}, -1, -1, 1).depth; };
    EXPECT_EQ(pushed(5), 5);  // in front: F13 of the flaw table discards it
    EXPECT_EQ(pushed(10.005f), 10.005f);
    EXPECT_NEAR(pushed(20), 10, 1e-5);
    EXPECT_NEAR(pushed(0), 10, 1e-5);  // empty
}

TEST(Push, DiscsThatOnlyShareACoarseTexelGrowNoLine) {
    // At the border of the image: two filled neighbours, two outside, and no ellipse anywhere near.
    shared::Texel none = plainTexel(0, 0), outside = plainTexel(-1, 0);
    none.thickness = outside.thickness = 0;
    shared::Texel left = plainTexel(10, 3), right = plainTexel(10, 3);
    left.offset = {-20, 0};
    right.offset = {20, 0};
    EXPECT_EQ(push(none, {left, right, outside, outside}, 1, -1, 16).depth, 0);
    // Between four of one surface a gap is closed, also where no rim quite reaches.
    shared::Texel near = plainTexel(10, 5);
    EXPECT_NEAR(push(none, {near, near, near, near}, 1, -1, 8).depth, 10, 1e-5);
}

TEST(Push, NothingComesFromNothing) {
    shared::Texel none = plainTexel(0, 0);
    none.thickness = 0;
    const shared::Texel t = push(none, {none, none, none, none}, 1, 1, 1);
    EXPECT_EQ(t.depth, 0);
    EXPECT_FALSE(std::isnan(t.radius + t.thickness + t.offset.x + t.normalPerp.x + t.colour.x));
}

TEST(Colour, BlackAndWhiteAverageInLinearLight) {
    const float mean = 0.5f * (shared::linearFromSrgb(0) + shared::linearFromSrgb(1));
    EXPECT_NEAR(shared::srgbFromLinear(mean) * 255, 188, 1);
    // (Black and white are the same either way: what lies between tells.)
    const float greys = 0.5f * (shared::linearFromSrgb(0.25f) + shared::linearFromSrgb(0.75f));
    EXPECT_NEAR(shared::srgbFromLinear(greys) * 255, 145.8, 0.5);  // 127.5 if they were linear
    for (int byte = 0; byte < 256; ++byte) {
        const float srgb = static_cast<float>(byte) / 255;
        EXPECT_NEAR(shared::srgbFromLinear(shared::linearFromSrgb(srgb)), srgb, 0.1 / 255);
    }
}

TEST(Reference, DecodesRecordsAsTheBackendsDo) {
    lod::Hierarchy h;
    h.origin = {4.1e6, 5.2e5, 4.9e6};
    h.unit = 0.001;
    h.rootLog2 = 22;
    lod::Node node;
    node.level = 3;
    node.cell = {5, 1, 7};
    node.stepShift = 3;
    Rng rng(5);
    for (int i = 0; i < 10'000; ++i) {
        const shared::PointRecord r{static_cast<uint32_t>(rng.next()), static_cast<uint32_t>(rng.next()),
                                    static_cast<uint32_t>(rng.next()) & 0xfffefffeu,
                                    static_cast<uint32_t>(rng.next()) & 0x00ffffffu};
        const reference::Disc d = reference::decodeDisc(h, node, r);
        const glm::dvec3 p =
            h.origin + h.unit * (h.recordOrigin(node) +
                                 std::exp2(node.stepShift) * glm::dvec3(recordX(r), recordY(r), recordZ(r)));
        ASSERT_LE(glm::length(p - d.position), 1e-8);
        ASSERT_EQ(d.errorCode, shared::recordErrorCode(r));
        ASSERT_EQ(d.octant, shared::recordOctant(r));
        ASSERT_NEAR(d.radius, h.unit * h.cellSize(node) * double(shared::radiusFraction(shared::recordRadiusCode(r))),
                    d.radius * 1e-6);
        ASSERT_LE(glm::length(d.normal - glm::dvec3(shared::octDecode(r.normal))), 1e-6);
    }
}

TEST(Shared, PolynomialsOfTexturesKeepTheirBounds) {
    for (int byte = 0; byte < 256; ++byte) {
        const float s = static_cast<float>(byte) / 255.0f;
        EXPECT_NEAR(shared::linearFromByte(s), shared::linearFromSrgb(s), 6e-6) << byte;
    }
    Rng rng(8);
    for (int i = 0; i < 100'000; ++i) {
        const auto v = static_cast<float>(std::exp2(rng.uniform(0, 29)));
        ASSERT_NEAR(shared::log2Above1(v), std::log2(static_cast<double>(v)), 1e-5) << v;
    }
    for (int e = 0; e < 30; ++e) EXPECT_EQ(shared::log2Above1(std::ldexp(1.0f, e)), static_cast<float>(e));
}

}  // namespace
}  // namespace stipple
