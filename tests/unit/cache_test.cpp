// The cache of scenes built from raw inputs: never a wrong one, never a stuck one, never too much.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "engine/base/lock_file.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

struct Outcome {
    int code = -1;
    std::string text;  ///< standard output and error
};

/// A folder of a test with a cache of its own.
class Place {
  public:
    Outcome run(const std::string& arguments, const std::string& environment = "") const {
        const std::string command = "cd " + folder.path() + " && " + environment + " XDG_CACHE_HOME=" + folder.path() +
                                    "/cache " + STIPPLE_PROGRAM + " " + arguments + " 2>&1";
        Outcome r;
        FILE* pipe = ::popen(command.c_str(), "r");
        std::array<char, 4096> buffer{};
        while (const size_t got = std::fread(buffer.data(), 1, buffer.size(), pipe)) r.text.append(buffer.data(), got);
        const int status = ::pclose(pipe);
        r.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
        return r;
    }
    Outcome render(const std::string& arguments, const std::string& environment = "") const {
        return run("render " + arguments + " -o o.png --size 64x48 --device cpu", environment);
    }
    /// Was anything built?
    bool builds(const std::string& arguments, const std::string& environment = "") const {
        const Outcome r = render(arguments, environment);
        EXPECT_EQ(r.code, 0) << r.text;
        return r.text.find("built into the cache") != std::string::npos;
    }
    nlohmann::json list() const {
        const Outcome r = run("cache list --json");
        EXPECT_EQ(r.code, 0) << r.text;
        return nlohmann::json::parse(r.text);
    }
    size_t entries() const { return list()["entries"].size(); }
    std::string onlyStore() const {
        const auto j = list();
        EXPECT_EQ(j["entries"].size(), 1u);
        return j["entries"][0]["path"];
    }
    void growScan(const std::string& name, int points = 3000) const {
        ASSERT_EQ(run("grow scan -o " + name + " --points " + std::to_string(points)).code, 0);
    }
    std::string operator/(const std::string& name) const { return folder / name; }
    const test::TempFolder folder;
};

/// A triangle; its buffer and a picture lie beside it.
void writeScene(const Place& place) {
    std::ofstream(place / "t.gltf") << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"t%2Ebin"}],
        "images":[{"uri":"t.png"}],"textures":[{"source":0}]})";
}
void writeBuffer(const Place& place, float x) {
    const std::array<float, 9> corners{0, 0, 0, 1, 0, 0, x, 1, 0};
    test::spit(place / "t.bin", std::string(reinterpret_cast<const char*>(corners.data()), sizeof(corners)));
}

TEST(Cache, IsServedForTheSameSettingsOnly) {
    const Place place;
    place.growScan("a.las");
    EXPECT_TRUE(place.builds("a.las"));
    EXPECT_FALSE(place.builds("a.las"));
    EXPECT_FALSE(place.builds("a.las --memory 1G --threads 2")) << "they do not change a byte";
    EXPECT_TRUE(place.builds("a.las --drop-outliers"));
    EXPECT_TRUE(place.builds("a.las --skip-bad"));
    EXPECT_EQ(place.entries(), 3u);
}

TEST(Cache, HoldsAllAttributesOfAScanInOneStore) {
    const Place place;
    place.growScan("a.las");
    EXPECT_TRUE(place.builds("a.las"));
    for (const char* colour : {"intensity", "class", "return", "height", "normal"})
        EXPECT_FALSE(place.builds(std::string("a.las --colour ") + colour)) << colour;
    EXPECT_EQ(place.entries(), 1u);
    const Outcome none = place.render("a.las --attributes nothing");
    EXPECT_EQ(none.code, 2) << none.text;
    EXPECT_NE(none.text.find("has no attribute 'nothing'"), std::string::npos) << none.text;
    EXPECT_EQ(place.render("a.las --colour nothing").code, 2);
}

TEST(Cache, FollowsTheFilesThatASceneIsMadeOf) {
    const Place place;
    writeScene(place);
    writeBuffer(place, 0);
    place.growScan("a.las", 100);
    EXPECT_EQ(place.run("render a.las -o t.png --size 8x8 --device cpu").code, 0);
    EXPECT_TRUE(place.builds("t.gltf"));
    EXPECT_FALSE(place.builds("t.gltf"));
    const auto time = fs::last_write_time(place / "t.bin");
    writeBuffer(place, 1);
    fs::last_write_time(place / "t.bin", time);
    EXPECT_TRUE(place.builds("t.gltf")) << "the same size and time, but other triangles";
    EXPECT_EQ(place.run("render a.las -o t.png --size 16x8 --device cpu --background 0,0,0").code, 0);
    EXPECT_TRUE(place.builds("t.gltf")) << "another picture";
    EXPECT_FALSE(place.builds("t.gltf"));
    std::ofstream(place / "m.obj") << "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::ofstream(place / "m.mtl") << "newmtl m\nKd 1 0 0\n";
    EXPECT_TRUE(place.builds("m.obj"));
    EXPECT_FALSE(place.builds("m.obj"));
    std::ofstream(place / "m.mtl") << "newmtl m\nKd 0 0 1\n";
    EXPECT_TRUE(place.builds("m.obj")) << "its materials changed";
    std::ofstream(place / "m.mtl") << "newmtl m\nKd 0 0 1\nmap_Kd m.png\n";
    EXPECT_TRUE(place.builds("m.obj"));
    std::ofstream(place / "m.png") << "no picture yet";
    place.render("m.obj");  // (it may well be refused)
    fs::remove(place / "m.png");
    EXPECT_FALSE(place.builds("m.obj")) << "as it was";
}

TEST(Cache, ADamagedStoreIsBuiltAgain) {
    const Place place;
    place.growScan("a.las");
    EXPECT_TRUE(place.builds("a.las"));
    const std::string store = place.onlyStore(), whole = test::slurp(store);
    const std::string picture = test::slurp(place / "o.png");
    const auto expectRebuilt = [&](const std::string& bytes, const char* what) {
        test::spit(store, bytes);
        const Outcome r = place.render("a.las");
        EXPECT_EQ(r.code, 0) << what << r.text;
        EXPECT_NE(r.text.find("is built again"), std::string::npos) << what << r.text;
        EXPECT_EQ(test::slurp(store), whole) << what;
        EXPECT_EQ(test::slurp(place / "o.png"), picture) << what;
    };
    expectRebuilt(whole.substr(0, whole.size() / 2), "truncated");
    expectRebuilt("", "empty");
    std::string older = whole;
    older[8] = static_cast<char>(older[8] - 1);
    expectRebuilt(older, "of another version, or not the format");
    EXPECT_FALSE(place.builds("a.las"));
}

/// Builds through temporary files until its first part is done, and is killed there. Then every temporary file changes.
void leaveDamaged(const test::TempFolder& folder, const std::vector<std::string>& arguments, const std::string& temp) {
    std::string partial;
    const std::string cache = folder / ".cache/stipple";
    test::RunningProgram killed(folder, arguments);
    ASSERT_TRUE(killed.await([&] {
        std::error_code error;
        for (const auto& entry : fs::directory_iterator(cache, error))
            if (entry.path().extension() == ".partial") partial = entry.path();
        return !partial.empty();
    }));
    killed.signal(SIGKILL);
    EXPECT_EQ(killed.end().code, 128 + SIGKILL);
    const fs::path store = fs::path(partial).replace_extension();
    size_t changed = 0;
    for (const auto& entry : fs::directory_iterator(temp + "/" + store.filename().string() + ".build")) {
        if (entry.path().filename() == "journal" || entry.file_size() < 16) continue;
        std::string bytes = test::slurp(entry.path());
        bytes[10] = static_cast<char>(bytes[10] ^ 1);
        test::spit(entry.path(), bytes);
        ++changed;
    }
    ASSERT_GT(changed, 0u);
}

TEST(Cache, WhatAnInterruptedBuildLeftDamagedIsBuiltAgain) {
    const test::TempFolder folder;
    fs::create_directory(folder / "tmp");
    ASSERT_EQ(test::runProgram(folder, "grow scan -o a.las --points 900000").code, 0);
    for (const bool isElsewhere : {false, true}) {
        std::string line;
        std::vector<std::string> arguments{"render",   "a.las", "-o",       "o.png", "--size",    "64x48",
                                           "--device", "cpu",   "--memory", "150M",  "--threads", "2"};
        if (isElsewhere) arguments.insert(arguments.end(), {"--temp", folder / "tmp"});
        for (const std::string& argument : arguments) line += argument + " ";
        leaveDamaged(folder, arguments, folder / (isElsewhere ? "tmp" : ".cache/stipple"));
        if (HasFatalFailure()) return;
        const test::Outcome again = test::runProgram(folder, line);
        EXPECT_EQ(again.code, 0) << again.err;
        EXPECT_NE(again.err.find("what an interrupted build left cannot be used"), std::string::npos) << again.err;
        EXPECT_EQ(again.err.find("--restart"), std::string::npos) << again.err;
        size_t left = 0;
        for (const auto& entry : fs::recursive_directory_iterator(folder / ".cache/stipple"))
            left += entry.path().filename().string().find(".stipple.") != std::string::npos ? 1 : 0;
        EXPECT_EQ(left, 0u);
        EXPECT_TRUE(fs::is_empty(folder / "tmp"));
        EXPECT_EQ(test::runProgram(folder, "cache clean").code, 0);
    }
}

TEST(Cache, ALeftoverThatIsNoBuildIsReplacedToo) {
    const test::TempFolder folder;
    ASSERT_EQ(test::runProgram(folder, "grow scan -o a.las --points 900000").code, 0);
    const std::string line = "render a.las -o o.png --size 64x48 --device cpu --memory 150M --threads 2";
    ASSERT_EQ(test::runProgram(folder, line).code, 0);
    for (const auto& entry : fs::directory_iterator(folder / ".cache/stipple")) {
        if (entry.path().extension() != ".stipple") continue;
        const std::string work = entry.path().string() + ".build";
        fs::remove(entry.path());
        fs::create_directory(work);
        test::spit(work + "/journal", std::string(4096, '\0'));  // as a crash of the machine may leave it
        break;
    }
    const test::Outcome again = test::runProgram(folder, line);
    EXPECT_EQ(again.code, 0) << again.err;
    EXPECT_NE(again.err.find("what an interrupted build left cannot be used"), std::string::npos) << again.err;
}

TEST(Cache, WhatIsRefusedLeavesNothing) {
    const Place place;
    std::ofstream(place / "cut.las") << "LASF and no more";
    std::ofstream(place / "empty.ply");
    for (const char* input : {"cut.las", "empty.ply", "nosuch.las"}) EXPECT_EQ(place.render(input).code, 3) << input;
    EXPECT_EQ(place.entries(), 0u);
}

TEST(Cache, OneOfTwoProcessesWaitsForTheOther) {
    const Place place;
    place.growScan("a.las", 200000);
    // A third one that seems to be building: both of the others have to wait for it, whatever the machine's speed.
    EXPECT_TRUE(place.builds("a.las"));
    const std::string store = place.onlyStore(), key = fs::path(store).stem();
    fs::remove(store);
    auto locks = LockFile::open(place / "cache/stipple/locks");
    ASSERT_TRUE(locks.has_value());
    const uint64_t build = (std::stoull(key, nullptr, 16) >> 2 & ~uint64_t{1}) + 1;
    ASSERT_TRUE(locks->tryTake(build));
    std::array<Outcome, 2> outcomes;
    std::vector<std::thread> both;
    for (size_t i = 0; i < 2; ++i)
        both.emplace_back([&, i] {
            outcomes.at(i) = place.run("render a.las -o o" + std::to_string(i) + ".png --size 64x48 --device cpu >err" +
                                       std::to_string(i));
        });
    const auto waits = [&](int i) {
        return test::slurp(place / ("err" + std::to_string(i))).find("being built already") != std::string::npos;
    };
    const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    for (const int i : {0, 1})
        while (!(fs::exists(place / ("err" + std::to_string(i))) && waits(i)) &&
               std::chrono::steady_clock::now() < until)
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_FALSE(fs::exists(store));
    locks->release(build);
    for (std::thread& thread : both) thread.join();
    size_t built = 0;
    for (const int i : {0, 1}) {
        EXPECT_EQ(outcomes.at(static_cast<size_t>(i)).code, 0);
        const std::string said = test::slurp(place / ("err" + std::to_string(i)));
        built += said.find("built into the cache") != std::string::npos ? 1 : 0;
    }
    EXPECT_EQ(built, 1u);
    EXPECT_EQ(test::slurp(place / "o0.png"), test::slurp(place / "o1.png"));
    EXPECT_EQ(place.entries(), 1u);
}

TEST(Cache, ListsAndCleans) {
    const Place place;
    EXPECT_EQ(place.entries(), 0u);
    EXPECT_FALSE(fs::exists(place / "cache/stipple")) << "looking makes nothing";
    EXPECT_EQ(place.run("cache clean").code, 0);
    for (const char* name : {"a.las", "b.las", "c.las"}) {
        place.growScan(name);
        EXPECT_TRUE(place.builds(name));
    }
    EXPECT_FALSE(place.builds("a.las")) << "and is now the last used";
    test::spit(place / "cache/stipple/notes.txt", "somebody else's");
    fs::create_directories(place / "cache/stipple/pipelines");
    test::spit(place / "cache/stipple/pipelines/0.bin", "what a driver compiled");
    const auto j = place.list();
    ASSERT_EQ(j["entries"].size(), 3u);
    EXPECT_EQ(j["entries"][0]["inputs"][0], place / "a.las");
    EXPECT_EQ(j["entries"][1]["inputs"][0], place / "c.las");
    EXPECT_EQ(j["entries"][0]["part"], "points");
    EXPECT_TRUE(j["entries"][0]["complete"]);
    EXPECT_FALSE(j["entries"][0]["in_use"]);
    EXPECT_GE(j["entries"][0]["bytes"].get<uint64_t>(), fs::file_size(j["entries"][0]["path"].get<std::string>()));
    const Outcome table = place.run("cache list");
    EXPECT_NE(table.text.find("b.las (points)"), std::string::npos) << table.text;
    EXPECT_NE(table.text.find("3 scenes"), std::string::npos) << table.text;

    EXPECT_EQ(place.run("cache clean --older 1").code, 0);
    EXPECT_EQ(place.entries(), 3u);
    const uint64_t size = j["entries"][0]["bytes"];
    EXPECT_EQ(place.run("cache clean --to " + std::to_string(2 * size + size / 2)).code, 0);
    const auto rest = place.list();
    ASSERT_EQ(rest["entries"].size(), 2u);
    EXPECT_EQ(rest["entries"][1]["inputs"][0], place / "c.las") << "b was used least recently";
    EXPECT_TRUE(fs::exists(place / "cache/stipple/pipelines/0.bin"));
    EXPECT_EQ(place.run("cache clean --to potato").code, 2);
    EXPECT_EQ(place.run("cache clean --older 1 --to 1G").code, 2);
    EXPECT_EQ(place.run("cache clean").code, 0);
    EXPECT_EQ(place.entries(), 0u);
    EXPECT_FALSE(fs::exists(place / "cache/stipple/pipelines"));
    EXPECT_EQ(test::slurp(place / "cache/stipple/notes.txt"), "somebody else's");
}

TEST(Cache, WhatIsInUseStays) {
    const Place place;
    place.growScan("a.las");
    EXPECT_TRUE(place.builds("a.las"));
    const std::string key = fs::path(place.onlyStore()).stem();
    {
        auto viewer = LockFile::open(place / "cache/stipple/locks");
        ASSERT_TRUE(viewer.has_value());
        ASSERT_TRUE(viewer->tryShare(std::stoull(key, nullptr, 16) >> 2 & ~uint64_t{1}));
        EXPECT_TRUE(place.list()["entries"][0]["in_use"]);
        EXPECT_EQ(place.run("cache clean").code, 0);
        EXPECT_EQ(place.entries(), 1u);
    }
    EXPECT_EQ(place.run("cache clean").code, 0) << "a dead one holds nothing";
    EXPECT_EQ(place.entries(), 0u);
}

TEST(Cache, KeepsToItsLimit) {
    const Place place;
    for (const char* name : {"a.las", "b.las", "c.las"}) place.growScan(name);
    EXPECT_TRUE(place.builds("a.las"));
    const uint64_t size = place.list()["bytes"];
    const std::string two = std::to_string(2 * size + size / 2);
    EXPECT_TRUE(place.builds("b.las --cache-limit " + two));
    EXPECT_EQ(place.entries(), 2u);
    EXPECT_FALSE(place.builds("a.las"));
    const Outcome third = place.render("c.las", "STIPPLE_CACHE_LIMIT=" + two);
    EXPECT_NE(third.text.find("--cache-limit"), std::string::npos) << third.text;
    EXPECT_EQ(place.entries(), 2u);
    EXPECT_FALSE(place.builds("a.las")) << "b was used least recently";
    EXPECT_TRUE(place.builds("b.las --cache-limit 1")) << "what was just made stays";
    EXPECT_EQ(place.entries(), 1u);
    EXPECT_FALSE(place.builds("b.las"));
    EXPECT_EQ(place.render("b.las", "STIPPLE_CACHE_LIMIT=potato").code, 2);
}

TEST(Cache, SaysWhatIsWrongWithItsFolder) {
    const Place place;
    place.growScan("a.las");
    std::ofstream(place / "cache") << "a file";
    const Outcome r = place.render("a.las");
    EXPECT_EQ(r.code, 4) << r.text;
    EXPECT_NE(r.text.find("XDG_CACHE_HOME"), std::string::npos) << r.text;
    fs::remove(place / "cache");
    const Outcome full = place.render("a.las", "ulimit -f 16; trap '' XFSZ;");
    EXPECT_EQ(full.code, 4) << full.text;
    EXPECT_NE(full.text.find("stipple cache clean"), std::string::npos) << full.text;
    EXPECT_TRUE(place.builds("a.las")) << "and it works when there is room";
}

TEST(Cache, RepeatsWhatTheBuildSaid) {
    const Place place;
    place.growScan("a.las");
    for (const bool isFirst : {true, false}) {
        const Outcome r = place.render("a.las a.las");
        EXPECT_EQ(r.text.find("built into the cache") != std::string::npos, isFirst);
        EXPECT_NE(r.text.find("note: a.las: is named more than once"), std::string::npos) << r.text;
    }
}

}  // namespace
}  // namespace stipple
