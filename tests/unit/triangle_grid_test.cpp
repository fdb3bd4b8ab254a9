// Distances by eights are those of one triangle after the other, to the bit, and those are distances.
#include "lod/builder/mesh/triangle_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/rng.h"

namespace stipple::lod {
namespace {

struct Triangles {
    std::vector<glm::vec3> position;
    std::vector<uint32_t> indices;
};

glm::vec3 anywhere(Rng& rng, float width) {
    const auto along = [&] { return width * static_cast<float>(rng.below(1u << 20)) / static_cast<float>(1u << 20); };
    return {along(), along(), along()};
}

/// Strewn triangles of about one size, some of them needles, points and lines, some of which share corners.
Triangles strewn(size_t count, float width, float size, Rng& rng) {
    Triangles out;
    for (size_t t = 0; t < count; ++t) {
        const glm::vec3 at = anywhere(rng, width);
        std::array<glm::vec3, 3> corner{at, at + anywhere(rng, size), at + anywhere(rng, size)};
        if (t % 7 == 1) corner[2] = corner[1];
        if (t % 7 == 2) corner[1] = corner[2] = corner[0];
        if (t % 7 == 3) corner[2] = 0.5f * (corner[0] + corner[1]);
        if (t % 7 == 4) corner[2] = corner[1] + 1e-4f * size;
        for (const glm::vec3& c : corner) {
            out.indices.push_back(static_cast<uint32_t>(out.position.size()));
            out.position.push_back(c);
        }
        if (t % 5 == 4) out.indices[out.indices.size() - 3] = out.indices[static_cast<uint32_t>(rng.below(3 * t))];
    }
    return out;
}

/// By dense samples of the triangle, double precision.
double sampledDistance(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    constexpr int kSteps = 200;
    double least = 1e300;
    for (int i = 0; i <= kSteps; ++i)
        for (int k = 0; k <= kSteps - i; ++k)
            least =
                std::min(least, glm::length(p - (a + (b - a) * (double(i) / kSteps) + (c - a) * (double(k) / kSteps))));
    return least;
}

TEST(TriangleGrid, TheLeastOfAllDistancesToTheBit) {
    Rng rng(5);
    for (const size_t count : {1, 2, 7, 8, 9, 60, 700})
        for (const float size : {0.01f, 1.0f, 40.0f}) {
            const Triangles of = strewn(count, 20, size, rng);
            const TriangleGrid grid(of.position, of.indices, true);
            for (int k = 0; k < 300; ++k) {
                const glm::vec3 p = k % 3 == 0   ? of.position[rng.below(of.position.size())]
                                    : k % 3 == 1 ? anywhere(rng, 20)
                                                 : anywhere(rng, 400) - 200.0f;
                float least = 3e38f;
                for (uint32_t t = 0; t < count; ++t) least = std::min(least, grid.distance(p, t));
                const auto hint = static_cast<uint32_t>(rng.below(count));
                ASSERT_EQ(grid.leastDistance(p, hint), least) << count << " triangles of " << size << ", " << k;
                // What is near enough may be another's, and no nearer than the nearest.
                const float enough = least * 1.5f + 0.1f, some = grid.leastDistance(p, hint, enough);
                ASSERT_GE(some, least);
                ASSERT_LE(some, enough);
                // One after the other says the same.
                float looked = 3e38f;
                grid.inBall(p, looked, [&](uint32_t t) {
                    looked = std::min(looked, grid.distance(p, t));
                    return false;
                });
                ASSERT_EQ(looked, least);
            }
        }
}

TEST(TriangleGrid, NeedlesAcrossAllAxesTakeNoMoreMemoryThanOthers) {
    Rng rng(7);
    Triangles of;
    for (uint32_t t = 0; t < 2000; ++t) {
        const glm::vec3 a = anywhere(rng, 10), b = 1000.0f - anywhere(rng, 10);
        for (const glm::vec3& c : {a, b, b + 1e-3f}) {
            of.indices.push_back(static_cast<uint32_t>(of.position.size()));
            of.position.push_back(c);
        }
    }
    const TriangleGrid grid(of.position, of.indices, false);
    EXPECT_LE(grid.items(), size_t{16 * 2000 + 64});
    for (int k = 0; k < 50; ++k) {
        const glm::vec3 p = anywhere(rng, 1000);
        float least = 3e38f;
        for (uint32_t t = 0; t < 2000; ++t) least = std::min(least, grid.distance(p, t));
        ASSERT_EQ(grid.leastDistance(p, 0), least);
    }
}

TEST(TriangleGrid, WhatIsNoNumberIsNoNearest) {
    // Products of four lengths of 2^31 and more are no floats.
    const float far = 0x1p32f;
    const std::vector<glm::vec3> position{{-far, -far, -far}, {far, -far, far}, {-far, far, far}, {1, 1, 1}};
    const std::vector<uint32_t> indices{0, 1, 2};
    const TriangleGrid grid(position, indices, false);
    for (const glm::vec3& p : {glm::vec3(far, far, -far), glm::vec3(0, 0, far), glm::vec3(1, 2, 3)})
        EXPECT_GE(grid.leastDistance(p, 0), 0.0f);
}

TEST(TriangleGrid, IsADistance) {
    Rng rng(6);
    const Triangles of = strewn(40, 2, 1, rng);
    const TriangleGrid grid(of.position, of.indices, false);
    for (uint32_t t = 0; t < 40; ++t)
        for (int k = 0; k < 4; ++k) {
            const glm::vec3 p = anywhere(rng, 4) - 1.0f;
            const double wanted = sampledDistance(p, grid.corner(t, 0), grid.corner(t, 1), grid.corner(t, 2));
            // (Samples lie a 200th of an edge apart.)
            EXPECT_LE(grid.distance(p, t), wanted + 1e-5);
            EXPECT_GE(grid.distance(p, t), wanted - 0.01);
        }
}

}  // namespace
}  // namespace stipple::lod
