// `stipple build --patches` as a person runs it: closed models stay closed, the store is true, nothing odd is taken.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/image/image_io.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

using test::Outcome;
using test::runProgram;
using test::TempFolder;

constexpr size_t kAcross = 320, kDown = 240;

std::vector<bool> covered(const TempFolder& folder, const std::string& file, const std::string& more) {
    const Outcome r = runProgram(folder, "render " + file + " -o p.png --force --quiet --alpha --device cpu " +
                                             fmt::format("--size {}x{} ", kAcross, kDown) + more);
    EXPECT_EQ(r.code, 0) << r.err;
    const auto image = image::readImage(folder / "p.png");
    std::vector<bool> out;
    if (image)
        for (const uint32_t p : image->rgba) out.push_back(p >> 24 > 0);
    out.resize(kAcross * kDown);
    return out;
}

TEST(BuildPatches, ClosedModelsStayClosed) {
    const TempFolder folder;
    test::writeObj(folder / "torus.obj", test::torusMesh(260, 100));
    const Outcome built = runProgram(folder, "build torus.obj --patches --patch-samples 200k -o t.stipple --json");
    ASSERT_EQ(built.code, 0) << built.err;
    EXPECT_GE(nlohmann::json::parse(built.out)["nodes"].get<uint64_t>(), 9u);
    for (const std::string view : {"--eye 2,2,2 --target 0,0,0", "--eye 0,-3,0.6 --target 0,0,0"}) {
        const std::vector<bool> source = covered(folder, "torus.obj", "--error 0.1 " + view);
        for (const std::string error : {"0.1", "1", "4"}) {
            const std::vector<bool> patches = covered(folder, "t.stipple", "--error " + error + " " + view);
            size_t inside = 0, holes = 0;
            for (size_t y = 8; y < kDown - 8; ++y)
                for (size_t x = 8; x < kAcross - 8; ++x) {
                    bool isInside = true;
                    for (size_t j = y - 8; j <= y + 8; ++j)
                        for (size_t i = x - 8; i <= x + 8; ++i) isInside = isInside && source[j * kAcross + i];
                    inside += isInside ? 1 : 0;
                    holes += isInside && !patches[y * kAcross + x] ? 1 : 0;
                }
            EXPECT_GT(inside, 1000u);
            EXPECT_EQ(holes, 0u) << view << " at " << error << " px";
        }
    }
}

// Also where some discs stand beside the patches: a spike that no patch fits.
TEST(BuildPatches, FillThePictureAsTheirSourceDoes) {
    const TempFolder folder;
    lod::TriangleMesh mesh = test::torusMesh(120, 50);
    const auto first = static_cast<uint32_t>(mesh.position.size());
    for (const glm::dvec3& p : {glm::dvec3(0, 0, 0), {1e-4, 0, 0}, {0, 0, 0.2}}) mesh.position.push_back(p);
    mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 2});
    test::writeObj(folder / "torus.obj", mesh);
    ASSERT_EQ(runProgram(folder, "build torus.obj --patches -o t.stipple --quiet").code, 0);
    const auto width = [](const std::vector<bool>& picture) {
        size_t least = kAcross, greatest = 0;
        for (size_t i = 0; i < picture.size(); ++i)
            if (picture[i]) {
                least = std::min(least, i % kAcross);
                greatest = std::max(greatest, i % kAcross);
            }
        return static_cast<double>(greatest) - static_cast<double>(least);
    };
    const double wanted = width(covered(folder, "torus.obj", ""));
    EXPECT_GT(wanted, 100);
    EXPECT_NEAR(width(covered(folder, "t.stipple", "")), wanted, 0.04 * wanted);
    const Outcome odd = runProgram(folder, "render t.stipple -o odd.png --interpolate direct");
    EXPECT_EQ(odd.code, 2);
    EXPECT_NE(odd.err.find("--patch-as splats"), std::string::npos) << odd.err;
}

TEST(BuildPatches, AreVerifiedAgainstTheirSource) {
    const TempFolder folder;
    test::writeObj(folder / "torus.obj", test::torusMesh(120, 50));
    test::writeObj(folder / "other.obj", test::torusMesh(20, 9));
    ASSERT_EQ(runProgram(folder, "build torus.obj --patches -o t.stipple").code, 0);
    const Outcome right = runProgram(folder, "info t.stipple --verify --against torus.obj --json");
    ASSERT_EQ(right.code, 0) << right.err;
    const auto j = nlohmann::json::parse(right.out);
    EXPECT_TRUE(j["errors_measured"].get<bool>());
    EXPECT_LE(j["against"]["to_source"].get<double>(), j["against"]["stated"].get<double>());
    EXPECT_LE(j["against"]["from_source"].get<double>(), j["against"]["stated"].get<double>());
    EXPECT_GT(j["against"]["places_of_source"].get<uint64_t>(), 10'000u);
    const Outcome wrong = runProgram(folder, "info t.stipple --verify --against other.obj");
    EXPECT_EQ(wrong.code, 3);
    EXPECT_NE(wrong.err.find("farther from each other"), std::string::npos) << wrong.err;
    EXPECT_EQ(runProgram(folder, "info t.stipple --against torus.obj").code, 2);
}

TEST(BuildPatches, WhatIsOddIsRefused) {
    const TempFolder folder;
    test::writeObj(folder / "torus.obj", test::torusMesh(20, 9));
    const auto refused = [&](const std::string& arguments, int code, const std::string& word) {
        const Outcome r = runProgram(folder, "build " + arguments + " -o t.stipple");
        EXPECT_EQ(r.code, code) << arguments;
        EXPECT_NE(r.err.find(word), std::string::npos) << r.err;
        EXPECT_FALSE(std::filesystem::exists(folder / "t.stipple"));
    };
    refused("torus.obj --patches --fill-gaps", 2, "overlap");
    refused("torus.obj --patches --cone 80", 2, "--cone");
    refused("torus.obj --patches --surfels 1000", 2, "--surfels");
    ASSERT_EQ(runProgram(folder, "grow scan -o scan.ply --points 1k").code, 0);
    refused("scan.ply --patches", 3, "holds no triangles");
}

}  // namespace
}  // namespace stipple
