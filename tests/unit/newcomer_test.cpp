// The newcomer's path: the examples of README.md, one after the other, in a folder that holds nothing but what they
// name. Read from README.md itself, so that the two cannot disagree.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "tests/support/laz_encoder.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::runProgram;
using test::slurp;
using test::spit;
using test::TempFolder;

/// What is made smaller, so that the path takes seconds, and what stands for something of the reader's own.
constexpr std::array<std::array<const char*, 2>, 11> kSubstitutions{{
    {"/scratch", "scratch"},
    {"X,Y,Z", "10,10,0"},
    {"--triangles 10M", "--triangles 20k"},
    {"--leaves 200k", "--leaves 2k"},
    {"--trees 100k", "--trees 40 --leaves 1k --variants 1"},
    {"--points 10M", "--points 20k"},
    {"--size 1920x1080", "--size 480x270"},
    {"--target-ms 20", "--target-ms 2000"},  // (that so many suffice is no matter of this test)
    {"-o study --quick", "-o study --modes surface,pullpush --errors 1,4 --sizes 160x90 --views 1 --blocks 2"},
    {"--quick --budgets 100k,1M", "--modes surface --errors 4 --sizes 160x90 --views 1 --blocks 2 --budgets 5k,1M"},
    {"stipple view scan.stipple", "xvfb-run -n 300 -a stipple view scan.stipple --frames 3"},
}};

std::vector<std::string> examples() {
    std::vector<std::string> found;
    std::istringstream readme(slurp(std::string(STIPPLE_SOURCE_DIR) + "/README.md"));
    for (std::string line; std::getline(readme, line);) {
        const bool isExample = line.rfind("    stipple ", 0) == 0 || line.rfind("    mpirun ", 0) == 0;
        if (!isExample) continue;
        line = line.substr(4, line.find("  #", 4) - 4);
        found.push_back(line.substr(0, line.find_last_not_of(' ') + 1));
    }
    return found;
}

template <typename T>
void put(std::string& to, T value) {
    to.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

/// A sky: bright above, darker below. Radiance, not compressed.
void writeSky(const std::string& path) {
    constexpr int kWidth = 32, kHeight = 16;
    std::string bytes = fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", kHeight, kWidth);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const auto level = static_cast<char>(200 - 8 * y);
            bytes += {level, level, static_cast<char>(220 - 6 * y), static_cast<char>(128)};
        }
    spit(path, bytes);
}

/// A few hundred bent hairs, as Cem Yuksel's format has them.
void writeHair(const std::string& path) {
    constexpr uint32_t kCurves = 300, kSegments = 8, kPointsBit = 2;
    std::string bytes = "HAIR";
    for (const uint32_t v : {kCurves, kCurves * (kSegments + 1), kPointsBit, kSegments}) put(bytes, v);
    for (const float v : {0.01f, 0.0f, 0.4f, 0.3f, 0.2f}) put(bytes, v);
    bytes.resize(128);
    for (uint32_t s = 0; s < kCurves; ++s) {
        const float angle = 2.399963f * static_cast<float>(s), out = std::sqrt(static_cast<float>(s) / kCurves);
        for (uint32_t i = 0; i <= kSegments; ++i) {
            const float u = static_cast<float>(i) / kSegments, r = out * (1 + 0.4f * u * u);
            for (const float v : {r * std::cos(angle), r * std::sin(angle), u}) put(bytes, v);
        }
    }
    spit(path, bytes);
}

/// A bumpy ball of triangles.
void writeStatue(const std::string& path) {
    constexpr int kRings = 40, kSides = 80;
    std::string text = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face "
        "{}\nproperty list uchar int vertex_indices\nend_header\n",
        (kRings + 1) * kSides, 2 * kRings * kSides);
    for (int i = 0; i <= kRings; ++i)
        for (int k = 0; k < kSides; ++k) {
            const double polar = 0.02 + 3.1 * i / kRings, around = 6.283185307179586 * k / kSides;
            const double r = 1 + 0.1 * std::sin(5 * polar) * std::cos(4 * around);
            text += fmt::format("{:.6f} {:.6f} {:.6f}\n", r * std::sin(polar) * std::cos(around), r * std::cos(polar),
                                r * std::sin(polar) * std::sin(around));
        }
    for (int i = 0; i < kRings; ++i)
        for (int k = 0; k < kSides; ++k) {
            const int a = i * kSides + k, b = i * kSides + (k + 1) % kSides;
            text += fmt::format("3 {} {} {}\n3 {} {} {}\n", a, b, b + kSides, a, b + kSides, a + kSides);
        }
    spit(path, text);
}

/// The records of a grown scan, compressed.
void writeLaz(const std::string& las, const std::string& laz) {
    const std::string bytes = slurp(las);
    uint32_t at = 0;
    std::memcpy(&at, bytes.data() + 96, sizeof(at));
    test::LazSpec spec;
    spec.scale = 0.001;
    Rng rng(7);
    const auto file = test::encodeLas(spec, {bytes.begin() + at, bytes.end()}, true, rng);
    spit(laz, {file.begin(), file.end()});
}

/// Everything that the examples name and do not make themselves.
void makeInputs(const TempFolder& folder) {
    const auto grow = [&](const std::string& arguments) {
        const Outcome r = runProgram(folder, "grow " + arguments);
        ASSERT_EQ(r.code, 0) << arguments << r.err;
    };
    for (const char* name : {"tiles", "town", "scratch", "DATA"}) fs::create_directory(folder / name);
    grow("scan -o scan.las --points 20k");
    writeLaz(folder / "scan.las", folder / "scan.laz");
    grow("scan -o tiles/a.las --points 8k");
    grow("scan -o tiles/b.las --points 8k --origin 60,0,0 --seed 2");
    writeLaz(folder / "tiles/a.las", folder / "town/a.laz");
    writeLaz(folder / "tiles/b.las", folder / "town/b.laz");
    grow("rock -o model.glb --triangles 3k --texture 64");
    grow("building -o helmet.glb --triangles 3k --texture 64");
    grow("tree -o plant.glb --leaves 300 --as triangles");
    for (const char* picture : {"a.png --error 0.5", "b.png --error 4"})
        EXPECT_EQ(runProgram(folder, std::string("render model.glb --size 96x64 --quiet -o ") + picture).code, 0);
    writeStatue(folder / "statue.ply");
    writeHair(folder / "fur.hair");
    writeSky(folder / "sky.hdr");
}

bool hasCommand(const std::string& name) {
    return std::system(("command -v " + name + " >/dev/null").c_str()) == 0;  // NOLINT(concurrency-mt-unsafe)
}

void skip(const std::string& example, const std::string& why) {
    const std::string line = fmt::format("SKIP {}: {}\n", example, why);
    std::cout << line;
    if (const char* list = std::getenv("STIPPLE_SKIP_FILE")) std::ofstream(list, std::ios::app) << line;
}

std::string outputOf(const std::string& command) {
    std::istringstream words(command);
    for (std::string word; words >> word;)
        if (word == "-o" && words >> word) return word;
    return {};
}

TEST(Newcomer, TheExamplesOfTheReadmeWorkOneAfterTheOther) {
    const TempFolder folder;
    makeInputs(folder);
    ASSERT_FALSE(HasFatalFailure());
    fs::create_directory(folder / ".bin");
    fs::create_symlink(STIPPLE_PROGRAM, folder / ".bin/stipple");
    const std::string environment = fmt::format(
        "cd {0} && PATH={0}/.bin:$PATH XDG_CACHE_HOME={0}/.cache OMPI_ALLOW_RUN_AS_ROOT=1 "
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1 ",
        folder.path());
    std::vector<int> used(kSubstitutions.size());
    int run = 0;
    for (std::string command : examples()) {
        const std::string shown = command;
        for (size_t i = 0; i < kSubstitutions.size(); ++i)
            if (const size_t at = command.find(kSubstitutions[i][0]); at != std::string::npos) {
                command.replace(at, std::strlen(kSubstitutions[i][0]), kSubstitutions[i][1]);
                ++used[i];
            }
        SCOPED_TRACE(command);
        const std::string first = command.substr(0, command.find(' '));
        if (first != "stipple" && !hasCommand(first)) {
            skip(shown, first + " is missing");
            continue;
        }
        const std::string said = folder / ".said";
        const int status = std::system((environment + command + " >" + said + " 2>&1").c_str());
        const std::string text = slurp(said);
        if (text.find("built without") != std::string::npos) {
            skip(shown, text);
            continue;
        }
        ASSERT_EQ(status, 0) << text;
        EXPECT_EQ(("\n" + text).find("\nstipple: "), std::string::npos) << text;
        if (const std::string output = outputOf(command); !output.empty())
            EXPECT_TRUE(fs::exists(folder / output) && !fs::is_empty(folder / output)) << output;
        ++run;
    }
    EXPECT_GE(run, 18) << "the examples are found";
    for (size_t i = 0; i < used.size(); ++i) EXPECT_GT(used[i], 0) << kSubstitutions[i][0] << " stands in no example";
}

TEST(Newcomer, TheThreeLinesOfTheHelpWork) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o scan.las --points 5k").code, 0);
    std::istringstream help(runProgram(folder, "--help").out);
    int found = 0;
    for (std::string line; std::getline(help, line);) {
        if (line.rfind("  stipple build", 0) != 0 && line.rfind("  stipple render", 0) != 0) continue;
        const Outcome r = runProgram(folder, line.substr(10));
        EXPECT_EQ(r.code, 0) << line << r.err;
        ++found;
    }
    EXPECT_EQ(found, 2);
    EXPECT_TRUE(fs::exists(folder / "scan.png"));
}

}  // namespace
}  // namespace stipple
