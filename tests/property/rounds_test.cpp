// Meshes and curves out of core: little memory, kills and odd orders of the input do not show in the file.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/base/process.h"
#include "lod/builder/curves/curve_build.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/ply/mesh.h"
#include "tests/support/big_inputs.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

struct Kind {
    std::string name, input;
    /// Of one thread, with which the input goes through the disk; and what each further thread needs.
    uint64_t little, aThread;
};
std::vector<Kind> kinds(const test::TempFolder& folder) {
    test::writeGround(folder / "ground.ply", 500, 0);  // 498,002 triangles
    test::writeLawn(folder / "lawn.hair", 25'000);     // 500,000 segments
    return {{"mesh", folder / "ground.ply", uint64_t{190} << 20, uint64_t{80} << 20},
            {"curves", folder / "lawn.hair", uint64_t{170} << 20, uint64_t{64} << 20}};
}

Result<BuildReport> build(const std::string& input, const std::string& output, Executor& executor,
                          const BuildLimits& limits, uint64_t vertexBytes = 1 << 20) {
    Progress silent(false);
    if (fs::path(input).extension() == ".ply") {
        MeshBuildSettings settings;
        settings.limits = limits;
        settings.description.materials.resize(1);
        STIPPLE_ASSIGN(const MeshSource source,
                       openPlyMesh(input, vertexBytes, fs::path(output).parent_path().string()));
        return buildMeshStore(source, output, settings, executor, silent);
    }
    CurveBuildSettings settings;
    settings.limits = limits;
    STIPPLE_ASSIGN(const CurveSource source, openCurves(input));
    return buildCurveStore(cleanSource(source, 0), output, settings, executor, silent);
}

/// Nothing is lost without a word: in the report and in the file.
void expectBalance(const BuildReport& report, const Store& store) {
    const auto sumOf = [](const std::map<std::string, uint64_t>& counts) {
        uint64_t sum = 0;
        for (const auto& [what, count] : counts) sum += count;
        return sum;
    };
    EXPECT_EQ(report.pointsIn + sumOf(report.added), report.pointsOut + sumOf(report.dropped));
    const StoreDescription& d = store.description;
    EXPECT_EQ(d.pointsIn + sumOf(d.added), d.points + sumOf(d.dropped));
    EXPECT_EQ(d.pointsIn, report.pointsIn);
    EXPECT_EQ(d.points, report.pointsOut);
}

TEST(Rounds, WhatIsLeftOutAndWhatIsAddedIsCounted) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    // Faces without area, twice, of vertices that are not there or not finite.
    test::spit(folder / "a.ply",
               "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 7\nproperty list uchar int vertex_indices\nend_header\n"
               "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\nnan 0 0\n4 0 1 2 3\n3 0 1 4\n3 0 1 9\n3 0 1 1\n3 1 4 0\n3 0 1 5\n3 "
               "0 1 -1\n");
    const auto mesh = build(folder / "a.ply", folder / "a.stipple", *executor, {});
    ASSERT_TRUE(mesh) << mesh.error().line();
    EXPECT_EQ(mesh->pointsIn, 8u);
    EXPECT_EQ(mesh->pointsOut, 3u);
    EXPECT_EQ(mesh->dropped.size(), 4u);
    expectBalance(*mesh, *openStore(folder / "a.stipple"));
    // Curves with vertices twice, not finite, alone; a ribbon that twists, and a segment many times as long as others.
    CurveSet set;
    const double nan = std::nan("");
    const auto add = [&](std::initializer_list<glm::dvec3> places, bool ribbon) {
        int i = 0;
        for (const glm::dvec3& p : places)
            set.addVertex(p, 0.1f, i++ % 2 == 0 ? glm::vec3(0, 1, 0) : glm::vec3(0, -1, 0.01f), 0);
        set.endCurve(ribbon);
    };
    add({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {2, nan, 0}, {3, 0, 0}}, false);
    add({{5, 0, 0}}, false);
    add({{6, 0, 0}, {6, 0, 0}}, false);
    add({{nan, 0, 0}, {nan, 0, 1}, {0, 0, nan}}, false);
    add({{0, 2, 0}, {1, 2, 0}, {2, 2, 0}}, true);
    for (int i = 0; i < 200; ++i) add({{0.01 * i, 3, 0}, {0.01 * i + 0.005, 3, 0.001}}, false);
    add({{0, 4, 0}, {2000, 4, 0}}, false);
    Progress silent(false);
    const auto curves = buildCurveStore(cleanSource(sourceOf(set), 0), folder / "b.stipple", {}, *executor, silent);
    ASSERT_TRUE(curves) << curves.error().line();
    EXPECT_EQ(curves->pointsIn, 4u + 0 + 1 + 2 + 2 + 200 + 1);
    EXPECT_EQ(curves->dropped.at("at vertices that repeat the one before"), 2u);
    EXPECT_EQ(curves->dropped.at("at vertices that are not finite"), 3u);
    EXPECT_GT(curves->added.at("where ribbons twist"), 0u);
    EXPECT_GT(curves->added.at("by dividing long ones"), 0u);
    const auto areOutliers = [](const std::string& note) { return note.find("OUTLIERS") != std::string::npos; };
    EXPECT_EQ(curves->notes.size(), 3u) << "curves without length and of one vertex, and the vertex far away";
    EXPECT_EQ(std::count_if(curves->notes.begin(), curves->notes.end(), areOutliers), 1);
    const Store store = *openStore(folder / "b.stipple");
    expectBalance(*curves, store);
    ASSERT_TRUE(verifyStore(store, *executor));
}

TEST(Rounds, NeitherMemoryNorThreadsNorTheOrderOfFacesShow) {
    const test::TempFolder folder;
    std::vector<Kind> all = kinds(folder);
    for (const Kind& kind : all) {
        const auto two = makeTbbExecutor(2);
        const auto whole = build(kind.input, folder / "whole.stipple", *two, {}, 1 << 26);
        ASSERT_TRUE(whole) << whole.error().line();
        EXPECT_EQ(whole->temporaryBytes, 0u);
        EXPECT_GE(whole->pointsOut, 490'000u);
        const std::string bytes = test::slurp(folder / "whole.stipple");
        const Store store = *openStore(folder / "whole.stipple");
        ASSERT_TRUE(verifyStore(store, *two));
        expectBalance(*whole, *openStore(folder / "whole.stipple"));
        if (kind.name == "mesh") test::writeGround(kind.input, 500, 5);
        for (const int threads : {1, 2, 5}) {
            const auto executor = makeTbbExecutor(threads);
            BuildLimits limits;
            limits.memoryBytes = kind.little + kind.aThread * static_cast<uint64_t>(threads - 1);
            const auto built = build(kind.input, folder / "other.stipple", *executor, limits);
            ASSERT_TRUE(built) << built.error().line();
            EXPECT_GT(built->temporaryBytes, 0u) << kind.name;
            EXPECT_LE(double(built->temporaryBytes), 1.2 * double(fs::file_size(kind.input))) << kind.name;
            EXPECT_TRUE(test::slurp(folder / "other.stipple") == bytes) << kind.name << ", " << threads << " threads";
            EXPECT_FALSE(fs::exists(folder / "other.stipple.build"));
        }
    }
}

TEST(Rounds, FacesInRandomOrderTakeNoMoreRoomOnTheDisk) {
    const test::TempFolder folder;
    // Without normals nothing is as large as what has to travel: vertices that do not fit in memory, on disk, and
    // triangles that share hardly any.
    test::writeGround(folder / "ground.ply", 500, 7, false);
    const auto whole = makeTbbExecutor(2), serial = makeSerialExecutor();
    ASSERT_TRUE(build(folder / "ground.ply", folder / "whole.stipple", *whole, {}, 1 << 26));
    BuildLimits limits;
    limits.memoryBytes = uint64_t{190} << 20;
    uint64_t most = 0;
    limits.isStopped = [&] {  // what really lies there
        uint64_t bytes = 0;
        std::error_code gone;
        for (const auto& entry : fs::directory_iterator(folder / "a.stipple.build", gone))
            bytes += entry.file_size(gone);
        most = std::max(most, bytes);
        return false;
    };
    const auto built = build(folder / "ground.ply", folder / "a.stipple", *serial, limits, 1 << 20);
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_TRUE(test::slurp(folder / "whole.stipple") == test::slurp(folder / "a.stipple"));
    const auto input = double(fs::file_size(folder / "ground.ply"));
    EXPECT_LE(double(built->temporaryBytes), 1.2 * input);
    EXPECT_GT(double(built->temporaryBytes), 0.8 * input) << "not the worst case any more";
    const uint64_t vertices = 500 * 500 * 16;
    EXPECT_LE(most + vertices, built->temporaryBytes + built->temporaryBytes / 20) << "said less than there was";
}

TEST(Rounds, KilledAtAnyMomentTheyGoOnAndEndWithTheSameBytes) {
    const test::TempFolder folder;
    for (const Kind& kind : kinds(folder)) {
        // (A PLY file gets a quarter of the memory for its vertices.)
        const std::vector<std::string> command{STIPPLE_PROGRAM,
                                               "build",
                                               kind.input,
                                               "-o",
                                               folder / "a.stipple",
                                               "--memory",
                                               kind.name == "mesh" ? "350M" : "230M",
                                               "--threads",
                                               "2",
                                               "--quiet"};
        const double start = nowSeconds();
        ASSERT_TRUE(test::runAndKill(command, 600'000, SIGKILL)) << kind.name;
        const double took = (nowSeconds() - start) * 1e3;  // of which cells take a third at least
        const std::string whole = test::slurp(folder / "a.stipple");
        fs::remove(folder / "a.stipple");
        Rng rng(5);
        int kills = 0, resumable = 0, finished = 0;
        const int wanted = test::isThorough() ? 20 : 6;
        while (kills < wanted) {
            kills += test::runAndKill(command, static_cast<int>(took * rng.uniform(0.05, 1)), SIGKILL) ? 0 : 1;
            resumable += fs::exists(folder / "a.stipple.partial") ? 1 : 0;
            if (!fs::exists(folder / "a.stipple")) continue;
            ++finished;
            ASSERT_TRUE(test::slurp(folder / "a.stipple") == whole) << kind.name;
            fs::remove(folder / "a.stipple");
        }
        EXPECT_GT(resumable, wanted / 6) << kind.name;
        ASSERT_TRUE(test::runAndKill(command, 600'000, SIGKILL));
        EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole) << kind.name;
        EXPECT_FALSE(fs::exists(folder / "a.stipple.build"));
        std::printf("%s: %d kills, %d of them while cells were built, %d builds finished in between\n",
                    kind.name.c_str(), kills, resumable, finished);
        fs::remove(folder / "a.stipple");
    }
}

TEST(Rounds, CarryOnFromTheJournalAndNotFromTheStart) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    for (const Kind& kind : kinds(folder)) {
        BuildLimits limits;
        limits.memoryBytes = kind.little;
        ASSERT_TRUE(build(kind.input, folder / "whole.stipple", *executor, limits));
        const std::string partial = folder / "a.stipple.partial";
        int asked = 0, cells = 0, stopAt = 2;
        limits.isStopped = [&] {
            ++asked;
            return fs::exists(partial) && ++cells == stopAt;
        };
        int run = 0;
        for (;; ++run) {
            ASSERT_LT(run, 200);
            asked = cells = 0;
            const auto built = build(kind.input, folder / "a.stipple", *executor, limits);
            if (built) {
                EXPECT_TRUE(built->isResumed);
                break;
            }
            EXPECT_EQ(built.error().kind, ErrorKind::interrupted) << built.error().line();
            if (run > 0) EXPECT_LT(asked, 4) << "input was read again";
        }
        EXPECT_GT(run, 4) << kind.name;
        EXPECT_TRUE(test::slurp(folder / "a.stipple") == test::slurp(folder / "whole.stipple")) << kind.name;
        // What somebody changed is not built from: chunks, what waits for a cell, the input of a subtree.
        const auto interrupt = [&](int at) {
            fs::remove(folder / "a.stipple");
            fs::remove(partial);
            fs::remove_all(folder / "a.stipple.build");
            cells = 0;
            stopAt = at;
            EXPECT_FALSE(build(kind.input, folder / "a.stipple", *executor, limits));
            stopAt = 1 << 30;
        };
        const auto spoil = [&](const std::string& beginning) {
            for (const auto& entry : fs::directory_iterator(folder / "a.stipple.build")) {
                if (!entry.path().filename().string().starts_with(beginning)) continue;
                std::string bytes = test::slurp(entry.path());
                bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
                test::spit(entry.path(), bytes);
            }
        };
        const auto isRefused = [&](const char* what) {
            const auto built = build(kind.input, folder / "a.stipple", *executor, limits);
            ASSERT_FALSE(built) << kind.name << ", " << what;
            EXPECT_NE(built.error().line().find("is not what was written"), std::string::npos) << built.error().line();
            EXPECT_FALSE(fs::exists(folder / "a.stipple"));
        };
        interrupt(4);
        std::string bytes = test::slurp(partial);
        ASSERT_GT(bytes.size(), 10'000u);
        bytes[5000] = static_cast<char>(bytes[5000] ^ 1);
        test::spit(partial, bytes);
        isRefused("chunks");
        interrupt(4);
        spoil("up-");
        isRefused("what goes up");
        interrupt(2);
        spoil("in-");
        isRefused("input");
        // Killed when the store was whole and the folder not yet gone: there is nothing to go on with.
        interrupt(4);
        fs::remove(partial);
        const auto again = build(kind.input, folder / "a.stipple", *executor, limits);
        ASSERT_TRUE(again) << again.error().line();
        EXPECT_TRUE(test::slurp(folder / "a.stipple") == test::slurp(folder / "whole.stipple")) << kind.name;
        // Another input is refused as long as an interrupted build lies there.
        interrupt(4);
        fs::last_write_time(kind.input, fs::last_write_time(kind.input) + std::chrono::seconds(5));
        const auto other = build(kind.input, folder / "a.stipple", *executor, limits);
        ASSERT_FALSE(other);
        EXPECT_NE(other.error().line().find("interrupted build of other input"), std::string::npos);
        fs::remove_all(folder / "a.stipple.build");
        fs::remove(partial);
        fs::remove(folder / "a.stipple");
    }
}

TEST(Rounds, StayWithinTheirMemoryAndLoseNothingOnAFullDisk) {
    const test::TempFolder folder;
    test::writeGround(folder / "ground.ply", 1000, 3);  // 2 million triangles
    test::writeLawn(folder / "lawn.hair", 100'000);
    for (const auto& [input, memory] : {std::pair{"ground.ply", 400}, std::pair{"lawn.hair", 250}}) {
        const std::string command = fmt::format("build {} -o {} --memory {}M --threads 2 --quiet --json",
                                                folder / input, folder / "a.stipple", memory);
        ASSERT_EQ(test::shell("true", command, folder.path()), 0) << test::slurp(folder / "err");
        const auto report = nlohmann::json::parse(test::slurp(folder / "out"));
        if (!test::isSanitized) EXPECT_LT(report["peak_rss_bytes"].get<double>(), memory * 1048576.0) << input;
        EXPECT_GT(report["temporary_bytes"].get<double>(), 0) << input;
        EXPECT_LE(report["temporary_bytes"].get<double>(), 1.2 * double(fs::file_size(folder / input))) << input;
        const std::string whole = test::slurp(folder / "a.stipple");
        fs::remove(folder / "a.stipple");
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        EXPECT_EQ(test::shell("ulimit -v 524288", command, folder.path()), 0) << test::slurp(folder / "err");
        EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole);
        fs::remove(folder / "a.stipple");
#endif
        // A limit on the size of files acts as a disk that is full: of what goes between first, then of the store.
        for (const int kibibytes : {100, 6000}) {
            EXPECT_EQ(test::shell(fmt::format("ulimit -f {}", kibibytes), command, folder.path()), 4);
            const std::string line = test::slurp(folder / "err");
            EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
            EXPECT_NE(line.find("cannot be written"), std::string::npos) << line;
            EXPECT_FALSE(fs::exists(folder / "a.stipple"));
        }
        ASSERT_EQ(test::shell("true", command, folder.path()), 0) << test::slurp(folder / "err");
        EXPECT_TRUE(test::slurp(folder / "a.stipple") == whole);
        // Too little is said before anything is done.
        EXPECT_EQ(test::shell("true", fmt::format("build {} -o {} --memory 64M", folder / input, folder / "b.stipple"),
                              folder.path()),
                  static_cast<int>(ErrorKind::budget));
        EXPECT_NE(test::slurp(folder / "err").find("give --memory"), std::string::npos);
        fs::remove(folder / "a.stipple");
    }
}

TEST(Rounds, OddMeshesAreBuiltInFull) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto buildOf = [&](TriangleMesh mesh) {
        MeshBuildSettings settings;
        settings.description.materials.resize(1);
        Progress silent(false);
        return buildMeshStore(sourceOf(std::move(mesh)), folder / "odd.stipple", settings, *executor, silent);
    };
    const auto add = [](TriangleMesh& mesh, const glm::dvec3& at, double size) {
        const auto first = static_cast<uint32_t>(mesh.position.size());
        for (const glm::dvec3& corner : {glm::dvec3(0), glm::dvec3(size, 0, 0), glm::dvec3(0, size, 0.3 * size)})
            mesh.position.push_back(at + corner);
        mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 2});
    };
    // One triangle half a million times, and another far away: what is twice is dropped and counted.
    TriangleMesh same;
    for (int i = 0; i < 500'000; ++i) add(same, {3, 4, 5}, 0.01);
    add(same, {900, 1, 1}, 0.01);
    const auto once = buildOf(same);
    ASSERT_TRUE(once) << once.error().line();
    EXPECT_EQ(once->pointsOut, 2u);
    EXPECT_EQ(once->dropped.at("duplicate triangles"), 499'999u);
    // A corridor, and leaves that nothing can simplify: everything is there, and drawn whatever the distance.
    TriangleMesh leaves;
    Rng rng(2);
    for (int i = 0; i < 300'000; ++i)
        add(leaves, {1000 * rng.uniform(), rng.uniform(), rng.uniform()}, 0.002 + 0.01 * rng.uniform());
    const auto built = buildOf(leaves);
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->pointsOut, 300'000u);
    ASSERT_EQ(built->notes.size(), 1u);
    EXPECT_NE(built->notes[0].find("cannot be simplified"), std::string::npos);
    const Store store = *openStore(folder / "odd.stipple");
    ASSERT_TRUE(verifyStore(store, *executor));
    // Half a million different triangles with one centre are more than a cell can hold: said, nothing written.
    TriangleMesh star;
    for (int i = 0; i < 500'000; ++i) {
        const glm::dvec3 d(1 + 0.5 * rng.uniform(), rng.normal(), rng.normal()), e(rng.normal(), 1, rng.normal());
        const auto first = static_cast<uint32_t>(star.position.size());
        for (const glm::dvec3& p : {d, e, -d - e}) star.position.push_back(p);
        star.indices.insert(star.indices.end(), {first, first + 1, first + 2});
    }
    fs::remove(folder / "odd.stipple");
    const auto refused = buildOf(star);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("centre at one place"), std::string::npos) << refused.error().line();
    EXPECT_FALSE(fs::exists(folder / "odd.stipple"));
    // Nothing at all, and nothing with an area.
    EXPECT_FALSE(buildOf({}));
    TriangleMesh flat;
    for (int i = 0; i < 10; ++i) add(flat, {1, 2, 3}, 0);
    EXPECT_FALSE(buildOf(flat));
}

}  // namespace
}  // namespace stipple::lod
