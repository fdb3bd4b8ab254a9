// What a command is told of the camera is done in full or refused by name: nothing of it is lost without a word.
#include <gtest/gtest.h>

#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class CameraOptionsTest : public testing::Test {
  protected:
    int run(const std::string& arguments) {
        const test::Outcome r = test::runProgram(folder_, arguments);
        said_ = r.err;
        return r.code;
    }
    /// A picture of a small scan.
    int render(const std::string& options) { return run("render a.stipple -o a.png --quiet --size 48x32 " + options); }
    void SetUp() override {
        const auto executor = makeTbbExecutor(1);
        test::writePly(folder_ / "a.ply", test::bumpySphere(500, 1));
        test::build({folder_ / "a.ply"}, folder_ / "a.stipple", *executor);
    }
    test::TempFolder folder_;
    std::string said_;
};

TEST_F(CameraOptionsTest, WhatCannotBeLookedAtIsRefused) {
    for (const char* bad :
         {"--eye 1,2,3 --target 1,2,3", "--eye 1e308,0,0 --target=-1e308,0,0", "--eye 1e300,0,0", "--camera-up 0,0,0",
          "--camera-up 0,0,1e200", "--up 0,0,1e200", "--eye nan,0,0", "--target 0,inf,0", "--fov nan", "--fov 0",
          "--fov 180", "--time nan", "--time inf", "--wind nan", "--curve-exact nan"}) {
        EXPECT_EQ(render(bad), 2) << bad << ": " << said_;
        const std::string option = std::string(bad).substr(0, std::string(bad).find_first_of(" ="));
        EXPECT_NE(said_.find(option), std::string::npos) << bad << ": " << said_;
    }
    EXPECT_EQ(render("--eye 0,0,5 --target 0,0,0 --camera-up 0,1,0 --fov 30 --time 2 --wind 0.1"), 0) << said_;
}

TEST_F(CameraOptionsTest, ASizeThatIsNoneIsRefusedByViewAsByRender) {
    for (const char* command : {"view a.stipple", "render a.stipple -o a.png"})
        for (const char* size : {"potato", "0", "-1G", "1Q", "nan"}) {
            EXPECT_EQ(run(std::string(command) + " --resident=" + size), 2) << command << size << ": " << said_;
            EXPECT_NE(said_.find("--resident"), std::string::npos) << said_;
        }
}

TEST_F(CameraOptionsTest, PlacesOfTheCameraExcludeEachOther) {
    test::spit(folder_ / "path.json", R"({"keys": [{"t": 0, "eye": [0,0,5], "target": [0,0,0]}]})");
    for (const char* bad :
         {"--orbit 2 --frames 4", "--orbit 2 --frames 1", "--orbit 2 --eye 0,0,5", "--orbit 2 --camera-path path.json",
          "--scene-camera 1 --eye 0,0,5", "--scene-camera 1 --fov 20", "--camera-path path.json --target 1,0,0",
          "--camera-path path.json --fov 20", "--camera-path path.json --camera-up 0,0,1"})
        EXPECT_EQ(render(bad), 2) << bad << ": " << said_;
    EXPECT_EQ(render("--orbit 2"), 0) << said_;
    EXPECT_EQ(render("--camera-path path.json --frames 2"), 0) << said_;
}

TEST_F(CameraOptionsTest, UpIsTheScenesAxisAndSaysWhatTheCamerasIsCalled) {
    EXPECT_EQ(render("--up 0,0,1"), 2);
    EXPECT_NE(said_.find("--camera-up"), std::string::npos) << said_;
    EXPECT_EQ(render("--up q"), 2);
    EXPECT_EQ(run("render a.stipple -o y.png --quiet --size 48x32 --up y"), 0) << said_;
    EXPECT_EQ(run("render a.stipple -o z.png --quiet --size 48x32 --up z"), 0) << said_;
    EXPECT_EQ(run("render a.stipple -o plain.png --quiet --size 48x32"), 0) << said_;
    EXPECT_EQ(test::slurp(folder_ / "plain.png"), test::slurp(folder_ / "y.png")) << "PLY is y-up";
    EXPECT_NE(test::slurp(folder_ / "z.png"), test::slurp(folder_ / "y.png")) << "also of a built store";
}

}  // namespace
}  // namespace stipple
