// `stipple build --patches` as a person runs it: closed models stay closed, the store is true, nothing odd is taken.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/image/image_io.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/program.h"
#include "tests/support/runs.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

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

/// Pixels in the middle of where `source` is drawn that `patches` leave empty; `inside`: all of those in the middle.
size_t holesIn(const std::vector<bool>& patches, const std::vector<bool>& source, size_t& inside) {
    size_t holes = 0;
    inside = 0;
    for (size_t y = 8; y < kDown - 8; ++y)
        for (size_t x = 8; x < kAcross - 8; ++x) {
            bool isInside = true;
            for (size_t j = y - 8; j <= y + 8; ++j)
                for (size_t i = x - 8; i <= x + 8; ++i) isInside = isInside && source[j * kAcross + i];
            inside += isInside ? 1 : 0;
            holes += isInside && !patches[y * kAcross + x] ? 1 : 0;
        }
    return holes;
}
void expectClosed(const TempFolder& folder, const std::string& source, const std::string& store,
                  const std::vector<std::string>& views) {
    for (const std::string& view : views) {
        const std::vector<bool> whole = covered(folder, source, "--error 0.1 " + view);
        for (const std::string error : {"0.1", "1", "4"}) {
            size_t inside = 0;
            EXPECT_EQ(holesIn(covered(folder, store, "--error " + error + " " + view), whole, inside), 0u)
                << view << " at " << error << " px";
            EXPECT_GT(inside, 1000u);
        }
    }
}

TEST(BuildPatches, ClosedModelsStayClosed) {
    const TempFolder folder;
    test::writeObj(folder / "torus.obj", test::torusMesh(260, 100));
    const Outcome built = runProgram(folder, "build torus.obj --patches --patch-samples 200k -o t.stipple --json");
    ASSERT_EQ(built.code, 0) << built.err;
    EXPECT_GE(nlohmann::json::parse(built.out)["nodes"].get<uint64_t>(), 9u);
    expectClosed(folder, "torus.obj", "t.stipple", {"--eye 2,2,2 --target 0,0,0", "--eye 0,-3,0.6 --target 0,0,0"});
}

TEST(BuildPatches, ClosedModelsAsPointsStayClosed) {
    const std::string igea = test::dataFile("01_meshes/misc/igea.ply");
    if (igea.empty()) GTEST_SKIP() << "igea.ply is missing: no real closed model was built from its points";
    const TempFolder folder;
    const Outcome built = runProgram(folder, "build " + igea + " --only-points --patches -o t.stipple --json");
    ASSERT_EQ(built.code, 0) << built.err;
    const auto j = nlohmann::json::parse(built.out);
    EXPECT_EQ(j["points_in"].get<uint64_t>(), 134'345u);
    EXPECT_GE(j["nodes"].get<uint64_t>(), 9u);
    expectClosed(folder, igea, "t.stipple",
                 {"--eye 0.1,0.07,0.12 --target 0,0,0", "--eye -0.14,0.03,0.09 --target 0,0,0"});
    const Outcome right = runProgram(folder, "info t.stipple --verify --only-points --against " + igea + " --json");
    ASSERT_EQ(right.code, 0) << right.err;
    const auto against = nlohmann::json::parse(right.out)["against"];
    EXPECT_LE(against["from_source"].get<double>(), against["stated"].get<double>());
    EXPECT_GT(against["places_of_source"].get<uint64_t>(), 100'000u);
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
    const auto says = [&](const char* how, const char* what) {
        const Outcome drawn = runProgram(folder, fmt::format("render t.stipple -o how.png {}", how));
        EXPECT_NE(drawn.out.find(what), std::string::npos) << drawn.out;
    };
    says("", " of patches as strips (");
    says("--patch-as splats", " of patches as splats (");
    says("--patch-as splats --interpolate direct", " of patches as direct splats (");
    says("--patch-as samples", " of patches as samples, ");
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

TEST(BuildPatches, OfScansAreVerifiedAgainstThem) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o scan.ply --points 30k").code, 0);
    ASSERT_EQ(runProgram(folder, "grow scan -o other.ply --points 3k --seed 9").code, 0);
    const Outcome built = runProgram(folder, "build scan.ply --patches -o t.stipple --json");
    ASSERT_EQ(built.code, 0) << built.err;
    const Outcome fewer = runProgram(folder, "build scan.ply --patches --patch-samples 5k -o f.stipple --json");
    ASSERT_EQ(fewer.code, 0) << fewer.err;
    EXPECT_LT(nlohmann::json::parse(fewer.out)["bytes_out"].get<double>(),
              0.8 * nlohmann::json::parse(built.out)["bytes_out"].get<double>());
    EXPECT_NE(built.out.find("samples in patches"), std::string::npos) << built.out;
    const Outcome right = runProgram(folder, "info t.stipple --verify --against scan.ply --json");
    ASSERT_EQ(right.code, 0) << right.err;
    const auto j = nlohmann::json::parse(right.out);
    EXPECT_TRUE(j["errors_measured"].get<bool>());
    EXPECT_LE(j["against"]["from_source"].get<double>(), j["against"]["stated"].get<double>());
    EXPECT_GT(j["against"]["places_of_source"].get<uint64_t>(), 10'000u);
    // The control.
    const Outcome wrong = runProgram(folder, "info t.stipple --verify --against other.ply");
    EXPECT_EQ(wrong.code, 3);
    EXPECT_NE(wrong.err.find("farther from each other"), std::string::npos) << wrong.err;
}

/// Kills come at any moment of a build that goes through the disk; whatever they leave, the next one ends with the same
/// bytes.
TEST(BuildPatches, KilledAtAnyMomentTheyGoOnAndEndWithTheSameBytes) {
    constexpr int kKills = 4;
    const TempFolder folder;
    test::writeObj(folder / "mesh.obj", test::torusMesh(480, 180));
    ASSERT_EQ(runProgram(folder, "grow scan -o scan.ply --points 300k").code, 0);
    for (const std::string input : {"mesh.obj", "scan.ply"}) {
        SCOPED_TRACE(input);
        const std::vector<std::string> command{
            STIPPLE_PROGRAM, "build", folder / input, "--patches", "-o",     folder / "a.stipple",
            "--memory",      "270M",  "--threads",    "1",         "--quiet"};
        const auto from = std::chrono::steady_clock::now();
        const Outcome first =
            runProgram(folder, "build " + input + " --patches -o a.stipple --memory 270M --threads 1 --json");
        const double took = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - from).count();
        ASSERT_EQ(first.code, 0) << first.err;
        ASSERT_GT(nlohmann::json::parse(first.out)["temporary_bytes"].get<uint64_t>(), 0u) << "it fits in memory";
        const std::string whole = test::slurp(folder / "a.stipple");
        ASSERT_FALSE(whole.empty());
        Rng rng(5);
        for (int kill = 0; kill < kKills; ++kill) {
            fs::remove(folder / "a.stipple");
            if (test::runAndKill(command, static_cast<int>(took * rng.uniform(0.05, 0.9)), SIGKILL))
                EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole) << "ended before it was killed, " << kill;
        }
        fs::remove(folder / "a.stipple");
        ASSERT_TRUE(test::runAndKill(command, 600'000, SIGKILL));
        EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole);
        EXPECT_FALSE(fs::exists(folder / "a.stipple.build"));
        fs::remove(folder / "a.stipple");
    }
}

// The colours of a scanner hold the light in them, as points and as patches.
TEST(BuildPatches, OfColouredScansAreNotLitAgain) {
    const std::string scan = test::dataFile("02_scans/outcrop_rgb_cloudcompare/example_data.laz");
    if (scan.empty()) GTEST_SKIP() << "the outcrop is missing: no coloured scan was built as patches";
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "build " + scan + " --patches -o t.stipple --quiet").code, 0);
    const auto picture = [&](const std::string& shade) {
        const Outcome r = runProgram(
            folder, "render t.stipple -o p.png --force --quiet --device cpu --size 160x120 --error 8 " + shade);
        EXPECT_EQ(r.code, 0) << r.err;
        const auto image = image::readImage(folder / "p.png");
        return image ? image->rgba : std::vector<uint32_t>();
    };
    EXPECT_EQ(picture(""), picture("--shade unlit"));
    EXPECT_NE(picture(""), picture("--shade lit")) << "the control";
}

/// The mean colour of what a store shows.
glm::dvec3 meanColour(const TempFolder& folder, const std::string& store, const std::string& more) {
    const Outcome r = runProgram(
        folder, "render " + store + " -o p.png --force --quiet --alpha --device cpu --size 96x96 --error 1 " + more);
    EXPECT_EQ(r.code, 0) << r.err;
    glm::dvec3 sum(0);
    double count = 0;
    if (const auto image = image::readImage(folder / "p.png"))
        for (const uint32_t p : image->rgba) {
            if (p >> 24 == 0) continue;
            sum += glm::dvec3(p & 255u, p >> 8 & 255u, p >> 16 & 255u);
            ++count;
        }
    EXPECT_GT(count, 500);
    return sum / std::max(count, 1.0);
}

// What of a scan is patches and what stays points stand side by side: one formula lights both.
TEST(BuildPatches, OfScansAreColouredAndLitAsTheirPointsAre) {
    const TempFolder folder;
    std::string rows, colours;
    for (int k = 0; k < 90 * 90; ++k) {
        const double x = k % 90, y = k / 90;
        const std::string place = fmt::format("{} {} {}", x, y, 0.3 * x + 4 * std::sin(y / 12));
        rows += place + "\n";
        colours += place + (k % 2 == 0 ? " 120 160 60\n" : " 126 160 54\n");  // (one colour for all counts as none)
    }
    const std::string head = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n", 90 * 90);
    test::spit(folder / "grey.ply", head + "end_header\n" + rows);
    test::spit(folder / "green.ply",
               head + "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n" + colours);
    for (const std::string scan : {"grey", "green"}) {
        ASSERT_EQ(runProgram(folder, "build " + scan + ".ply --up z -o " + scan + ".p.stipple --quiet").code, 0);
        ASSERT_EQ(runProgram(folder, "build " + scan + ".ply --up z --patches -o " + scan + ".s.stipple --quiet").code,
                  0);
        for (const std::string how :
             {"", "--shade lit", "--shade unlit", "--colour plain", "--colour height", "--colour normal"}) {
            const glm::dvec3 points = meanColour(folder, scan + ".p.stipple", how);
            for (const std::string as : {"", " --patch-as splats", " --patch-as samples"}) {
                const glm::dvec3 patches = meanColour(folder, scan + ".s.stipple", how + as);
                for (int a = 0; a < 3; ++a)
                    EXPECT_NEAR(patches[a], points[a], 4) << scan << " " << how << as << ", channel " << a;
            }
        }
    }
    const glm::dvec3 grey = meanColour(folder, "grey.s.stipple", "--colour plain");
    EXPECT_NEAR(grey.x, grey.z, 4);
    const glm::dvec3 high = meanColour(folder, "grey.s.stipple", "");
    EXPECT_GT(std::abs(high.x - high.z), 10) << "without colours it is its height that is seen";
}

// Singles of sines and cosines leave the vertices of its poles 1e-16 apart: they are no small object far from others.
TEST(BuildPatches, ABallWhosePolesAreAHairApartIsBuilt) {
    const TempFolder folder;
    constexpr int kAround = 64, kRows = 32;
    constexpr float kPi = 3.14159274f;
    std::string obj;
    for (int k = 0; k < kAround * (kRows + 1); ++k) {
        const float down = kPi * static_cast<float>(k / kAround) / kRows,
                    around = 2 * kPi * static_cast<float>(k % kAround) / kAround;
        obj += fmt::format("v {} {} {}\n", std::sin(down) * std::cos(around), std::sin(down) * std::sin(around),
                           std::cos(down));
    }
    for (int k = 0; k < kAround * kRows; ++k) {
        const int a = k + 1, b = k / kAround * kAround + (k + 1) % kAround + 1;
        obj += fmt::format("f {} {} {} {}\n", a, a + kAround, b + kAround, b);
    }
    test::spit(folder / "ball.obj", obj);
    const Outcome built = runProgram(folder, "build ball.obj --patches -o t.stipple");
    ASSERT_EQ(built.code, 0) << built.err;
    const Outcome right = runProgram(folder, "info t.stipple --verify --against ball.obj");
    EXPECT_EQ(right.code, 0) << right.err;
    // Of doubles, they are a hundred at one place; as points, as triangles, and as patches of either.
    std::string ply = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n",
        129 * 65);
    std::string rows, faces;
    for (int k = 0; k < 129 * 65; ++k) {
        const double down = 3.14159265358979323846 * (k / 129) / 64,
                     around = 2 * 3.14159265358979323846 * (k % 129) / 128;
        rows += fmt::format("{} {} {}\n", std::sin(down) * std::cos(around), std::sin(down) * std::sin(around),
                            std::cos(down));
        if (k / 129 < 64 && k % 129 < 128) faces += fmt::format("4 {} {} {} {}\n", k, k + 129, k + 130, k + 1);
    }
    test::spit(folder / "points.ply", ply + "end_header\n" + rows);
    test::spit(folder / "mesh.ply",
               ply + "element face 8192\nproperty list uchar int vertex_indices\nend_header\n" + rows + faces);
    for (const std::string file : {"points.ply", "mesh.ply"})
        for (const std::string how : {"", " --patches"}) {
            const Outcome made = runProgram(folder, "build " + file + how + " -o s.stipple --force");
            EXPECT_EQ(made.code, 0) << file << how << ": " << made.err;
        }
    // What is small and far from the rest is still told from it.
    test::spit(folder / "far.obj", obj + "v 1e12 0 0\nv 1e12 1 0\nv 1e12 0 1\nf -1 -2 -3\n");
    EXPECT_EQ(runProgram(folder, "build far.obj --patches -o f.stipple").code, 3);
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
    refused("scan.ply --patches --surfel-weights", 2, "--surfel-weights");
    refused("scan.ply --patches --fill-gaps", 2, "overlap");
}

TEST(BuildPatches, MoreSamplesThanThereCanBeAreRefusedByName) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o scan.ply --points 2k").code, 0);
    const Outcome refused = runProgram(folder, "build scan.ply --patches --patch-samples 99999M -o a.stipple");
    EXPECT_EQ(refused.code, 2) << refused.err;
    EXPECT_NE(refused.err.find("--patch-samples 99999000000"), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find("ask for 1048576 at most"), std::string::npos) << refused.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "a.stipple"));
}

/// A bent sheet whose material sends light, as .gltf beside its buffer.
void writeGlowingSheet(const TempFolder& folder) {
    const lod::TriangleMesh mesh =
        test::sheet(20, 20, [](double u, double v) { return glm::dvec3(u, v, 0.2 * u * (1 - u) * v); });
    std::string bytes;
    for (const glm::dvec3& p : mesh.position) {
        const glm::vec3 at(p);
        bytes.append(reinterpret_cast<const char*>(&at), sizeof(at));
    }
    const size_t places = bytes.size();
    bytes.append(reinterpret_cast<const char*>(mesh.indices.data()), mesh.indices.size() * sizeof(uint32_t));
    test::spit(folder / "glowing.bin", bytes);
    nlohmann::json root = nlohmann::json::parse(R"({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"emissiveFactor": [1, 0.5, 0], "pbrMetallicRoughness": {"roughnessFactor": 0.05}}],
        "buffers": [{"uri": "glowing.bin"}], "bufferViews": [{"buffer": 0}, {"buffer": 0}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
                      {"bufferView": 1, "componentType": 5125, "type": "SCALAR"}]})");
    root["buffers"][0]["byteLength"] = bytes.size();
    root["bufferViews"][0]["byteLength"] = root["bufferViews"][1]["byteOffset"] = places;
    root["bufferViews"][1]["byteLength"] = bytes.size() - places;
    root["accessors"][0]["count"] = mesh.position.size();
    root["accessors"][1]["count"] = mesh.indices.size();
    test::spit(folder / "glowing.gltf", root.dump());
}

// `info` says what there is: of a store whose maps hold light alone no colours, and of samples no count of points.
TEST(BuildPatches, InfoSaysWhatTheirMapsHold) {
    const TempFolder folder;
    writeGlowingSheet(folder);
    const Outcome built = runProgram(folder, "build glowing.gltf --patches -o a.stipple");
    ASSERT_EQ(built.code, 0) << built.err;
    const Outcome told = runProgram(folder, "info a.stipple"), asJson = runProgram(folder, "info a.stipple --json");
    ASSERT_EQ(told.code, 0) << told.err;
    EXPECT_NE(told.out.find("at most: 1 in 1 node; light; "), std::string::npos) << told.out;
    EXPECT_EQ(told.out.find("colours"), std::string::npos) << told.out;
    EXPECT_NE(told.out.find("stored to 0.03 degrees"), std::string::npos) << "of mirrors: " << told.out;
    EXPECT_NE(told.out.find("roughness 0.05, metallic 1\n"), std::string::npos) << told.out;
    const auto j = nlohmann::json::parse(asJson.out);
    EXPECT_FALSE(j["maps"]["has_colours"].get<bool>());
    EXPECT_TRUE(j["maps"]["has_light"].get<bool>());
}

/// Creases everywhere: the cap of samples is met by the tightest bound that meets it, and what is left is said.
TEST(BuildPatches, OfTheHelmetStayAsNearAsTheirSamplesAllow) {
    const std::string helmet = test::dataFile("06_gltf/DamagedHelmet.glb");
    if (helmet.empty()) GTEST_SKIP() << "DamagedHelmet.glb is missing: no creased model was built";
    const TempFolder folder;
    const Outcome built = runProgram(folder, "build " + helmet + " --patches --patch-texels 1 -o a.stipple");
    ASSERT_EQ(built.code, 0) << built.err;
    EXPECT_NE((built.out + built.err).find("px where a picture shows all of it"), std::string::npos) << built.err;
    const Outcome told = runProgram(folder, "info a.stipple --json");
    ASSERT_EQ(told.code, 0) << told.err;
    const auto j = nlohmann::json::parse(told.out);
    EXPECT_LE(j["leaf_distance"]["greatest"].get<double>(), 0.033) << "0.0404 with one step of the bound";
    EXPECT_LE(j["patches"]["samples"].get<uint64_t>(), 4u * 22'094u);
    EXPECT_EQ(j["maps"]["texels"].dump(), R"({"1":1})") << "the light of its visor alone, of each sample";
    EXPECT_TRUE(j["maps"]["has_light"].get<bool>());
    EXPECT_FALSE(j["maps"]["has_colours"].get<bool>() || j["maps"]["has_normals"].get<bool>());
    EXPECT_TRUE(j["coordinate_rounding"].is_null()) << "a distance of surfaces is no rounding";
    EXPECT_EQ(j["levels"].back()["largest_error"], j["leaf_distance"]["greatest"]);
}

}  // namespace
}  // namespace stipple
