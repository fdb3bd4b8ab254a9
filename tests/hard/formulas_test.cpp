// Formulas of frames and records, value by value: hard cases 9 (depths over many decades), 13 (boxes by a difference of
// squares), 43 (displacements drift), 45 (radii in few bits), 54 (time in fp32), 56 (lengths by squares). Each with its
// naive formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/rng.h"
#include "engine/render/wind.h"
#include "lod/builder/points/aggregate.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/mesh.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/pyramid.h"
#include "shaders/shared/record.h"
#include "shaders/shared/visibility.h"
#include "shaders/shared/wide_disc.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;
using namespace shared;

/// Keys tell depths apart that differ by 2^-20 of themselves, from a millimetre to ten thousand kilometres.
TEST(Formulas, DepthsOfAllDecadesSortByTheirLastBits) {
    Rng rng(1);
    size_t naive = 0, pairs = 0;
    for (int decade = -2; decade <= 7; ++decade)
        for (int k = 0; k < 1000; ++k, ++pairs) {
            const double z = std::pow(10, decade + rng.uniform(0, 1));
            const auto near = static_cast<float>(z), far = static_cast<float>(z * (1 + 0x1p-20));
            // The nearer one has the larger id: it is depth that decides.
            ASSERT_LT(visibilityKey(floatBitsToUint(near), drawId(0, 255)),
                      visibilityKey(floatBitsToUint(far), drawId(0, 0)));
            // 24 bits of z / w between planes at 1e-2 and 1e8.
            const auto code = [](double d) { return std::lround((1e8 / (1e8 - 1e-2)) * (1 - 1e-2 / d) * 0xffffff); };
            naive += code(z) >= code(z * (1 + 0x1p-20));
        }
    std::printf("%zu of %zu pairs in a buffer of 24 bits are one depth\n", naive, pairs);
    EXPECT_GT(naive, pairs / 2);
}

/// Least and greatest x / z of a circle before the eye, in long double: s with |a.c| = r |a in the plane|, a = (1, 0,
/// -s).
std::array<long double, 2> slopesOf(const dvec3& c, const dvec3& n, long double r) {
    using L = long double;
    const L nx = n.x, nz = n.z, cx = c.x, cz = c.z;
    // (cx - s cz)^2 = r^2 (1 + s^2 - (nx - s nz)^2)
    const L a = cz * cz - r * r * (1 - nz * nz), b = cx * cz + r * r * nx * nz, k = cx * cx - r * r * (1 - nx * nx);
    const L mid = b / a, root = std::sqrt(std::max<L>(b * b - a * k, 0)) / a;
    return {mid - root, mid + root};
}

TEST(Formulas, BoxesOfDiscsAreTheirsAtEightThousandPixels) {
    Rng rng(2);
    double worst = 0, naive = 0;
    size_t pixels = 0;
    constexpr double kFocal = 7680, kMiddle = 3840;
    const Lens lens = lensOf(kFocal, false);
    for (int k = 0; k < 50'000; ++k) {
        dvec3 n;
        do n = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
        while (glm::length(n) < 0.1);
        const glm::vec3 unit(glm::normalize(n));
        const double z = std::exp2(rng.uniform(-6, 20));
        const glm::vec3 c(dvec3(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.3, 0.3) * z, z));
        const auto r = static_cast<float>(z / kFocal * std::exp2(rng.uniform(-1, 9)));
        const auto truth = slopesOf(dvec3(c), dvec3(unit), r);
        const vec2 found = discSlopes(lens, c.x, c.z, unit.x, unit.z, r);
        const auto off = [&](float s, long double t) {
            return kFocal * std::abs(double(static_cast<long double>(s) - t));
        };
        worst = std::max({worst, off(found.x, truth[0]), off(found.y, truth[1])});
        // No pixel whose centre is between them is left out.
        const PixelRange range = pixelsBetween(found, kFocal, kMiddle, 7680);
        const auto first = static_cast<long>(std::ceil(truth[0] * kFocal + kMiddle - 0.5L)),
                   last = static_cast<long>(std::floor(truth[1] * kFocal + kMiddle - 0.5L));
        for (const long x : {first, last}) {
            if (x < 0 || x >= 7680 || first > last) continue;
            ASSERT_TRUE(x >= range.first && x <= range.last) << x;
            ++pixels;
        }
        // The matrix of the disc in absolute pixels, h^2 = p^2 - (f . T0^2), in fp32 (Sigg et al. 2006).
        const dvec3 s = glm::normalize(
                        glm::cross(dvec3(unit), std::abs(unit.x) < 0.7f ? dvec3(1, 0, 0) : dvec3(0, 1, 0))),
                    t = glm::cross(dvec3(unit), s);
        const glm::vec3 row0(dvec3(kFocal * s.x + kMiddle * s.z, kFocal * t.x + kMiddle * t.z, 0) * double{r} +
                             dvec3(0, 0, kFocal * c.x + kMiddle * c.z)),
            row2(dvec3(s.z * r, t.z * r, c.z));
        const glm::vec3 sign(1, 1, -1), f = sign / glm::dot(sign, row2 * row2);
        const float p = glm::dot(f, row0 * row2), h = std::sqrt(std::max(p * p - glm::dot(f, row0 * row0), 0.0f));
        naive = std::max(naive, std::abs(double{p - h} - double(truth[0] * kFocal + kMiddle)));
    }
    std::printf("%.4f px, naive %.2f px, %zu ends of rows\n", worst, naive, pixels);
    EXPECT_LE(worst, 0.02);
    EXPECT_GT(naive, 1);
    EXPECT_GT(pixels, 10'000u);
}

TEST(Formulas, RadiiAreRoundedOutwardsBySixteenthsOfAnOctave) {
    Rng rng(3);
    double most = 0, fast = 0, naive = 1;
    for (int k = 0; k < 100'000; ++k) {
        const double edge = std::exp2(rng.uniform(-30, 30)), radius = edge * std::exp2(rng.uniform(-15.9, 0));
        const uint32_t code = lod::radiusCodeUp(radius, edge);
        const double stored = lod::radiusOf(code, edge);
        // (2e-7: what was rounded to fp32 gets its own code again.)
        ASSERT_GE(stored, radius * (1 - 2e-7));
        most = std::max(most, stored / radius - 1);
        fast = std::max(fast, std::abs(double{radiusFractionFast(code)} / double{radiusFraction(code)} - 1));
        const double nearest = std::round(16 * std::log2(radius / edge)) / 16;
        naive = std::min(naive, edge * std::exp2(nearest) / radius);
    }
    EXPECT_LE(most, std::exp2(1.0 / 16) - 1 + 1e-6);  // 4.4 %
    EXPECT_GT(most, 0.04);
    EXPECT_LE(fast, 3 * 0x1p-23);
    EXPECT_LT(naive, 0.98);  // to the nearest, a disc is up to 2.2 % smaller than what it stands for
}

/// A plant in the wind now and a million gusts later is in the same pose, whatever the step of time.
TEST(Formulas, PosesInTheWindAreThoseOfAMillionPeriodsLater) {
    lod::Hierarchy h;
    h.unit = 0.01;
    lod::Node node;
    node.centre = {0, 0, 500};
    node.radius = 500;
    h.nodes.push_back(node);
    node.centre = {0, 0, 900};
    node.radius = 50;
    h.nodes.push_back(node);
    lod::Instance instance;
    instance.sway = 1;
    const double height = 10, period = 10 * std::sqrt(height) / 0.9;  // of both waves: 0.9 and 2.3 times that
    lod::View view;
    view.eye = {0, -30, 5};
    const auto swingAt = [&](double seconds) {
        render::Wind wind;
        wind.strength = 0.1;
        wind.seconds = seconds;
        const render::Bend bend = render::bendOf(wind, h, instance, 1, view, {0, 0, 1});
        return bend.slope * 9 + bend.offset;  // m, of what stands at 9 m
    };
    double worst = 0, naive = 0, most = 0;
    for (int k = 0; k < 1000; ++k) {
        const double t = period * k / 1000, later = t + 1e6 * period;
        worst = std::max(worst, std::abs(swingAt(later) - swingAt(t)));
        naive = std::max(naive, std::abs(swingAt(double{static_cast<float>(later)}) - swingAt(t)));
        most = std::max(most, std::abs(swingAt(t)));
    }
    std::printf("%.1e m of %.2f m; with seconds in fp32 %.2f m\n", worst, most, naive);
    EXPECT_GT(most, 0.3);
    EXPECT_LE(worst, 1e-4 * most);
    EXPECT_GT(naive, 0.1 * most);
}

/// Unit vectors of any length from 1e-30 to 1e30, which as squares are zero or infinite.
TEST(Formulas, NormalsOfTrianglesOfAnySizeAreOfLengthOne) {
    Rng rng(4);
    double worst = 0;
    size_t lost = 0, all = 0;
    for (int k = 0; k < 100'000; ++k) {
        dvec3 n;
        do n = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
        while (glm::length(n) < 0.1);
        n = glm::normalize(n);
        const glm::vec3 scaled(n * std::pow(10, rng.uniform(-30, 30)));
        const glm::vec3 unit(surfaceNormal(scaled, scaled, vec3(0, 0, 1)));
        worst = std::max(worst, std::abs(glm::length(dvec3(unit)) - 1) / 0x1p-24);
        ASSERT_LT(std::min(glm::length(dvec3(unit) - n), glm::length(dvec3(unit) + n)), 1e-6);
        const float length = std::sqrt(glm::dot(scaled, scaled));  // the naive formula
        lost += !(std::isfinite(length) && std::abs(glm::length(dvec3(scaled / length)) - 1) < 1e-6);
        ++all;
    }
    std::printf("%.1f ulps; by squares %zu of %zu have no length\n", worst, lost, all);
    EXPECT_LE(worst, 4);
    EXPECT_GT(lost, all / 4);
}

/// What a pixel covers of a texture does not hang on the unit of length: products of four lengths are no floats beyond
/// 1e-9 and 1e9 (hard case 56). Roundings of places, 2^-24, grow by how slanted and thin a triangle is.
TEST(Formulas, FootprintsOnTexturesAreThoseOfAnySize) {
    Rng rng(9);
    double worst = 0;
    for (int k = 0; k < 20'000; ++k) {
        const auto within = [&](double most) {
            return dvec3(rng.uniform(-most, most), rng.uniform(-most, most), rng.uniform(-most, most));
        };
        const dvec3 a = within(0.3) + dvec3(0, 0, rng.uniform(1, 9)), e1 = within(1), e2 = within(1);
        const dvec3 n = glm::cross(e1, e2);
        PixelRay ray{};
        ray.isOrthographic = rng.next() % 2 == 0;
        const dvec3 along = ray.isOrthographic ? dvec3(0, 0, 1) : a / a.z;
        if (!(std::abs(glm::dot(n, along)) > 0.2 * glm::length(e1) * glm::length(e2))) continue;
        ray.ex = ray.isOrthographic ? 0.0f : static_cast<float>(along.x);
        ray.ey = ray.isOrthographic ? 0.0f : static_cast<float>(along.y);
        const auto footprint = [&](double size) {
            const double inverseFocal = ray.isOrthographic ? 1e-3 * size : 1e-3;  // (there of the new length as well)
            return double{uvFootprint(ray, static_cast<float>(inverseFocal), vec3(a * size), vec3(e1 * size),
                                      vec3(e2 * size), vec2(0.7f, 0.1f), vec2(-0.2f, 0.9f))};
        };
        const double usual = footprint(1), other = footprint(std::pow(10, rng.uniform(-30, 30)));
        ASSERT_GT(usual, 0);
        worst = std::max(worst, std::abs(other / usual - 1));
    }
    std::printf("at most %.1e off\n", worst);
    EXPECT_LE(worst, 256 * 0x1p-24);
}

/// The offset itself, packed and unpacked at each level that its splat reaches, at the right of a wide picture. (Wider
/// ones are drawn exactly.) A packed offset is rounded by a 4096th of the radius at most, at each of seven levels.
TEST(Formulas, OffsetsOfSplatsComeThroughAllLevels) {
    Rng rng(5);
    double worst = 0, naive = 0;
    for (int k = 0; k < 2000; ++k) {
        const double at = rng.uniform(1024, 1920);
        Texel t{};
        t.depth = 3;
        t.radius = static_cast<float>(std::exp2(rng.uniform(1, std::log2(wideRadius(1920, 1080)))));
        t.thickness = 0.25f * t.radius;
        t.normalPerp = {0, 0};
        t.colour = {1, 1, 1};
        auto texel = static_cast<long>(at);
        t.offset = {static_cast<float>(at - (static_cast<double>(texel) + 0.5)), 0};
        float size = 1;
        double half = at;  // kept as an absolute place in fp16
        for (int level = 0; size < 2 * t.radius; ++level, size *= 2) {
            Texel none{};
            const bool isRight = texel % 2 != 0;
            t = pullTexels(isRight ? none : t, isRight ? t : none, none, none, size, lensOf(1000, false));
            t = unpackTexel(packTexel(t));
            texel /= 2;
            const double middle = (static_cast<double>(texel) + 0.5) * 2 * double{size};
            worst = std::max(worst, std::abs(middle + double{t.offset.x} - at));
            half = std::round(half);  // from 1024 on fp16 has whole numbers
        }
        naive = std::max(naive, std::abs(half - at));
    }
    std::printf("%.4f px, as absolute fp16 %.2f px\n", worst, naive);
    EXPECT_LE(worst, 7 * 60.0 / 4096);
    EXPECT_GT(naive, 0.45);
}

}  // namespace
}  // namespace stipple
