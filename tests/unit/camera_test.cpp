#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "engine/scene/camera.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

TEST(MakeView, IsOrthonormalEvenLookingAlongUp) {
    Camera camera;
    camera.eye = {0, 0, 0};
    camera.target = {0, 5, 0};
    camera.up = {0, 1, 0};
    const lod::View v = makeView(camera, 100, 100, 0.1);
    EXPECT_NEAR(glm::length(v.right), 1, 1e-12);
    EXPECT_NEAR(glm::dot(v.right, v.forward), 0, 1e-12);
    EXPECT_NEAR(glm::length(glm::cross(v.right, v.down) - v.forward), 0, 1e-12);
}

TEST(CameraPath, GoesThroughItsKeysAndRefusesNonsense) {
    const test::TempFolder folder;
    const auto write = [&](const std::string& text) { std::ofstream(folder / "p.json") << text; };
    write(
        R"({"fps": 10, "keys": [{"t": 0, "eye": [0,0,0], "target": [1,0,0]}, {"t": 1, "eye": [2,0,0], "target": [3,0,0]}, {"t": 3, "eye": [2,5,0], "target": [3,5,0], "fov": 30}]})");
    const auto path = readCameraPath(folder / "p.json");
    ASSERT_TRUE(path) << path.error().line();
    EXPECT_EQ(path->at(1).eye, glm::dvec3(2, 0, 0));
    EXPECT_EQ(path->at(9).eye, glm::dvec3(2, 5, 0));
    EXPECT_EQ(path->at(3).fovDegrees, 30);
    EXPECT_EQ(path->at(1).up, glm::dvec3(0, 1, 0));
    EXPECT_EQ(readCameraPath(folder / "p.json", {0, 0, 1})->at(1).up, glm::dvec3(0, 0, 1));
    for (const char* bad :
         {"", "{}", R"({"keys": []})", R"({"keys": [{"t": 0}]})",
          R"({"fps": 0, "keys": [{"t": 0, "eye": [0,0,0], "target": [1,0,0]}]})",
          R"({"keys": [{"t": 1, "eye": [0,0,0], "target": [1,0,0]}, {"t": 1, "eye": [0,0,0], "target": [1,0,0]}]})"}) {
        write(bad);
        EXPECT_FALSE(readCameraPath(folder / "p.json")) << bad;
    }
}

}  // namespace
}  // namespace stipple::scene
