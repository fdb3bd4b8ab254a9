// Whatever stands in a file becomes an integer that the target holds. (A plain cast is undefined behaviour there: built
// with -fsanitize=float-cast-overflow it says so.)
#include "engine/base/numbers.h"

#include <gtest/gtest.h>

#include <array>
#include <glm/glm.hpp>

#include "engine/base/rng.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/mesh.h"
#include "shaders/shared/pack.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

template <typename T, typename F>
void expectNearest(F v) {
    // In long double every T and every float is exact.
    const long double least = std::numeric_limits<T>::min(), greatest = std::numeric_limits<T>::max();
    const long double wanted = std::isnan(v) ? 0 : std::clamp(std::trunc(static_cast<long double>(v)), least, greatest);
    EXPECT_EQ(static_cast<long double>(toWhole<T>(v)), wanted) << v;
}

TEST(Numbers, EveryFloatBecomesTheNearestIntegerThatTheTargetHolds) {
    std::vector<double> values{0.0,   -0.0,   0.5,    -0.5, 1e30,  -1e30,       1e-30,
                               1e308, -1e308, 5e-324, kInf, -kInf, std::nan("")};
    for (const int bits : {7, 8, 15, 16, 31, 32, 53, 63, 64})
        for (const double off : {-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0})
            for (const double sign : {-1.0, 1.0}) {
                values.push_back(sign * (std::ldexp(1, bits) + off));
                values.push_back(sign * std::nextafter(std::ldexp(1, bits), kInf * off));
            }
    Rng rng(3);
    for (int i = 0; i < 10'000; ++i) values.push_back(std::ldexp(rng.uniform(-2, 2), static_cast<int>(rng.below(100))));
    const auto each = [&]<typename T>(T) {
        for (const double v : values) {
            expectNearest<T>(v);
            expectNearest<T>(toFloat(v));
        }
    };
    each(int8_t{});
    each(uint8_t{});
    each(uint16_t{});
    each(int32_t{});
    each(uint32_t{});
    each(int64_t{});
    each(uint64_t{});
    for (const double v : values) {
        const float f = toFloat(v);
        if (std::isnan(v))
            EXPECT_TRUE(std::isnan(f));
        else if (std::abs(v) > 3.4028235e38)
            EXPECT_EQ(f, std::copysign(static_cast<float>(kInf), static_cast<float>(std::copysign(1, v))));
        else
            EXPECT_NEAR(f, v, std::abs(v) * 6e-8 + 1e-45);
    }
}

TEST(Numbers, ChannelsBecomeBytes) {
    for (int byte = 0; byte < 256; ++byte)
        EXPECT_EQ(unitToByte(static_cast<float>(byte) / 255), static_cast<uint32_t>(byte));
    for (const float v : {-1.0f, -1e30f, std::nanf(""), -INFINITY, 1e-40f}) EXPECT_EQ(unitToByte(v), 0u) << v;
    for (const float v : {1.0f, 1.5f, 1e30f, INFINITY}) EXPECT_EQ(unitToByte(v), 255u) << v;
}

TEST(Numbers, ATexelOfAnyValuesIsPackedIntoItsBits) {
    // What is not a number reads as an end of the range; whatever it is, what is unpacked is a number in its range.
    const std::vector<float> hostile{0.0f,    -0.0f, 1.0f,   -1.0f,    1e30f,     -1e30f,       1e-30f,
                                     -1e-30f, 1e38f, 1e-45f, INFINITY, -INFINITY, std::nanf("")};
    Rng rng(4);
    const auto any = [&] { return hostile[rng.below(hostile.size())]; };
    for (int i = 0; i < 200'000; ++i) {
        shared::Texel t;
        t.depth = any();
        t.radius = std::abs(any());
        t.thickness = std::abs(any());
        t.offset = shared::vec2(any(), any());
        t.normalPerp = shared::vec2(any(), any());
        t.colour = shared::vec3(any(), any(), any());
        t.isRound = rng.below(2) != 0 ? 1.0f : 0.0f;
        t.axis = shared::vec2(any(), any());
        const shared::Texel back = shared::unpackAnyTexel(shared::packAnyTexel(t));
        for (const float c : {back.colour.x, back.colour.y, back.colour.z}) ASSERT_TRUE(c >= 0 && c <= 1) << c;
        for (const float c : {back.normalPerp.x, back.normalPerp.y, back.axis.x, back.axis.y})
            ASSERT_TRUE(c >= -1.0001f && c <= 1.0001f) << c;
        const shared::Texel plain = shared::unpackTexel(shared::packTexel(t));
        for (const float c : {plain.colour.x, plain.colour.y, plain.colour.z}) ASSERT_TRUE(c >= 0 && c <= 1) << c;
    }
}

double angleBetween(const glm::dvec3& a, const glm::dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * 57.29577951308232;
}

TEST(Numbers, NormalsOfAnyLengthKeepTheirDirection) {
    Rng rng(5);
    for (int i = 0; i < 20'000; ++i) {
        const glm::dvec3 n = glm::normalize(glm::dvec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)));
        for (const double length : {1e-37, 1e-30, 1e-20, 1e-10, 1.0, 1e10, 1e20, 1e30, 3e38}) {
            const glm::vec3 scaled(n * length);
            ASSERT_TRUE(hasDirection(scaled));
            const glm::dvec3 back(glm::vec3(shared::octDecode(lod::octEncode(scaled))));
            ASSERT_LT(angleBetween(back, n), 0.01) << length;
        }
    }
    EXPECT_FALSE(hasDirection(glm::vec3(0)));
    EXPECT_FALSE(hasDirection(glm::vec3(1, INFINITY, 0)));
    EXPECT_FALSE(hasDirection(glm::vec3(1, 0, std::nanf(""))));
    EXPECT_TRUE(hasDirection(glm::vec3(3e38f)));
    EXPECT_TRUE(isFinite(glm::dvec3(1e308, 1e308, 1e308)));
}

TEST(Numbers, TheShadedNormalOfATriangleHangsOnItsShapeAlone) {
    // Two edges with texture coordinates, in units from 1e-18 to 1e18. Oracle: the plane's normal in long units of
    // fp64.
    Rng rng(6);
    for (int i = 0; i < 2000; ++i) {
        const auto random = [&] { return glm::dvec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)); };
        const glm::dvec3 e1 = random(), e2 = random(), ray(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), 1);
        glm::dvec3 plane = glm::normalize(glm::cross(e1, e2));
        if (glm::dot(plane, ray) > 0) plane = -plane;
        if (glm::length(glm::cross(e1, e2)) < 0.05 || std::abs(glm::dot(plane, glm::normalize(ray))) < 0.05) continue;
        for (const double unit : {1e-18, 1e-15, 1e-12, 1e-9, 1e-4, 1.0, 1e5, 1e12, 1e15, 1e18}) {
            const glm::vec3 a(e1 * unit), b(e2 * unit), r(ray);
            const glm::vec3 face = glm::cross(a, b);
            const glm::vec3 flat(shared::surfaceNormal(face, face, r));
            ASSERT_LT(angleBetween(glm::dvec3(flat), plane), 0.01) << unit;
            ASSERT_NEAR(glm::length(flat), 1, 1e-5) << unit;
            // A normal map that says "straight up" bends nothing; one along u leans towards the first edge.
            const glm::vec3 up(shared::bumpedNormal(face, a, b, {1, 0}, {0, 1}, {0, 0, 1}));
            ASSERT_LT(angleBetween(glm::dvec3(up), glm::cross(e1, e2)), 0.01) << unit;
            const glm::vec3 along(shared::bumpedNormal(face, a, b, {1, 0}, {0, 1}, {1, 0, 0}));
            ASSERT_LT(angleBetween(glm::dvec3(along), e1), 0.01) << unit;
        }
    }
}

TEST(Numbers, TrianglesFoldedOverInAFlatSurfaceAreShadedAsItIs) {
    // Seen from the side of the surface's normal: neither is a triangle whose corners run the other way round its back,
    // nor one that is so thin that its own normal is what rounding left. From behind it is turned, as all of it.
    Rng rng(8);
    for (int i = 0; i < 2000; ++i) {
        const auto random = [&] { return glm::dvec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)); };
        const glm::dvec3 ray(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), 1);
        glm::dvec3 outward = glm::normalize(random());
        if (std::abs(glm::dot(outward, glm::normalize(ray))) < 0.05) continue;
        const glm::vec3 n(outward), r(ray), noise(random());
        const glm::dvec3 seen = glm::dot(outward, ray) > 0 ? -outward : outward;
        for (const glm::vec3& face : {n * 1e-12f, n * -1e-12f, n * -3.0f}) {
            const glm::vec3 shaded(shared::surfaceNormal(n, shared::faceBeside(face, n), r));
            ASSERT_LT(angleBetween(glm::dvec3(shaded), seen), 0.001);
        }
        if (glm::dot(outward, ray) < -0.999 * glm::length(ray)) {
            const glm::vec3 thin(shared::surfaceNormal(n, shared::faceBeside(noise, n), r));
            ASSERT_LT(angleBetween(glm::dvec3(thin), seen), 0.1);
        }
        // The control: without, what is folded is bent to its outline.
        const glm::vec3 naive(shared::surfaceNormal(n, n * (glm::dot(outward, ray) < 0 ? -1.0f : 1.0f), r));
        if (glm::dot(outward, ray) < 0) ASSERT_GT(angleBetween(glm::dvec3(naive), seen), 0.04);
    }
}

}  // namespace
}  // namespace stipple
