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

TEST(MakeView, HangsOnDirectionsAndNotOnLengths) {
    Camera camera;
    camera.eye = {0, 0, 0};
    camera.target = {1, 2, 3};
    camera.up = {0.2, 1, -0.1};
    const lod::View truth = makeView(camera, 100, 100, 0.1);
    for (const double length : {1e-300, 1e-100, 1e-12, 1e-6, 1e6, 1e14, 1e100, 1e300}) {
        Camera scaled = camera;
        scaled.up *= length;
        for (const bool isTarget : {false, true}) {
            if (isTarget) scaled.target *= length;
            const lod::View v = makeView(scaled, 100, 100, 0.1);
            EXPECT_LT(glm::length(v.right - truth.right), 1e-12) << length;
            EXPECT_LT(glm::length(v.forward - truth.forward), 1e-12) << length;
        }
    }
}

TEST(CameraPath, FieldsOfViewThatNobodyCanSeeAreRefusedByName) {
    const test::TempFolder folder;
    for (const char* bad : {"0", "180", "-1", "1e308", "\"nan\"", "null"}) {
        std::ofstream(folder / "p.json") << R"({"keys": [{"t": 0, "eye": [0,0,0], "target": [1,0,0], "fov": )" << bad
                                         << "}]}";
        const auto path = readCameraPath(folder / "p.json");
        ASSERT_FALSE(path) << bad;
        EXPECT_NE(path.error().line().find("'fov'"), std::string::npos) << path.error().line();
        EXPECT_NE(path.error().line().find("key 0"), std::string::npos) << path.error().line();
    }
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
