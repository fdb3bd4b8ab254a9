// What stands in an EXR: depth along the view axis, normals in world space, coverage; read back from the file itself
// and held against the exact planes of the scene.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/image/image_io.h"
#include "tests/support/planes.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

TEST(Exr, EveryChannelComesBackBitForBit) {
    const test::TempFolder folder;
    render::Image image;
    image.width = 3;
    image.height = 2;
    for (uint32_t i = 0; i < 6; ++i) {
        image.rgba.push_back(i * 51u << 24);
        image.depth.push_back(2.5f + 1000.0f * static_cast<float>(i) / 3);
        for (uint32_t c = 0; c < 3; ++c) {
            image.normal.push_back(std::sin(static_cast<float>(3 * i + c)));
            image.linear.push_back(static_cast<float>(i) + 0.1f * static_cast<float>(c));
        }
    }
    ASSERT_TRUE(image::writeImage(folder / "a.exr", image));
    const test::Planes planes = test::readPlanes(folder / "a.exr");
    ASSERT_EQ(planes.width, 3u);
    ASSERT_EQ(planes.height, 2u);
    EXPECT_TRUE(planes.isFloat);
    EXPECT_EQ(planes.plane("Z"), image.depth);
    constexpr std::array kColours{"R", "G", "B"}, kNormals{"N.x", "N.y", "N.z"};
    for (size_t c = 0; c < 3; ++c) {
        std::vector<float> colour, normal;
        for (size_t i = 0; i < 6; ++i) {
            colour.push_back(image.linear[3 * i + c]);
            normal.push_back(image.normal[3 * i + c]);
        }
        EXPECT_EQ(planes.plane(kColours.at(c)), colour) << c;
        EXPECT_EQ(planes.plane(kNormals.at(c)), normal) << c;
    }
    const std::vector<float> alpha = planes.plane("A");
    ASSERT_EQ(alpha.size(), 6u);
    for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(double{alpha[i]}, 0.2 * static_cast<double>(i), 1e-6);
    EXPECT_TRUE(planes.plane("W").empty());
    // The comparison finds a change of one bit of a depth.
    test::Planes other = planes;
    const size_t z = 4;
    other.values[planes.names.size() + z] = std::nextafter(other.values[planes.names.size() + z], 1e9f);
    EXPECT_NE(test::hashPlanes(other), test::hashPlanes(planes));
    EXPECT_EQ(test::comparePlanes(planes, other).pixels, 1u);
    EXPECT_EQ(test::comparePlanes(planes, planes).pixels, 0u);
}

/// A tilted plane, seen by the program: depth and normal of every pixel inside are those of the plane.
TEST(Exr, DepthAndNormalsOfAPlaneAreThoseOfThePlane) {
    const test::TempFolder folder;
    const glm::dvec3 normal = glm::normalize(glm::dvec3(0.3, -0.2, 0.93)), eye(0.1, -0.3, 3), target(0, 0, 0);
    std::vector<test::TestPoint> points;
    for (int x = -100; x <= 100; ++x)
        for (int y = -100; y <= 100; ++y) {
            const glm::dvec2 p(0.01 * x, 0.01 * y);
            points.push_back({{p, -(normal.x * p.x + normal.y * p.y) / normal.z}, glm::vec3(normal)});
        }
    test::writePly(folder / "plane.ply", points);
    constexpr int kWidth = 160, kHeight = 121;
    const test::Outcome drawn = test::runProgram(
        folder,
        "render plane.ply -o a.exr --size 160x121 --alpha --device cpu --eye=0.1,-0.3,3 --target=0,0,0 "
        "--camera-up=0,1,0 --fov 50 --error 0.01");
    ASSERT_EQ(drawn.code, 0) << drawn.err;
    const test::Planes planes = test::readPlanes(folder / "a.exr");
    ASSERT_EQ(planes.width, uint32_t{kWidth});
    ASSERT_EQ(planes.height, uint32_t{kHeight});
    const std::vector<float> z = planes.plane("Z"), alpha = planes.plane("A");
    const std::array<std::vector<float>, 3> n{planes.plane("N.x"), planes.plane("N.y"), planes.plane("N.z")};
    ASSERT_EQ(z.size(), size_t{kWidth} * kHeight);
    const glm::dvec3 forward = glm::normalize(target - eye), right = glm::normalize(glm::cross(forward, {0, 1, 0})),
                     down = glm::cross(forward, right);
    const double focal = 0.5 * kHeight / std::tan(25 * M_PI / 180);
    size_t inside = 0, outside = 0;
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const size_t i = size_t{kWidth} * static_cast<size_t>(y) + static_cast<size_t>(x);
            const glm::dvec3 ray =
                forward + ((x + 0.5 - 0.5 * kWidth) * right + (y + 0.5 - 0.5 * kHeight) * down) / focal;
            const double depth = -glm::dot(normal, eye) / glm::dot(normal, ray);  // ray has length 1 along the axis
            const glm::dvec3 at = eye + depth * ray;
            const double beyond = std::max(std::abs(at.x), std::abs(at.y)) - 1;
            if (beyond > 0.1) {
                ++outside;
                EXPECT_EQ(z[i], 0.0f) << x << ' ' << y;
                EXPECT_EQ(alpha[i], 0.0f) << x << ' ' << y;
            }
            if (beyond > -0.1) continue;
            ++inside;
            ASSERT_NEAR(double{z[i]}, depth, 0.05 * depth / focal) << x << ' ' << y;
            double cosine = 0;
            for (int c = 0; c < 3; ++c) cosine += double{n.at(static_cast<size_t>(c))[i]} * normal[c];
            ASSERT_GT(cosine, std::cos(0.3 * M_PI / 180)) << x << ' ' << y;
            ASSERT_EQ(alpha[i], 1.0f);
        }
    EXPECT_GT(inside, 3000u);
    EXPECT_GT(outside, 1000u);
}

}  // namespace
}  // namespace stipple
