// A build may use little memory, be killed at any moment and see its input in any order: the file is the same.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "engine/base/process.h"
#include "tests/support/program.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;
using Lattice = std::vector<glm::ivec3>;

/// A wavy ground, thousands of times denser around two places.
Lattice unevenGround(size_t count, uint64_t seed) {
    Rng rng(seed);
    Lattice points;
    while (points.size() < count) {
        const double size = std::exp2(-rng.uniform(0, 9)) * 4e5;
        const glm::dvec2 centre = rng.uniform() < 0.5 ? glm::dvec2(1e5, 2e5) : glm::dvec2(-2.3e5, -1e5);
        const glm::dvec2 p = centre + size * glm::dvec2(rng.normal(), rng.normal());
        if (std::abs(p.x) > 8e5 || std::abs(p.y) > 8e5) continue;
        points.emplace_back(p.x, p.y, 2e4 * std::sin(p.x * 1e-5) * std::cos(p.y * 2e-5) + 30 * rng.normal());
    }
    return points;
}

/// Memory with which half a million points go through the disk.
constexpr uint64_t littleFor(int threads) { return (uint64_t{92} + 29 * static_cast<uint64_t>(threads)) << 20; }

BuildReport buildWith(const std::string& input, const std::string& output, int threads, uint64_t memory,
                      BuildSettings settings = {}) {
    const auto executor = makeTbbExecutor(threads);
    settings.memoryBytes = memory;
    return test::build({input}, output, *executor, settings);
}

TEST(OutOfCore, NeitherMemoryNorThreadsNorTheOrderOfTheInputShow) {
    const test::TempFolder folder;
    Lattice points = unevenGround(600'000, 1);
    test::writeLas(folder / "a.las", points, 0.001, {5e5, 5.4e6, 0});
    std::shuffle(points.begin(), points.end(), std::mt19937(7));
    test::writeLas(folder / "b.las", points, 0.001, {5e5, 5.4e6, 0});
    for (const bool isFine : {false, true}) {
        BuildSettings settings;
        settings.fineNormals = isFine;
        EXPECT_EQ(buildWith(folder / "a.las", folder / "a.stipple", 2, uint64_t{2} << 30, settings).temporaryBytes, 0u);
        const std::string whole = test::slurp(folder / "a.stipple");
        for (const auto& [threads, memory, name] : {std::tuple{2, littleFor(2), "a"},
                                                    {16, littleFor(2), "a"},
                                                    {1, littleFor(1), "a"},
                                                    {2, littleFor(2), "b"},
                                                    {5, uint64_t{4} << 30, "b"}}) {
            const std::string out = folder / "other.stipple";
            const BuildReport report = buildWith(folder / (std::string(name) + ".las"), out, threads, memory, settings);
            EXPECT_EQ(report.temporaryBytes > 0, memory < uint64_t{1} << 30);
            // Room on the disk: 1.2 times the input at most.
            EXPECT_LE(report.temporaryBytes, 1.2 * double(fs::file_size(folder / "a.las")));
            std::string bytes = test::slurp(out);
            // The description names the file.
            for (size_t at = 0; (at = bytes.find("b.las", at)) != std::string::npos;) bytes.replace(at, 5, "a.las");
            EXPECT_EQ(openStore(out)->hierarchy.nodes.size(), openStore(folder / "a.stipple")->hierarchy.nodes.size());
            if (std::string(name) == "a") {
                EXPECT_TRUE(bytes == whole) << threads << " threads";
            } else {  // of the chunks nothing differs
                const uint64_t end = openStore(out)->hierarchy.nodes[0].chunkOffset;
                EXPECT_GT(end, 1'000'000u);
                EXPECT_EQ(bytes.substr(512, end - 512), whole.substr(512, end - 512)) << threads << " threads";
            }
        }
        EXPECT_FALSE(fs::exists(folder / "other.stipple.build"));
        EXPECT_FALSE(fs::exists(folder / "other.stipple.partial"));
    }
}

TEST(OutOfCore, KilledAtAnyMomentItGoesOnAndEndsWithTheSameBytes) {
    const test::TempFolder folder;
    test::writeLas(folder / "a.las", unevenGround(900'000, 2), 0.001, {0, 0, 0});
    const std::vector<std::string> command{STIPPLE_PROGRAM, "build", folder / "a.las", "-o", folder / "a.stipple",
                                           "--memory",      "150M",  "--threads",      "2",  "--quiet"};
    const double start = nowSeconds();
    ASSERT_TRUE(test::runAndKill(command, 600'000, SIGKILL));
    const double took = (nowSeconds() - start) * 1e3;  // on this machine, as busy as it is
    const std::string whole = test::slurp(folder / "a.stipple");
    fs::remove(folder / "a.stipple");
    const auto isBuilding = [&] { return fs::exists(folder / "a.stipple.partial"); };
    Rng rng(5);
    int kills = 0, finished = 0, resumable = 0;
    const int wanted = test::isThorough() ? 20 : 8;
    while (kills < wanted) {
        // Any moment of all, and any after the first bucket has been begun.
        const bool isDone =
            kills % 2 == 0
                ? test::runAndKill(command, static_cast<int>(took * rng.uniform(0.02, 1)), SIGKILL)
                : test::runAndKill(command, static_cast<int>(took * rng.uniform(0, 0.3)), SIGKILL, isBuilding);
        kills += isDone ? 0 : 1;
        resumable += !isDone && fs::exists(folder / "a.stipple.partial") ? 1 : 0;
        // It appears whole or not at all. (A kill may come after that and before the end.)
        if (!fs::exists(folder / "a.stipple")) {
            EXPECT_FALSE(isDone);
            continue;
        }
        ++finished;
        ASSERT_TRUE(test::slurp(folder / "a.stipple") == whole);
        fs::remove(folder / "a.stipple");
    }
    EXPECT_GT(resumable, wanted / 6) << "some kills must hit while buckets are built";
    // Other settings or another input are refused while an interrupted build lies there. (One is made for certain.)
    if (!isBuilding()) ASSERT_FALSE(test::runAndKill(command, 0, SIGKILL, isBuilding));
    std::vector<std::string> other = command;
    other.insert(other.end(), {"--normals", "none"});
    EXPECT_FALSE(test::runAndKill(other, 600'000, SIGKILL) && fs::exists(folder / "a.stipple"));
    ASSERT_TRUE(test::runAndKill(command, 600'000, SIGKILL));
    EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole);
    std::printf("%d kills, %d of them while buckets were built, %d builds finished in between\n", kills, resumable,
                finished);
    // A polite stop says how to go on, and leaves nothing where all is in memory.
    fs::remove(folder / "a.stipple");
    test::RunningProgram polite(folder, {command.begin() + 1, command.end()});
    EXPECT_TRUE(polite.await([&] { return fs::exists(folder / "a.stipple.partial"); }));
    polite.signal(SIGINT);
    EXPECT_EQ(polite.end().code, 7);
    EXPECT_TRUE(fs::exists(folder / "a.stipple.build"));
}

TEST(OutOfCore, CarriesOnFromTheJournalAndNotFromTheStart) {
    const test::TempFolder folder;
    test::writeLas(folder / "a.las", unevenGround(600'000, 3), 0.001, {0, 0, 0});
    buildWith(folder / "a.las", folder / "whole.stipple", 2, littleFor(2));
    int asked = 0;
    BuildSettings settings;
    settings.memoryBytes = littleFor(1);
    Progress silent(false);
    const auto executor = makeSerialExecutor();
    BuildReport report;
    for (int run = 0;; ++run) {
        ASSERT_LT(run, 100);
        asked = 0;
        int buckets = 0;
        // Stops when it is asked for the second time while buckets are built: one bucket more is done each time.
        settings.isStopped = [&] {
            ++asked;
            return fs::exists(folder / "a.stipple.partial") && ++buckets == 2;
        };
        const auto built = buildStore({folder / "a.las"}, folder / "a.stipple", settings, *executor, silent);
        if (built) {
            report = *built;
            EXPECT_GT(run, 2);
            break;
        }
        EXPECT_EQ(built.error().kind, ErrorKind::interrupted);
        EXPECT_NE(built.error().hint.find("run the same command again"), std::string::npos);
        if (run > 0) EXPECT_LT(asked, 4) << "input was read again";
    }
    EXPECT_TRUE(report.isResumed);
    EXPECT_EQ(report.pointsOut, 600'000u);
    EXPECT_TRUE(test::slurp(folder / "a.stipple").substr(4096) == test::slurp(folder / "whole.stipple").substr(4096));
    // Nor are chunks kept that somebody changed.
    fs::remove(folder / "a.stipple");
    int buckets = 0;
    settings.isStopped = [&] { return fs::exists(folder / "a.stipple.partial") && ++buckets == 3; };
    ASSERT_FALSE(buildStore({folder / "a.las"}, folder / "a.stipple", settings, *executor, silent));
    std::string partial = test::slurp(folder / "a.stipple.partial");
    ASSERT_GT(partial.size(), 10'000u);
    partial[5000] = static_cast<char>(partial[5000] ^ 1);
    test::spit(folder / "a.stipple.partial", partial);
    const auto spoilt = buildStore({folder / "a.las"}, folder / "a.stipple", settings, *executor, silent);
    ASSERT_FALSE(spoilt);
    EXPECT_NE(spoilt.error().line().find("is not what was written"), std::string::npos) << spoilt.error().line();
    fs::remove(folder / "a.stipple.partial");
    fs::remove_all(folder / "a.stipple.build");
    // A bucket that somebody changed is not built from.
    bool isSpoilt = false;
    settings.isStopped = [&] {
        if (isSpoilt || !fs::exists(folder / "a.stipple.partial")) return false;
        for (const auto& entry : fs::directory_iterator(folder / "a.stipple.build"))
            if (entry.path().filename() == "points-0") {
                std::string bytes = test::slurp(entry.path());
                bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
                test::spit(entry.path(), bytes);
                isSpoilt = true;
            }
        return false;
    };
    fs::remove(folder / "a.stipple");
    const auto built = buildStore({folder / "a.las"}, folder / "a.stipple", settings, *executor, silent);
    ASSERT_FALSE(built);
    EXPECT_NE(built.error().line().find("is not what was written"), std::string::npos) << built.error().line();
}

TEST(OutOfCore, StaysWithinItsMemory) {
    const test::TempFolder folder;
    test::writeLas(folder / "a.las", unevenGround(3'000'000, 4), 0.001, {0, 0, 0});
    for (const int memory : {160, 300}) {
        ASSERT_EQ(test::shell("true",
                              fmt::format("build {} -o {} --memory {}M --threads 2 --quiet --json", folder / "a.las",
                                          folder / "a.stipple", memory),
                              folder.path()),
                  0)
            << test::slurp(folder / "err");
        const auto report = nlohmann::json::parse(test::slurp(folder / "out"));
        if (!test::isSanitized) EXPECT_LT(report["peak_rss_bytes"].get<double>(), memory * 1048576.0);
        EXPECT_EQ(report["temporary_bytes"].get<double>() > 0, memory == 160);
    }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    // All it may map, code and stacks included, is what it promised to stay below.
    EXPECT_EQ(test::shell("ulimit -v 524288",
                          "build " + (folder / "a.las") + " -o " + (folder / "b.stipple") +
                              " --memory 512M --threads 2 --quiet",
                          folder.path()),
              0)
        << test::slurp(folder / "err");
    EXPECT_TRUE(test::slurp(folder / "a.stipple") == test::slurp(folder / "b.stipple"));
#endif
}

TEST(OutOfCore, PointsWithoutColoursAreTheSameToo) {
    const test::TempFolder folder;
    std::string ply =
        "ply\nformat binary_little_endian 1.0\nelement vertex 700000\nproperty float x\nproperty float "
        "y\nproperty float z\nend_header\n";
    Rng rng(3);
    for (int i = 0; i < 700'000; ++i) {
        const glm::dvec3 d = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        const std::array<float, 3> p{float(d.x), float(d.y), float(d.z)};
        ply.append(reinterpret_cast<const char*>(p.data()), sizeof(p));
    }
    test::spit(folder / "a.ply", ply);
    buildWith(folder / "a.ply", folder / "a.stipple", 2, uint64_t{2} << 30);
    const BuildReport little = buildWith(folder / "a.ply", folder / "b.stipple", 2, littleFor(2));
    EXPECT_GT(little.temporaryBytes, 0u);
    EXPECT_TRUE(test::slurp(folder / "a.stipple") == test::slurp(folder / "b.stipple"));
    EXPECT_FALSE(openStore(folder / "b.stipple")->description.hasColour);
}

TEST(OutOfCore, AFullDiskLosesNothing) {
    const test::TempFolder folder;
    test::writeLas(folder / "a.las", unevenGround(600'000, 6), 0.001, {0, 0, 0});
    const std::string command =
        "build " + (folder / "a.las") + " -o " + (folder / "a.stipple") + " --memory 150M --threads 2 --quiet";
    ASSERT_EQ(test::shell("true", command, folder.path()), 0);
    const std::string whole = test::slurp(folder / "a.stipple");
    fs::remove(folder / "a.stipple");
    // A limit on the size of files acts as a disk that is full: of buckets first, then of what is written of the store.
    for (const int kibibytes : {200, 5000}) {
        EXPECT_EQ(test::shell(fmt::format("ulimit -f {}", kibibytes), command, folder.path()), 4);
        const std::string line = test::slurp(folder / "err");
        EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
        EXPECT_NE(line.find("cannot be written"), std::string::npos) << line;
        EXPECT_FALSE(fs::exists(folder / "a.stipple"));
    }
    ASSERT_EQ(test::shell("true", command + " --json", folder.path()), 0) << test::slurp(folder / "err");
    EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole);
    EXPECT_EQ(nlohmann::json::parse(test::slurp(folder / "out"))["resumed"], true);
}

TEST(OutOfCore, AnInputThatChangesMeanwhileIsRefused) {
    const test::TempFolder folder;
    const Lattice points = unevenGround(200'000, 8);
    test::writeLas(folder / "a.las", points, 0.001, {0, 0, 0});
    const std::string before = test::slurp(folder / "a.las");
    Progress silent(false);
    const auto executor = makeSerialExecutor();
    for (const bool isShorter : {false, true}) {
        test::spit(folder / "a.las", before);
        int asked = 0;
        BuildSettings settings;
        settings.isStopped = [&] {  // asked first when points are counted
            if (++asked != 4) return false;
            std::string bytes = before;
            if (isShorter)
                bytes.resize(bytes.size() / 2);
            else
                for (size_t i = 0; i < 4000; ++i) std::swap(bytes[227 + 26 * i], bytes[227 + 26 * (i + 150'000)]);
            test::spit(folder / "a.las", bytes);
            return false;
        };
        const auto built = buildStore({folder / "a.las"}, folder / "a.stipple", settings, *executor, silent);
        ASSERT_FALSE(built);
        EXPECT_EQ(built.error().kind, ErrorKind::input) << built.error().line();
        EXPECT_FALSE(fs::exists(folder / "a.stipple"));
    }
}

TEST(OutOfCore, OddCloudsAreBuiltInFull) {
    Rng rng(9);
    const auto random = [&](double lo, double hi) { return static_cast<int>(rng.uniform(lo, hi)); };
    std::vector<std::pair<std::string, Lattice>> clouds;
    Lattice one;  // all in one cell of any even grid, but for a stray point
    for (int i = 0; i < 400'000; ++i) one.emplace_back(random(0, 900), random(0, 900), random(0, 40));
    one.emplace_back(2'000'000'000, 2'000'000'000, 2'000'000'000);
    clouds.emplace_back("one cell", std::move(one));
    Lattice corridor;
    for (int i = 0; i < 400'000; ++i) corridor.emplace_back(random(0, 2e9), random(0, 2000), random(0, 2000));
    clouds.emplace_back("corridor", std::move(corridor));
    Lattice volume;
    for (int i = 0; i < 400'000; ++i) volume.emplace_back(random(0, 1e4), random(0, 1e4), random(0, 1e4));
    clouds.emplace_back("volume", std::move(volume));
    Lattice planet;
    for (int i = 0; i < 400'000; ++i) {
        const glm::dvec3 d = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        planet.emplace_back(2.1e9 * d);
    }
    clouds.emplace_back("planet", std::move(planet));
    Lattice same(300'000, glm::ivec3(77, -5, 3));  // one place, others around it
    for (int i = 0; i < 150'000; ++i) same.emplace_back(random(0, 5000), random(0, 5000), random(0, 5000));
    clouds.emplace_back("duplicates", std::move(same));
    Lattice faces;  // nothing but the corners and faces of the box
    for (int i = 0; i < 300'000; ++i) {
        glm::ivec3 p(random(0, 65536), random(0, 65536), random(0, 65536));
        p[i % 3] = i % 2 == 0 ? 0 : 65535;
        faces.push_back(p);
    }
    clouds.emplace_back("faces", std::move(faces));
    const auto executor = makeTbbExecutor(2);
    for (const auto& [name, points] : clouds) {
        const test::TempFolder folder;
        test::writeLas(folder / "a.las", points, 0.001, {0, 0, 0});
        for (const bool isMerged : {false, true}) {
            BuildSettings settings;
            settings.mergeDuplicates = isMerged;
            const BuildReport whole = buildWith(folder / "a.las", folder / "a.stipple", 2, uint64_t{2} << 30, settings);
            const BuildReport little = buildWith(folder / "a.las", folder / "b.stipple", 2, littleFor(2), settings);
            EXPECT_TRUE(test::slurp(folder / "a.stipple") == test::slurp(folder / "b.stipple")) << name;
            EXPECT_EQ(whole.pointsIn, points.size());
            uint64_t dropped = 0;
            for (const auto& [reason, count] : little.dropped) dropped += count;
            EXPECT_EQ(little.pointsOut + dropped, points.size()) << name;
            EXPECT_EQ(openStore(folder / "b.stipple")->description.dropped, little.dropped);
            EXPECT_EQ(openStore(folder / "b.stipple")->description.pointsIn, points.size());
            const auto store = openStore(folder / "b.stipple");
            ASSERT_TRUE(store);
            const auto verified = verifyStore(*store, *executor);
            EXPECT_TRUE(verified) << name << ": " << (verified ? "" : verified.error().line());
            auto expected = points;
            const auto less = [](const glm::ivec3& a, const glm::ivec3& b) {
                return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
            };
            std::sort(expected.begin(), expected.end(), less);
            expected.erase(std::unique(expected.begin(), expected.end()), expected.end());
            if (isMerged) EXPECT_EQ(little.pointsOut, expected.size()) << name;
            if (!isMerged && name != "duplicates") EXPECT_EQ(little.pointsOut, points.size()) << name;
        }
    }
}

}  // namespace
}  // namespace stipple::lod
