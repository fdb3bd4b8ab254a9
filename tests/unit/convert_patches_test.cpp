// `stipple convert --patches` as a person runs it: closed models stay closed, the report is true, nothing odd is taken.
#include <gtest/gtest.h>

#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/image/image_io.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::runProgram;
using test::TempFolder;

/// Pixels that are covered.
std::vector<bool> covered(const TempFolder& folder, const std::string& file, const std::string& view) {
    const Outcome r =
        runProgram(folder, "render " + file + " -o p.png --force --quiet --alpha --error 0.1 --device cpu " +
                               "--size 320x240 " + view);
    EXPECT_EQ(r.code, 0) << r.err;
    const auto image = image::readImage(folder / "p.png");
    std::vector<bool> out;
    if (image)
        for (const uint32_t p : image->rgba) out.push_back(p >> 24 > 0);
    out.resize(320 * 240);
    return out;
}

struct Difference {
    size_t inside = 0, holes = 0, beyond = 0;
};
/// Of what lies a pixel inside the source's outline, how much is open; what lies a pixel outside, and is drawn.
Difference compare(const std::vector<bool>& source, const std::vector<bool>& patches) {
    Difference d;
    for (size_t y = 1; y < 239; ++y)
        for (size_t x = 1; x < 319; ++x) {
            size_t around = 0;
            for (size_t j = y - 1; j <= y + 1; ++j)
                for (size_t i = x - 1; i <= x + 1; ++i) around += source[j * 320 + i] ? 1 : 0;
            d.inside += around == 9 ? 1 : 0;
            d.holes += around == 9 && !patches[y * 320 + x] ? 1 : 0;
            d.beyond += around == 0 && patches[y * 320 + x] ? 1 : 0;
        }
    return d;
}

TEST(ConvertPatches, ClosedModelsStayClosed) {
    const TempFolder folder;
    test::writeObj(folder / "torus.obj", test::torusMesh(120, 50));
    test::writeObj(folder / "box.obj", test::boxMesh(9));
    ASSERT_EQ(runProgram(folder, "grow rock -o rock.glb --triangles 20k").code, 0);
    for (const std::string name : {"torus.obj", "box.obj", "rock.glb"}) {
        SCOPED_TRACE(name);
        const std::string base = "convert " + name + " --patches -o ";
        ASSERT_EQ(runProgram(folder, base + "overlap.glb --force").code, 0);
        ASSERT_EQ(runProgram(folder, base + "open.glb --leave-gaps --force").code, 0);
        size_t open = 0;
        const std::vector<std::string> views =
            name == "torus.obj"
                ? std::vector<std::string>{"--eye 2,2,2 --target 0,0,0", "--eye 0,-3,0.6 --target 0,0,0",
                                           "--eye 0.5,-1.2,1.8 --target 0,0.3,0"}
                : std::vector<std::string>{"--eye 2.5,2.4,2.6 --target 0.5,0.5,0.5", "--eye -2,1.4,0.6 --target 0,0,0"};
        for (const std::string& view : views) {
            const std::vector<bool> source = covered(folder, name, view);
            const Difference d = compare(source, covered(folder, "overlap.glb", view));
            EXPECT_GT(d.inside, 2000u);
            EXPECT_EQ(d.holes, 0u);
            EXPECT_LE(d.beyond, d.inside / 100) << "edges stand out by less than a step";
            open += compare(source, covered(folder, "open.glb", view)).holes;
        }
        EXPECT_GT(open, 100u) << "the control: without overlap there are gaps";
    }
}

TEST(ConvertPatches, ReportsWhatIsThere) {
    const TempFolder folder;
    test::writePly(folder / "ball.ply", test::bumpySphere(9000, 1), false);
    const Outcome r = runProgram(folder, "convert ball.ply --patches -o ball.glb --json --threads 1");
    ASSERT_EQ(r.code, 0) << r.err;
    const auto j = nlohmann::json::parse(r.out);
    EXPECT_EQ(j["schema"], "stipple.convert/2");
    EXPECT_EQ(j["points"], 9000);
    EXPECT_LT(j["points_left"].get<int>(), 200);
    EXPECT_GT(j["patches"].get<int>(), 3);
    EXPECT_NEAR(j["samples"].get<double>(), 9000, 4500);
    EXPECT_LT(j["bytes_a_sample"]["geometry"].get<double>(), 2.0);
    EXPECT_LT(j["bytes_a_sample"]["all"].get<double>(), 5.0);
    EXPECT_LE(j["from_source"]["rms"].get<double>(), j["from_source"]["bound"].get<double>());
    EXPECT_LT(j["from_source"]["bound"].get<double>(), 0.05);
    EXPECT_GT(j["peak_rss_bytes"].get<uint64_t>(), 0u);
    // The same file for any number of threads.
    ASSERT_EQ(runProgram(folder, "convert ball.ply --patches -o again.glb --threads 3").code, 0);
    EXPECT_EQ(test::slurp(folder / "ball.glb"), test::slurp(folder / "again.glb"));
    const Outcome info = runProgram(folder, "info ball.glb --json");
    EXPECT_EQ(info.code, 0) << info.err;
    // More samples are more triangles, nearer to the source.
    const auto more = nlohmann::json::parse(
        runProgram(folder, "convert ball.ply --patches --patch-samples 40k -o more.glb --json").out);
    EXPECT_GT(more["samples"].get<double>(), 2.5 * j["samples"].get<double>());
    const auto gaps =
        nlohmann::json::parse(runProgram(folder, "convert ball.ply --patches --fill-gaps -o gaps.glb --json").out);
    EXPECT_GT(gaps["gap_triangles"].get<int>(), 100);
    EXPECT_LT(gaps["samples"].get<double>(), j["samples"].get<double>());
    const std::string text = runProgram(folder, "convert ball.ply --patches -o text.glb").out;
    EXPECT_NE(text.find("bytes a sample"), std::string::npos) << text;
    EXPECT_NE(text.find("9000 points became"), std::string::npos) << text;
}

TEST(ConvertPatches, KeepsColours) {
    // A red ball: bytes of a PLY, and what a .las has of it (16 bits that hold 8).
    const TempFolder folder;
    std::vector<test::TestPoint> points = test::bumpySphere(4000, 1);
    for (test::TestPoint& p : points) p.colour = 0x0000c0;
    test::writePly(folder / "red.ply", points, false);
    ASSERT_EQ(runProgram(folder, "grow scan -o grove.las --points 30k").code, 0);
    for (const std::string name : {"red.ply", "grove.las"}) {
        SCOPED_TRACE(name);
        ASSERT_EQ(runProgram(folder, "convert " + name + " --patches -o c.glb --force").code, 0);
        ASSERT_EQ(runProgram(folder, "render c.glb -o c.png --force --quiet --size 160x120").code, 0);
        const auto image = image::readImage(folder / "c.png");
        ASSERT_TRUE(image);
        size_t coloured = 0;
        for (const uint32_t p : image->rgba) {
            const int r = int(p & 255u), g = int(p >> 8 & 255u), b = int(p >> 16 & 255u);
            coloured +=
                name == "red.ply" ? (r > 150 && g < 30 && b < 30) : std::max({r, g, b}) - std::min({r, g, b}) > 40;
        }
        EXPECT_GT(coloured, 1000u);
    }
}

TEST(ConvertPatches, TakesNothingOdd) {
    const TempFolder folder;
    test::writePly(folder / "a.ply", test::bumpySphere(300, 1));
    const auto expectLine = [&](const std::string& arguments, int code, const std::vector<std::string>& texts) {
        SCOPED_TRACE(arguments);
        test::expectOneLine(runProgram(folder, "convert " + arguments), code, texts);
    };
    expectLine("a.ply -o a.glb", 2, {"--curves", "--patches"});
    expectLine("a.ply --curves --patches -o a.glb", 2, {"--curves and --patches"});
    expectLine("a.ply --patches --joints 3 -o a.glb", 2, {"--joints", "--curves"});
    expectLine("a.ply --curves --cone 3 -o a.glb", 2, {"--cone"});
    expectLine("a.ply --curves --cone 30 -o a.glb", 2, {"--cone", "--patches"});
    expectLine("a.ply --patches --fill-gaps --overlap -o a.glb", 2, {"--fill-gaps and --overlap"});
    expectLine("a.ply --patches -o a.stipple", 2, {"a.stipple", ".glb"});
    expectLine("b.ply --patches -o a.glb", 3, {"b.ply"});
    expectLine("a.ply --patches --cone 90 -o a.glb", 2, {"--cone"});
    EXPECT_FALSE(fs::exists(folder / "a.glb"));
    test::spit(folder / "empty.ply",
               "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
               "end_header\n");
    expectLine("empty.ply --patches -o a.glb", 3, {"empty.ply"});
    EXPECT_EQ(runProgram(folder, "convert a.ply --patches -o a.glb").code, 0);
}

TEST(ConvertPatches, StopsWhereItIsAskedTo) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o s.las --points 400k").code, 0);
    test::RunningProgram convert(folder, {"convert", "s.las", "--patches", "-o", "s.glb"});
    ASSERT_TRUE(convert.await([&] { return convert.catches(SIGTERM) && convert.processorSeconds() > 0.5; }));
    convert.signal(SIGINT);
    const Outcome r = convert.end();
    EXPECT_EQ(r.code, 7) << r.err;
    EXPECT_NE(r.err.find("nothing is written"), std::string::npos) << r.err;
    EXPECT_FALSE(fs::exists(folder / "s.glb"));
}

}  // namespace
}  // namespace stipple
