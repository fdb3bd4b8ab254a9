// `stipple convert --patches` as a person runs it: closed models stay closed, the report is true, nothing odd is taken.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <signal.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/image/image_io.h"
#include "engine/scene/scene.h"
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

/// Places of a file's triangles, as they are drawn.
std::vector<test::Triangle> readBack(const std::string& path) {
    std::vector<test::Triangle> out;
    const auto scene = scene::readScene(path);
    if (!scene) return out;
    for (const scene::Node& node : scene->nodes)
        for (const scene::Primitive& p : scene->meshes.at(static_cast<size_t>(node.mesh)).primitives)
            for (size_t k = 0; p.kind == scene::PrimitiveKind::triangles && k + 2 < p.indices.size(); k += 3) {
                test::Triangle t;
                for (size_t c = 0; c < 3; ++c)
                    t.at(c) = glm::dvec3(node.local * glm::dvec4(glm::dvec3(p.position[p.indices[k + c]]), 1));
                out.push_back(t);
            }
    return out;
}

TEST(ConvertPatches, BoundsAreThoseOfTheFile) {
    // Two sheets ten million apart: fp32 about their middle has steps of a half.
    const TempFolder folder;
    lod::TriangleMesh mesh;
    for (const double x : {-1e7, 1e7}) {
        const lod::TriangleMesh sheet = test::sheet(
            30, 30, [&](double u, double v) { return glm::dvec3(x + 2 * u, 2 * v, 0.1 * std::sin(6 * u)); });
        for (const uint32_t i : sheet.indices) mesh.indices.push_back(i + static_cast<uint32_t>(mesh.position.size()));
        mesh.position.insert(mesh.position.end(), sheet.position.begin(), sheet.position.end());
    }
    test::writeObj(folder / "far.obj", mesh);
    const Outcome r = runProgram(folder, "convert far.obj --patches -o far.glb --json");
    ASSERT_EQ(r.code, 0) << r.err;
    const auto j = nlohmann::json::parse(r.out);
    const double to = j["to_source"]["bound"], from = j["from_source"]["bound"];
    const std::vector<test::Triangle> source = test::trianglesOf(mesh), patches = readBack(folder / "far.glb");
    ASSERT_GT(patches.size(), 1000u);
    const auto farthest = [](const std::vector<test::Triangle>& of, const std::vector<test::Triangle>& all) {
        double most = 0;
        for (size_t k = 0; k < of.size(); k += of.size() / 300 + 1)
            for (const glm::dvec3& at : {of[k][0], (of[k][0] + of[k][1] + of[k][2]) / 3.0}) {
                double least = 1e300;
                for (const test::Triangle& t : all)
                    least = std::min(least, glm::distance(at, test::closestPlace(t, at)));
                most = std::max(most, least);
            }
        return most;
    };
    EXPECT_LE(farthest(patches, source), to);
    EXPECT_LE(farthest(source, patches), from);
    EXPECT_LT(to, 2);
}

TEST(ConvertPatches, WhatSinglesDoNotHoldIsRefused) {
    const TempFolder folder;
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 100\nproperty double x\nproperty double y\nproperty double z\n"
        "end_header\n";
    for (int k = 0; k < 100; ++k) text += fmt::format("{}e299 {}e299 0\n", k % 10, k / 10);
    test::spit(folder / "huge.ply", text);
    test::expectOneLine(runProgram(folder, "convert huge.ply --patches -o huge.glb"), 3, {"huge.ply", "fp32"});
    EXPECT_FALSE(fs::exists(folder / "huge.glb"));
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
