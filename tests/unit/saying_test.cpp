// What the program says of files and pictures is so, and what it leaves out it says.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "engine/image/image_io.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

using test::expectOneLine;
using test::Outcome;
using test::runProgram;
using test::TempFolder;

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }
size_t timesSaid(const std::string& text, const std::string& part) {
    size_t count = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
    return count;
}

/// Three points in (500, 0, 0) .. (520.10, 10.29, 1.07), and a header that says where they are.
void writeBoxed(const std::string& path, double greatestX, double leastY) {
    test::writeLas(path, {{0, 0, 0}, {1000, 1029, 107}, {2010, 3, 50}}, 0.01, glm::dvec3(500, 0, 0));
    std::string bytes = test::slurp(path);
    constexpr size_t kBox = 179;  // greatest and least x, then y, then z
    const std::array<double, 6> box{greatestX, 500, 10.29, leastY, 1.07, 0};
    std::memcpy(bytes.data() + kBox, box.data(), sizeof(box));
    test::spit(path, bytes);
}

TEST(HeaderBox, ThatIsTooLargeIsSaidAndAllowed) {
    const TempFolder folder;
    writeBoxed(folder / "a.las", 520.1, 0);
    EXPECT_TRUE(says(runProgram(folder, "info a.las").out, "counts and box agree with the header"));
    writeBoxed(folder / "a.las", 532.6, -3);
    for (const char* options : {"", " --verify"}) {
        const Outcome r = runProgram(folder, std::string("info a.las") + options);
        EXPECT_EQ(r.code, 0) << r.err;
        EXPECT_TRUE(says(r.out, "greatest x is 532.6, that of the points 520.10 (12.5 farther out)")) << r.out;
        EXPECT_TRUE(says(r.out, "least y is -3, that of the points 0.00 (3 farther out)")) << r.out;
        EXPECT_FALSE(says(r.out, "box agree")) << r.out;
        EXPECT_FALSE(says(r.out, "problem")) << r.out;
    }
    const auto j = nlohmann::json::parse(runProgram(folder, "info a.las --json").out);
    EXPECT_EQ(j["header_box"], "larger");
}

TEST(HeaderBox, ThatIsTooSmallIsAFaultOfTheFile) {
    const TempFolder folder;
    writeBoxed(folder / "a.las", 515.1, -3);  // and too large elsewhere
    for (const char* options : {"", " --verify", " --json"}) {
        SCOPED_TRACE(options);
        const Outcome r = runProgram(folder, std::string("info a.las") + options);
        EXPECT_EQ(r.code, 3);
        EXPECT_TRUE(says(r.out,
                         "points lie outside of the header's box: its greatest x is 515.1, that of the points "
                         "520.10 (5 beyond)"))
            << r.out;
        EXPECT_TRUE(says(r.out, "3 farther out")) << r.out;
        EXPECT_TRUE(says(r.err, "a.las: is not what it says: 1 problem")) << r.err;
    }
    EXPECT_EQ(nlohmann::json::parse(runProgram(folder, "info a.las --json").out)["header_box"], "too small");
    test::writeLas(folder / "none.las", {{0, 0, 0}, {1000, 1029, 107}}, 0.01, glm::dvec3(500, 0, 0));
    EXPECT_EQ(runProgram(folder, "info none.las --verify").code, 0) << "some writers leave it empty";
    EXPECT_EQ(runProgram(folder, "info a.las --skip-bad").code, 0) << "it permits that";
    EXPECT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0) << "it can be drawn all the same";
}

TEST(HeaderBox, ThatIsNoneIsOneLineWhateverIsWrongWithIt) {
    const TempFolder folder;
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    for (const auto& [greatestX, leastY] : {std::pair{std::nan(""), 0.0},
                                            {kInfinite, 0.0},
                                            {400.0, 0.0},
                                            {520.1, -kInfinite},
                                            {std::nan(""), std::nan("")},
                                            {-kInfinite, 1e300}}) {
        writeBoxed(folder / "a.las", greatestX, leastY);
        const Outcome r = runProgram(folder, "info a.las");
        EXPECT_EQ(r.code, 3) << greatestX << " " << leastY;
        EXPECT_EQ(timesSaid(r.out, "problem"), 1u) << r.out;
        EXPECT_EQ(timesSaid(r.out, "the header's box is none: "), 1u) << r.out;
        EXPECT_FALSE(says(r.out, "farther out")) << r.out;
        EXPECT_EQ(nlohmann::json::parse(runProgram(folder, "info a.las --json").out)["header_box"], "none");
        EXPECT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet --force").code, 0) << "it can be drawn";
    }
}

TEST(Transparency, ThatIsNotDrawnIsSaidOnceAFile) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow rock -o r.gltf --triangles 500").code, 0);
    auto gltf = nlohmann::json::parse(test::slurp(folder / "r.gltf"));
    for (const char* input : {"info r.gltf", "render r.gltf -o r.png --size 64x48"})
        EXPECT_FALSE(says(runProgram(folder, input).out + runProgram(folder, input).err, "BLEND")) << input;
    for (auto& m : gltf["materials"]) m["alphaMode"] = "BLEND";  // (opaque all over, but that is not seen here)
    test::spit(folder / "r.gltf", gltf.dump());
    for (const char* input : {"info r.gltf", "render r.gltf -o r.png --size 64x48",
                              "render r.gltf -o r.png --size 64x48", "build r.gltf -o r.stipple"}) {
        const Outcome r = runProgram(folder, input);
        EXPECT_EQ(r.code, 0) << r.err;
        EXPECT_EQ(timesSaid(r.out + r.err, "alphaMode BLEND"), 1u) << input << "\n" << r.out << r.err;
    }
    const auto j = nlohmann::json::parse(runProgram(folder, "info r.gltf --json").out);
    ASSERT_EQ(j["notes"].size(), 1u);
}

/// The effect, as the report of a picture has it.
nlohmann::json transparencyOf(const TempFolder& folder, const std::string& options) {
    const auto j = nlohmann::json::parse(
        runProgram(folder, "render c.gltf -o c.png --force --size 64x48 --quiet --json " + options).out);
    for (const auto& effect : j["effects"])
        if (effect["name"] == "transparency") return effect;
    return {};
}

TEST(Transparency, IsDrawnUnlessItIsLeftOut) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow rock -o c.gltf --triangles 500").code, 0);
    auto gltf = nlohmann::json::parse(test::slurp(folder / "c.gltf"));
    const auto drawn = [&](const std::string& options) {
        const auto effect = transparencyOf(folder, options);
        return std::pair(effect.value("active", false), test::slurp(folder / "c.png"));
    };
    const auto opaque = drawn("");
    EXPECT_FALSE(opaque.first);
    for (auto& m : gltf["materials"]) {
        m["alphaMode"] = "BLEND";
        m["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0.6};
    }
    test::spit(folder / "c.gltf", gltf.dump());
    const auto clear = drawn(""), none = drawn("--effects none"), without = drawn("--effects=-transparency");
    EXPECT_TRUE(clear.first);
    EXPECT_NE(clear.second, opaque.second);
    EXPECT_FALSE(none.first || without.first);
    EXPECT_EQ(none.second, without.second);
    EXPECT_NE(none.second, clear.second);
}

TEST(Paths, StateTheErrorOfTheirWorstPicture) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 50k").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    // The second picture is from much nearer: with so few records its error is the largest.
    test::spit(folder / "p.json",
               R"({"fps": 1, "keys": [{"t": 0, "eye": [0, -300, 200], "target": [0, 0, 0], "up": [0, 0, 1]},
                   {"t": 1, "eye": [0, -60, 40], "target": [0, 0, 0], "up": [0, 0, 1]},
                   {"t": 2, "eye": [0, -300, 200], "target": [0, 0, 0], "up": [0, 0, 1]}]})");
    const std::string few = " --size 320x200 --budget-points 6k";
    double worst = 0;
    int which = -1;
    for (int i = 0; i < 3; ++i) {
        const std::string eye = i == 1 ? "0,-60,40" : "0,-300,200";
        const Outcome one = runProgram(
            folder, "render a.stipple -o one.png --json --target 0,0,0 --camera-up 0,0,1 --eye " + eye + few);
        const double error = nlohmann::json::parse(one.out)["tau_eff_px"].get<double>();
        if (error > worst) which = i;
        worst = std::max(worst, error);
    }
    ASSERT_EQ(which, 1);
    const std::string path = "render a.stipple -o o.png --frames 3 --camera-path p.json" + few;
    const Outcome text = runProgram(folder, path);
    ASSERT_EQ(text.code, 0) << text.err;
    EXPECT_TRUE(says(text.out, fmt::format("3 pictures; the worst is o_0001.png: {:.2f} px error", worst))) << text.out;
    const auto j = nlohmann::json::parse(runProgram(folder, path + " --json").out);
    EXPECT_EQ(j["worst_picture_path"], "o_0001.png");
    EXPECT_NEAR(j["tau_eff_px"].get<double>(), worst, 1e-9);
    EXPECT_TRUE(says(runProgram(folder, "render a.stipple -o b.png --size 64x48 --orbit 4").out, "px error"));
}

TEST(Budgets, SoSmallThatTheErrorSaysNothingAreExplained) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 50k").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    const std::string render = "render a.stipple -o a.png --size 320x200 --eye 0,-6,4 --target 0,0,0 --camera-up 0,0,1";
    const auto enough = nlohmann::json::parse(runProgram(folder, render + " --json").out);
    const std::string much = fmt::format("{} records would bring it to", enough["records_drawn"].get<uint64_t>());
    const Outcome r = runProgram(folder, render + " --budget-points 700");
    expectOneLine(r, 6, {"--budget-points", "give more: " + much});
    // From farther away the coarsest level fits, with an error that says little.
    const std::string far =
        "render a.stipple -o b.png --size 320x200 --fov 12 --eye 0,-60,40 --target 0,0,0 --camera-up 0,0,1";
    const auto all = nlohmann::json::parse(runProgram(folder, far + " --json").out);
    const Outcome few = runProgram(folder, far + " --budget-points 5600");
    EXPECT_EQ(few.code, 0) << few.err;
    EXPECT_TRUE(says(few.err, "note: --budget-points 5600 leaves an error of")) << few.err;
    EXPECT_TRUE(says(few.err, fmt::format("; {} records would bring", all["records_drawn"].get<uint64_t>())))
        << few.err;
    EXPECT_EQ(runProgram(folder, far + " --budget-points 5600 --quiet").err, "");
    EXPECT_FALSE(says(runProgram(folder, render).err, "budget-points"));
}

TEST(MemoryHint, OfPlyMeshesSuffices) {
    const TempFolder folder;
    constexpr int kSide = 250;
    std::string ply = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        kSide * kSide, 2 * (kSide - 1) * (kSide - 1));
    for (int i = 0; i < kSide * kSide; ++i) ply += fmt::format("{} {} {}\n", i % kSide, i / kSide, i * 7 % 5);
    for (int y = 0; y + 1 < kSide; ++y)
        for (int x = 0; x + 1 < kSide; ++x) {
            const int a = y * kSide + x;
            ply += fmt::format("3 {} {} {}\n3 {} {} {}\n", a, a + 1, a + kSide, a + 1, a + kSide + 1, a + kSide);
        }
    test::spit(folder / "a.ply", ply);
    const Outcome refused = runProgram(folder, "build a.ply -o a.stipple --quiet --memory 90M");
    ASSERT_EQ(refused.code, 6) << refused.err;
    EXPECT_TRUE(says(refused.err, "--memory allows 90 MiB")) << refused.err;
    const size_t at = refused.err.find("give --memory ");
    ASSERT_NE(at, std::string::npos) << refused.err;
    const std::string hint = refused.err.substr(at + 5, refused.err.find(')', at) - at - 5);
    const Outcome built = runProgram(folder, "build a.ply -o a.stipple --quiet " + hint);
    EXPECT_EQ(built.code, 0) << hint << ": " << built.err;
}

TEST(Plain, OneIsNoPlural) {
    const TempFolder folder;
    test::spit(folder / "a.swc", "1 2 0 0 0 0.1 -1\n2 2 1 0 0 0.1 1\n");
    EXPECT_TRUE(says(runProgram(folder, "info a.swc").out, "1 curve of 2 vertices"))
        << runProgram(folder, "info a.swc").out;
    EXPECT_TRUE(says(runProgram(folder, "build a.swc -o a.stipple").out, "2 segments in 1 node, "));
    test::writeLas(folder / "a.las", {{0, 0, 0}}, 0.01, glm::dvec3(0));
    EXPECT_TRUE(says(runProgram(folder, "build a.las -o b.stipple").out, "1 point in 1 node, "));
    EXPECT_TRUE(says(runProgram(folder, "info a.las").out, "LAS 1.2, point format 2, 1 point\n"))
        << runProgram(folder, "info a.las").out;
    std::string quad;  // in eight by eight cells
    for (int k = 0; k < 81; ++k) quad += fmt::format("v {} {} 0\n", k % 9, k / 9);
    for (int k = 1; k < 72; ++k)
        if (k % 9 != 0) quad += fmt::format("f {} {} {} {}\n", k, k + 1, k + 10, k + 9);
    test::spit(folder / "quad.obj", quad);
    const Outcome patch = runProgram(folder, "build quad.obj --patches -o c.stipple");
    EXPECT_TRUE(says(patch.out, "in 1 node, ")) << patch.out;
    EXPECT_TRUE(says(patch.err, " samples in 1 patch, ")) << patch.err;
    const std::string info = runProgram(folder, "info c.stipple").out;
    EXPECT_TRUE(says(info, " samples in 1 patch, from quad.obj, in 1 node, ")) << info;
}

TEST(Plain, OtherKindsOfFileAreNamedByConvert) {
    const TempFolder folder;
    test::spit(folder / "a.ply",
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
               "float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
               "1 0 0\n0 1 0\n3 0 1 2\n");
    const Outcome r = runProgram(folder, "convert a.ply --curves -o a.stipple");
    expectOneLine(r, 2, {"a.ply", "convert", ".glb or .obj"});
    EXPECT_FALSE(says(r.err, "is not a mesh")) << "it is one";
}

TEST(Plain, PicturesThatAreNoneAreOneLineWithoutLibraries) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 500").code, 0);
    ASSERT_EQ(runProgram(folder, "render a.las -o a.png --size 320x200 --quiet").code, 0);
    const std::string whole = test::slurp(folder / "a.png");
    std::string flipped = whole;
    flipped[whole.size() / 2] = static_cast<char>(flipped[whole.size() / 2] ^ 0x55);
    for (const auto& [name, bytes] :
         {std::pair<std::string, std::string>{"half.png", whole.substr(0, whole.size() / 2)},
          {"head.png", whole.substr(0, 20)},
          {"flipped.png", flipped},
          {"text.png", "hello"},
          {"text.hdr", "hello"},
          {"text.exr", "hello"},
          {"text.abc", "hello"}}) {
        SCOPED_TRACE(name);
        test::spit(folder / name, bytes);
        for (const std::string& arguments :
             {"compare " + name + " a.png", "render a.las -o b.png --size 64x48 --quiet --environment " + name}) {
            const Outcome r = runProgram(folder, arguments);
            expectOneLine(r, 3, {name});
            for (const char* library : {"libpng", "OpenImageIO", "OIIO"}) EXPECT_FALSE(says(r.err, library)) << r.err;
        }
    }
    test::spit(folder / "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n");
    expectOneLine(runProgram(folder, "info bad.obj"), 3, {"bad.obj", "line 4"});
}

TEST(Strays, OfCurvesAreSaidLoudly) {
    const TempFolder folder;
    std::string swc;
    auto neurite = [&, next = 1](double x) mutable {
        for (int i = 0; i < 10; ++i, ++next)
            swc += fmt::format("{} 3 {} {} 0 0.1 {}\n", next, x, i, i == 0 ? -1 : next - 1);
    };
    for (int k = 0; k < 400; ++k) neurite(k % 20 + 0.001 * k);
    test::spit(folder / "near.swc", swc);
    EXPECT_FALSE(says(runProgram(folder, "build near.swc -o near.stipple").err, "OUTLIERS"));
    neurite(3e7);
    test::spit(folder / "far.swc", swc);
    const Outcome r = runProgram(folder, "build far.swc -o far.stipple");
    EXPECT_EQ(r.code, 0);
    EXPECT_TRUE(says(r.err, "OUTLIERS: 10 of 4010 vertices lie far outside")) << r.err;
}

double meanOf(const render::Image& image, uint32_t shift) {
    double sum = 0;
    for (const uint32_t c : image.rgba) sum += c >> shift & 255u;
    return sum / static_cast<double>(image.rgba.size());
}

TEST(ReferenceMode, LooksLikeTheOthersAndSaysWhatItDid) {
    const TempFolder folder;
    // A ramp without colours, dense but for some stray points above it.
    std::string points;
    int count = 0;
    Rng rng(3);
    for (int i = 0; i < 20000; ++i, ++count) {
        const double x = rng.uniform(0, 10), y = rng.uniform(0, 10);
        points += fmt::format("{} {} {}\n", x, y, 0.4 * x);
    }
    for (int i = 0; i < 300; ++i, ++count)
        points += fmt::format("{} {} {}\n", rng.uniform(0, 10), rng.uniform(0, 10), rng.uniform(6, 12));
    test::spit(folder / "a.ply",
               fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float "
                           "y\nproperty float z\nend_header\n{}",
                           count, points));
    const std::string render = "render a.ply --up z --size 400x300 --error 0.3 --alpha ";
    ASSERT_EQ(runProgram(folder, render + "-o a.png").code, 0);
    const Outcome traced = runProgram(folder, render + "-o b.png --mode reference --samples 2");
    ASSERT_EQ(traced.code, 0) << traced.err;
    EXPECT_TRUE(says(traced.out, "b.png: full detail, traced with 4 rays a pixel")) << traced.out;
    const auto a = image::readImage(folder / "a.png"), b = image::readImage(folder / "b.png");
    ASSERT_TRUE(a && b);
    for (const uint32_t shift : {0u, 8u, 16u}) EXPECT_NEAR(meanOf(*b, shift), meanOf(*a, shift), 5) << shift;
    EXPECT_GT(std::abs(meanOf(*a, 0) - meanOf(*a, 16)), 2) << "heights have colours";
    // Coverage above the ramp: what the strays hide.
    const auto strays = [](const render::Image& image) {
        double covered = 0;
        for (uint32_t y = 0; y < image.height / 3; ++y)
            for (uint32_t x = 0; x < image.width; ++x) covered += (image.rgba[y * image.width + x] >> 24) / 255.0;
        return covered;
    };
    EXPECT_GT(strays(*a), 200);
    EXPECT_NEAR(strays(*b), strays(*a), 0.4 * strays(*a));
    EXPECT_EQ(runProgram(folder, render + "-o c.png --mode reference --samples 1 --colour height --legend").code, 0);
}

}  // namespace
}  // namespace stipple
