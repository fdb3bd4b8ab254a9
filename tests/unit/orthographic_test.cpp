// Orthographic cameras as people give them: options, paths and scenes, all the way to pictures.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "engine/image/image_io.h"
#include "engine/scene/camera.h"
#include "engine/scene/scene.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class OrthographicProgram : public testing::Test {
  protected:
    int run(const std::string& arguments) {
        const test::Outcome r = test::runProgram(folder_, arguments);
        said_ = r.err;
        return r.code;
    }
    int render(const std::string& options, const std::string& input = "a.stipple", const std::string& to = "a.png") {
        return run(fmt::format("render {} -o {} --force --quiet --size 96x64 {}", input, to, options));
    }
    /// Pixels of the picture's columns and rows between which something is drawn.
    glm::uvec2 extent(const std::string& name) {
        const auto image = image::readImage(folder_ / name);
        EXPECT_TRUE(image);
        glm::uvec2 lo(~0u), hi(0);
        for (uint32_t i = 0; image && i < image->rgba.size(); ++i)
            if (image->rgba[i] >> 24 != 0) {
                lo = glm::min(lo, glm::uvec2(i % image->width, i / image->width));
                hi = glm::max(hi, glm::uvec2(i % image->width, i / image->width) + 1u);
            }
        return hi - lo;
    }
    void SetUp() override {
        const auto executor = makeTbbExecutor(1);
        // A square of edge 2, level.
        std::vector<test::TestPoint> points;
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x)
                points.push_back({{x / 31.5 - 1, y / 31.5 - 1, 0}, {0, 0, 1}, 0xc0c0c0, 0.03f});
        test::writePly(folder_ / "a.ply", points, true, true);
        test::build({folder_ / "a.ply"}, folder_ / "a.stipple", *executor);
    }
    test::TempFolder folder_;
    std::string said_;
};

TEST_F(OrthographicProgram, WidthsThatAreNoneAreRefusedByName) {
    for (const char* width : {"0", "-1", "nan", "inf", "potato", "1e300"})
        for (const char* command : {"render a.stipple -o a.png", "view a.stipple"}) {
            EXPECT_EQ(run(fmt::format("{} --ortho={}", command, width)), 2) << width << said_;
            EXPECT_NE(said_.find("--ortho"), std::string::npos) << said_;
        }
    for (const char* both : {"--ortho 2 --fov 30", "--ortho 2 --scene-camera 1"}) EXPECT_EQ(render(both), 2) << both;
}

TEST_F(OrthographicProgram, TheWidthIsWhatThePictureShowsFromWhereverOneLooks) {
    // A square of edge 2 and 0.03 at each side, 96 pixels for 4 units.
    for (const char* eye : {"0,0,1", "0,0,1000", "0,0,1e7"}) {
        ASSERT_EQ(render(fmt::format("--ortho 4 --eye {} --target 0,0,0 --camera-up 0,1,0 --alpha", eye)), 0) << said_;
        const glm::uvec2 size = extent("a.png");
        EXPECT_NEAR(size.x, 2.06 * 24, 2) << eye;
        EXPECT_NEAR(size.y, 2.06 * 24, 2) << eye;
    }
    ASSERT_EQ(render("--ortho 4 --alpha"), 0) << said_;  // all of it is before the eye
    EXPECT_GE(extent("a.png").x, 40u);
    ASSERT_EQ(render("--ortho 4 --orbit 3 --alpha", "a.stipple", "o.png"), 0) << said_;
}

TEST_F(OrthographicProgram, PathsAreOrthographicByKeysOrByTheOption) {
    test::spit(folder_ / "p.json", R"({"keys": [{"t": 0, "eye": [0,0,9], "target": [0,0,0], "up": [0,1,0], "ortho": 4},
        {"t": 1, "eye": [0,0,5], "target": [0,0,0], "up": [0,1,0], "ortho": 8}]})");
    const auto path = scene::readCameraPath(folder_ / "p.json");
    ASSERT_TRUE(path);
    EXPECT_EQ(scene::makeView(path->at(0), 96, 64, 1).focalPixels, 24);
    const lod::View between = scene::makeView(path->at(0.5), 96, 64, 1);
    EXPECT_TRUE(between.isOrthographic);
    EXPECT_NEAR(96 / between.focalPixels, 6, 0.1);
    ASSERT_EQ(render("--camera-path p.json --frames 2 --alpha", "a.stipple", "p.png"), 0) << said_;
    for (const char* bad : {R"({"keys": [{"t": 0, "eye": [0,0,9], "target": [0,0,0], "ortho": 0}]})",
                            R"({"keys": [{"t": 0, "eye": [0,0,9], "target": [0,0,0], "ortho": 2, "fov": 30}]})",
                            R"({"keys": [{"t": 0, "eye": [0,0,9], "target": [0,0,0], "ortho": 2},
                                {"t": 1, "eye": [0,0,9], "target": [0,0,0]}]})"}) {
        test::spit(folder_ / "bad.json", bad);
        const auto refused = scene::readCameraPath(folder_ / "bad.json");
        ASSERT_FALSE(refused) << bad;
        EXPECT_NE(refused.error().line().find("ortho"), std::string::npos) << refused.error().line();
    }
}

TEST_F(OrthographicProgram, CamerasOfScenesShowWhatTheySay) {
    scene::Scene s;
    scene::SceneCamera camera;
    camera.isOrthographic = true;
    camera.width = 6;
    camera.height = 2;
    s.cameras.push_back(camera);
    scene::Node store, eye;
    store.store = "a.stipple";
    eye.camera = 0;
    eye.local = glm::dmat4(1);
    eye.local[3] = {0, 0, 50, 1};
    s.nodes = {store, eye};
    ASSERT_TRUE(scene::writeGltf(s, folder_ / "s.gltf"));
    const auto back = scene::readGltf(folder_ / "s.gltf");
    ASSERT_TRUE(back) << back.error().line();
    ASSERT_EQ(back->cameras.size(), 1u);
    EXPECT_TRUE(back->cameras[0].isOrthographic);
    EXPECT_DOUBLE_EQ(back->cameras[0].width, 6);
    EXPECT_DOUBLE_EQ(back->cameras[0].height, 2);
    // 6 x 4 units are seen in 96 x 64 pixels: the wider side decides.
    ASSERT_EQ(render("--scene-camera 1 --alpha", "s.gltf", "s.png"), 0) << said_;
    const glm::uvec2 size = extent("s.png");
    EXPECT_NEAR(size.x, 2.06 * 16, 2);
    EXPECT_NEAR(size.y, 2.06 * 16, 2);
}

}  // namespace
}  // namespace stipple
