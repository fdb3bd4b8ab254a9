// What is asked for is done, or it is said in one line that it is not: options, pictures that show little or nothing,
// cameras, legends.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "engine/image/image_io.h"
#include "engine/scene/scene.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

using test::expectOneLine;
using test::Outcome;
using test::runProgram;

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

class Asked : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        folder_ = new test::TempFolder;
        const auto executor = makeTbbExecutor(1);
        test::writePly(folder() / "a.ply", test::bumpySphere(2000, 1));
        test::build({folder() / "a.ply"}, folder() / "a.stipple", *executor);
    }
    static void TearDownTestSuite() { delete folder_; }
    static const test::TempFolder& folder() { return *folder_; }
    static Outcome render(const std::string& options, const std::string& input = "a.stipple") {
        return runProgram(folder(), fmt::format("render {} -o p.png --force --size 64x48 {}", input, options));
    }
    static nlohmann::json jsonOf(const Outcome& r) { return nlohmann::json::parse(r.out, nullptr, false); }
    static std::string path(const std::string& name) { return folder() / name; }

  private:
    inline static test::TempFolder* folder_ = nullptr;
};

TEST_F(Asked, OptionsGivenTwiceOrWithoutAValueAreNamedAsSuch) {
    expectOneLine(render("--eye 0,0,5 --eye 0,0,6"), 2, {"--eye", "is given more than once"});
    expectOneLine(render("--fov 30 --fov 30"), 2, {"--fov", "is given more than once"});
    expectOneLine(render("--ortho= --fov 30"), 2, {"--ortho", "needs a value"});
    expectOneLine(render("--eye="), 2, {"--eye", "needs a value"});
    expectOneLine(render("--eye"), 2, {"--eye", "needs a value"});
    EXPECT_EQ(render("--eye=0,0,5 --target=0,0,0").code, 0);
}

TEST_F(Asked, WhatWouldBeIgnoredIsRefused) {
    expectOneLine(render("--time 3"), 2, {"--time", "needs --wind as well"});
    EXPECT_EQ(render("--time 3 --wind 0.1").code, 0);
    expectOneLine(render("--mode ewa --kernel 2.5"), 2, {"--kernel: '2.5' is neither 2 nor 3"});
    expectOneLine(render("--surfels 300", "a.ply"), 2, {"--surfels with a.ply", "has none"});
    expectOneLine(runProgram(folder(), "build a.ply -o b.stipple --surfels 300"), 2, {"--surfels with a.ply"});
}

TEST_F(Asked, MaterialsOfPointsWhereThereAreNoneAreRefused) {
    ASSERT_EQ(runProgram(folder(), "grow rock -o pebble.glb --triangles 1k").code, 0);
    expectOneLine(runProgram(folder(), "build pebble.glb -o r.stipple --material metal"), 2,
                  {"pebble.glb", "has none"});
    ASSERT_EQ(runProgram(folder(), "build pebble.glb -o pebble.stipple --quiet").code, 0);
    expectOneLine(render("--material metal", "pebble.stipple"), 2, {"pebble.stipple", "has none"});
    EXPECT_EQ(render("--material metal").code, 0);
}

TEST_F(Asked, OldNamesOfOptionsDoWhatTheNewOnesDo) {
    EXPECT_EQ(render("--strand-exact 1").code, 0);
    EXPECT_EQ(render("--strand-radius 0.5", "a.ply").code, render("--curve-radius 0.5", "a.ply").code);
    EXPECT_EQ(runProgram(folder(), "convert a.stipple --strands -o c.glb").err,
              runProgram(folder(), "convert a.stipple --curves -o c.glb").err);
    expectOneLine(render("--strand-radius x", "a.ply"), 2, {"--curve-radius: 'x' is not a number"});
    for (const char* command : {"render", "convert", "build"})
        EXPECT_FALSE(says(runProgram(folder(), std::string(command) + " --help").out, "strand")) << "they are hidden";
}

TEST_F(Asked, RangesOfColoursAreLookedAtBeforeAnythingIsBuilt) {
    for (const char* range : {"10,5", "5,5", "1", "a,b", "0,inf", "nan,1"}) {
        const Outcome r = render(fmt::format("--colour height --colour-range {}", range), "a.ply");
        expectOneLine(r, 2, {"--colour-range", "is not a range"});
    }
    EXPECT_EQ(render("--colour height --colour-range=-1,1").code, 0);
}

TEST_F(Asked, ABudgetBelowTheCoarsestLevelNamesPicturesThatThereAre) {
    const Outcome r = render("--orbit 3 --budget-points 1 --json --quiet");
    EXPECT_EQ(r.code, 6);
    EXPECT_TRUE(says(r.err, "p_000")) << r.err;
    EXPECT_FALSE(says(r.err, "p.png")) << r.err;
    EXPECT_TRUE(says(r.err, "3 of 3 pictures hold")) << r.err;
    const auto j = jsonOf(r);
    EXPECT_EQ(j["complete"], false);
    EXPECT_EQ(j["incomplete_pictures"], 3);
    const Outcome one = render("--budget-points 1 --json --quiet");
    EXPECT_EQ(one.code, 6);
    EXPECT_TRUE(says(one.err, "p.png: the picture is written, but holds only a part")) << one.err;
    EXPECT_EQ(jsonOf(one)["incomplete_pictures"], 1);
}

TEST_F(Asked, AWidthBesideAPathIsRefused) {
    test::spit(path("p.json"), R"({"keys": [{"t": 0, "eye": [0,0,9], "target": [0,0,0], "ortho": 4}]})");
    expectOneLine(render("--camera-path p.json --ortho 2"), 2, {"--ortho", "--camera-path", "together"});
    EXPECT_EQ(render("--camera-path p.json").code, 0);
}

/// `--mode` with as few rays as there can be.
std::string modeFast(const std::string& mode) { return "--mode " + mode + (mode == "reference" ? " --samples 1" : ""); }

TEST_F(Asked, WhatAModeWouldIgnoreIsRefused) {
    for (const char* of : {"pullpush", "points", "splat"}) {
        const std::string mode = fmt::format("--mode {} ", of);
        expectOneLine(render(mode + "--lowpass 1"), 2, {"--lowpass", "mode ewa", of});
        expectOneLine(render(mode + "--kernel 3"), 2, {"--kernel", "mode ewa", of});
        expectOneLine(render(mode + "--normalise pixel"), 2, {"--normalise", "mode ewa", of});
        expectOneLine(render(mode + "--samples 2"), 2, {"--samples", "mode reference", of});
        EXPECT_EQ(render(mode + "--wind 0.1 --error 2").code, 0);
    }
    EXPECT_EQ(render("--mode ewa --lowpass 1 --kernel 3").code, 0);
    // (Any error is met by the full detail.)
    EXPECT_EQ(render("--mode reference --samples 1 --error 2 --no-wait").code, 0);
    for (const char* of : {"--wind 0.1", "--debug level", "--accumulate 2", "--budget-points 10"})
        expectOneLine(render(fmt::format("--mode reference --samples 1 {}", of)), 2, {"reference traces full detail"});
}

TEST_F(Asked, SamplesOfPlyMeshesAreRefusedAndNotForgotten) {
    test::spit(path("m.ply"),
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    expectOneLine(render("--surfels 1000", "m.ply"), 2, {"--surfels", "m.ply", "--only-points"});
    EXPECT_EQ(render("", "m.ply").code, 0);
    expectOneLine(runProgram(folder(), "build m.ply -o m.stipple --surfels 1000"), 2, {"--surfels"});
}

TEST_F(Asked, LensesAndExposuresThatBlurNothingAreRefused) {
    expectOneLine(render("--aperture 0.1"), 2, {"--aperture", "--focus"});
    expectOneLine(render("--focus 3"), 2, {"--focus", "--aperture"});
    for (const char* depth : {"0", "-1", "inf", "nan", "x"})
        expectOneLine(render(fmt::format("--aperture 0.1 --focus={}", depth)), 2, {"--focus"});
    expectOneLine(render("--aperture=-1 --focus 3"), 2, {"--aperture"});
    expectOneLine(render("--aperture 0.1 --focus 3 --accumulate 1"), 2, {"--accumulate 1", "sharp"});
    expectOneLine(render("--aperture 0.1 --focus 3 --ortho 4"), 2, {"--aperture", "orthographic"});
    expectOneLine(render("--shutter 0.1"), 2, {"--shutter", "nothing moves"});
    expectOneLine(render("--mode reference --samples 1 --aperture 0.1 --focus 3"), 2, {"--aperture", "full detail"});
    EXPECT_EQ(render("--shutter 0.5 --orbit 2 --accumulate 2").code, 0);
    const auto bytesOf = [](const std::string& options) {
        const Outcome r = render(options + " --json");
        EXPECT_EQ(r.code, 0) << r.err;
        return std::pair(test::slurp(path("p.png")), jsonOf(r)["counters"]["passes"]);
    };
    const auto plain = bytesOf(""), mean = bytesOf("--accumulate 4");
    EXPECT_TRUE(bytesOf("--aperture 0 --focus 3 --shutter 0") == plain);
    EXPECT_TRUE(bytesOf("--aperture 0 --focus 3 --shutter 0 --accumulate 4") == mean);
    EXPECT_FALSE(mean.first == plain.first);
    EXPECT_EQ(mean.second, plain.second) << "no pass is for it";
    EXPECT_FALSE(bytesOf("--aperture 0.5 --focus 3 --accumulate 4").first == mean.first);
    EXPECT_EQ(jsonOf(render("--aperture 0.5 --focus 3 --json"))["accumulated"], 64);
}

TEST_F(Asked, ADemoMakesItsFolder) {
    const Outcome r = runProgram(folder(), "grow demo -o new/demo --points 5k --leaves 1k");
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_TRUE(std::filesystem::exists(path("new/demo/demo.glb")));
    // With a mirror and glass, through which another picture is seen the other way.
    const std::string file = test::slurp(path("new/demo/demo.glb"));
    EXPECT_TRUE(says(file, "KHR_materials_transmission"));
    EXPECT_TRUE(says(file, "\"mirror\""));
    const auto picture = [&](const std::string& more) {
        const Outcome seen = runProgram(folder(),
                                        "render new/demo/demo.glb -o p.png --force --size 160x90 --error 4 "
                                        "--eye 0,6,40 --target 0,2.5,22 " +
                                            more);
        EXPECT_EQ(seen.code, 0) << seen.err;
        return test::slurp(path("p.png"));
    };
    const std::string object = picture("--refract object");
    EXPECT_TRUE(object == picture("--refract object"));
    EXPECT_FALSE(object == picture("--refract environment"));
}

TEST_F(Asked, AWalkThroughADemoListsWhichEffectsCameAndWent) {
    ASSERT_EQ(runProgram(folder(), "grow demo -o demo --points 5k --leaves 1k").code, 0);
    // From glass and mirrors to the sky, where nothing is, and back.
    test::spit(path("walk.json"), R"({"fps": 1, "keys": [
        {"t": 0, "eye": [0, 4, 40], "target": [0, 2, 24], "up": [0, 1, 0], "fov": 55},
        {"t": 1, "eye": [0, 400, 0], "target": [0, 800, 20], "up": [0, 0, 1], "fov": 50},
        {"t": 2, "eye": [-24, 5, 14], "target": [-40, 4, -10], "up": [0, 1, 0], "fov": 60}]})");
    const std::string walk = "render demo/demo.glb -o w.png --force --size 96x54 --error 4 --camera-path walk.json ";
    const auto changesOf = [&](const std::string& more) {
        const Outcome r = runProgram(folder(), walk + more + " --json");
        EXPECT_EQ(r.code, 0) << r.err;
        return nlohmann::json::parse(r.out, nullptr, false)["effect_changes"];
    };
    const auto linesOf = [](const nlohmann::json& changes, const std::string& effect) {
        std::string all;
        for (const auto& c : changes)
            if (c["effect"] == effect)
                all += fmt::format("{} {}, ", c["picture"].get<int>(), c["change"].get<std::string>());
        return all;
    };
    const nlohmann::json all = changesOf("");
    for (const char* effect : {"shadow", "fog", "occlusion", "light"})
        EXPECT_EQ(linesOf(all, effect), "0 came, 1 went, 2 came, ") << effect;
    EXPECT_EQ(linesOf(all, "refraction"), "0 came, 1 went, ") << "there is no glass between the rows";
    EXPECT_EQ(linesOf(all, "wind"), "") << "the control: nobody asked for it";
    for (const auto& c : all) {
        const std::string by = c["called_for_by"];
        if (c["effect"] == "fog") EXPECT_EQ(by, "the scene file");
        if (c["effect"] == "refraction") EXPECT_EQ(by, "--material, or a material");
        EXPECT_FALSE(by.empty()) << c;
    }
    EXPECT_EQ(linesOf(changesOf("--effects none"), "fog"), "");
    const Outcome told = runProgram(folder(), walk);
    EXPECT_TRUE(says(told.out, "picture 0: fog came (the scene file)")) << told.out;
    EXPECT_TRUE(says(told.out, "picture 1: fog went (the scene file)")) << told.out;
    const Outcome own = runProgram(folder(),
                                   "render demo/demo.glb -o w.png --force --size 48x27 --error 8 "
                                   "--camera-path demo/walk.json --frames 7");
    EXPECT_EQ(own.code, 0) << own.err;
    EXPECT_TRUE(says(own.out, "went")) << own.out;
}

TEST_F(Asked, AViewOfNothingSaysSo) {
    for (const char* mode : {"pullpush", "splat", "reference"}) {
        const std::string of = modeFast(mode), off = of + " --eye 0,0,50 --target 0,0,90";
        const Outcome r = render(off);
        EXPECT_EQ(r.code, 0);
        EXPECT_TRUE(says(r.err, "note: p.png: the view shows nothing of the scene")) << r.err;
        EXPECT_EQ(render(off + " --quiet").err, "");
        EXPECT_EQ(jsonOf(render(off + " --json"))["empty_pictures"], 1);
        const Outcome seen = render(of);
        EXPECT_FALSE(says(seen.err, "nothing")) << seen.err;
    }
    test::spit(path("p.json"), R"({"fps": 1, "keys": [{"t": 0, "eye": [0,0,9], "target": [0,0,0]},
                                                     {"t": 1, "eye": [0,0,9], "target": [0,0,20]}]})");
    const Outcome r = render("--camera-path p.json --frames 2");
    EXPECT_TRUE(says(r.err, "p.png: 1 of 2 views show nothing")) << r.err;
}

TEST_F(Asked, TracedPicturesAreReportedLikeOthers) {
    const auto j = jsonOf(render("--mode reference --samples 2 --orbit 3 --json"));
    EXPECT_EQ(j["schema"], "stipple.render/2");
    EXPECT_EQ(j["mode"], "reference");
    EXPECT_EQ(j["width"], 64);
    EXPECT_EQ(j["height"], 48);
    EXPECT_EQ(j["samples_per_pixel"], 4);
    EXPECT_EQ(j["complete"], true);
    ASSERT_EQ(j["pictures"].size(), 3u);
    double sum = 0, last = 0;
    for (size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(j["pictures"][i]["path"], fmt::format("p_{:04}.png", i));
        sum += last = j["pictures"][i]["seconds"].get<double>();
    }
    // Each says its own time, not the time since the first began.
    EXPECT_NEAR(sum, j["seconds"].get<double>(), 1e-6);
    EXPECT_LT(last, 0.9 * j["seconds"].get<double>());
}

TEST_F(Asked, WhatIsLeftToChanceIsSaidOfTheStoreOnceAndOfPicturesBesideTheirError) {
    const auto note = [](const Outcome& r) { return says(r.err, "thin curves are pruned"); };
    ASSERT_EQ(runProgram(folder(), "grow tree -o tree.glb --leaves 20k").code, 0);
    const Outcome built = runProgram(folder(), "build tree.glb -o tree.stipple");
    EXPECT_TRUE(note(built)) << built.err;
    EXPECT_TRUE(says(runProgram(folder(), "build tree.glb -o t2.stipple --json").out, "pruned"));
    for (const char* mode : {"pullpush", "reference", "pullpush"})
        EXPECT_FALSE(note(render(modeFast(mode), "tree.glb"))) << mode;
    EXPECT_TRUE(says(render("", "tree.glb").out, "stochastic:")) << "beside the error";
}

TEST_F(Asked, TheMemoryThatASceneIsToldToAskForSuffices) {
    ASSERT_EQ(runProgram(folder(), "grow rock -o rock.glb --triangles 30k").code, 0);
    ASSERT_EQ(runProgram(folder(), "grow building -o house.gltf --triangles 3k").code, 0);
    for (const char* scene : {"rock.glb", "house.gltf"}) {
        const Outcome refused = runProgram(folder(), fmt::format("build {} -o m.stipple --force --memory 1M", scene));
        EXPECT_EQ(refused.code, 6) << refused.err;
        const std::string words = "give --memory ";
        const size_t at = refused.err.find(words);
        ASSERT_NE(at, std::string::npos) << refused.err;
        const std::string size =
            refused.err.substr(at + words.size(), refused.err.find('M', at + words.size()) + 1 - at - words.size());
        const Outcome built =
            runProgram(folder(), fmt::format("build {} -o m.stipple --force --memory {}", scene, size));
        EXPECT_EQ(built.code, 0) << scene << " " << size << " " << built.err;
    }
}

/// A square of points with an attribute.
void writeWithQuality(const std::string& path, float quality) {
    std::string file =
        "ply\nformat binary_little_endian 1.0\nelement vertex 400\nproperty float x\nproperty float y\n"
        "property float z\nproperty float quality\nend_header\n";
    for (int i = 0; i < 400; ++i)
        for (const float value : {float(i % 20), float(i / 20), 0.0f, quality}) {
            file.resize(file.size() + 4);
            std::memcpy(file.data() + file.size() - 4, &value, 4);
        }
    test::spit(path, file);
}

TEST_F(Asked, LegendsHaveNoScaleWhereThereIsNoRange) {
    // Saturated colours in the legend's column, left of what is drawn.
    const auto colours = [&](float quality) {
        writeWithQuality(path("q.ply"), quality);
        const Outcome r = runProgram(folder(),
                                     "render q.ply -o q.png --force --size 900x300 --colour quality --legend --quiet "
                                     "--eye 10,10,400 --target 10,10,0 --shade unlit");
        EXPECT_EQ(r.code, 0) << r.err;
        const auto image = image::readImage(path("q.png"));
        std::set<uint32_t> seen;
        size_t bright = 0;
        for (uint32_t y = 0; image && y < image->height; ++y)
            for (uint32_t x = 0; x < 200; ++x) {
                const uint32_t c = image->rgba[size_t{y} * image->width + x];
                const auto [low, high] = std::minmax({c & 255u, c >> 8 & 255u, c >> 16 & 255u});
                if (high - low > 50) seen.insert(c);
                bright += low > 200;
            }
        EXPECT_GT(bright, 20u) << "its words";
        return seen.size();
    };
    EXPECT_EQ(colours(7), 1u);
    EXPECT_EQ(colours(std::numeric_limits<float>::quiet_NaN()), 0u);
}

TEST_F(Asked, OrthographicCamerasOfScenesBeginAtTheirNearPlane) {
    const auto shownWith = [&](double near, double far) {
        scene::Scene s;
        scene::SceneCamera camera;
        camera.isOrthographic = true;
        camera.width = camera.height = 3;
        camera.nearPlane = near;
        camera.farPlane = far;
        s.cameras.push_back(camera);
        scene::Node store, eye;
        store.store = "a.stipple";
        eye.camera = 0;
        eye.local[3] = {0, 0, 10, 1};
        s.nodes = {store, eye};
        EXPECT_TRUE(scene::writeGltf(s, path("s.gltf")));
        return render("--scene-camera 1 --alpha --colour plain", "s.gltf");
    };
    const auto covered = [&] {
        const auto image = image::readImage(path("p.png"));
        size_t count = 0;
        for (const uint32_t c : image->rgba) count += c >> 24 != 0;
        return count;
    };
    EXPECT_EQ(shownWith(0.1, 100).code, 0);
    const size_t whole = covered();
    EXPECT_GT(whole, 500u);
    shownWith(10.9, 100);  // of the ball of radius 1 around the origin a cap behind the middle is left
    EXPECT_LT(covered(), whole / 2);
    EXPECT_FALSE(says(shownWith(0.1, 100).err, "far plane"));
    EXPECT_TRUE(says(shownWith(0.1, 10).err, "beyond its far plane (10 units away) is drawn all the same"));
}

TEST_F(Asked, DiscsLargerThanTexelsAreSeenInNarrowParallelViews) {
    // Far larger than their spacing, so that they are not drawn exactly where texels hold them.
    std::vector<test::TestPoint> points;
    Rng rng(1);
    for (int i = 0; i < 20'000; ++i)
        points.push_back({{rng.uniform(-100, 100), rng.uniform(-100, 100), 0}, {0, 0, 1}, 0x4080c0, 10});
    test::writePly(path("dense.ply"), points, true, true);
    ASSERT_EQ(runProgram(folder(), "build dense.ply -o dense.stipple --force --quiet").code, 0);
    for (const char* device : {"cpu", "reference"})
        for (const char* width : {"1", "0.01", "0.001", "0.0001"}) {
            ASSERT_EQ(runProgram(folder(), fmt::format("render dense.stipple -o p.png --force --size 24x24 --alpha "
                                                       "--quiet --ortho {} --device {}",
                                                       width, device))
                          .code,
                      0);
            const auto image = image::readImage(path("p.png"));
            ASSERT_TRUE(image);
            for (const uint32_t c : image->rgba) ASSERT_EQ(c >> 24, 255u) << width << " " << device;
        }
}

}  // namespace
}  // namespace stipple
