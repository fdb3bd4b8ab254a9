// The library where a host has threads, listens, stops, and has less memory than a view wants.
#include <stipple/c.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <set>
#include <thread>
#include <vector>

#include "tests/unit/api.h"

namespace {

namespace fs = std::filesystem;
using stipple::ErrorKind;
using stipple_test::Api;

/// Runs `work(i)` on so many threads at once.
template <typename Work>
void together(size_t threads, const Work& work) {
    std::vector<std::thread> all;
    for (size_t i = 0; i < threads; ++i) all.emplace_back([&work, i] { work(i); });
    for (std::thread& thread : all) thread.join();
}

class ApiThreads : public Api {
  protected:
    /// A triangle, as a scene of two files.
    std::string writeTriangle(const std::string& name) const {
        {
            std::ofstream bin(at(name + ".bin"), std::ios::binary);
            const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
            bin.write(reinterpret_cast<const char*>(corners), sizeof corners);
        }
        std::ofstream(at(name + ".gltf"))
            << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
            << R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
            << R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],)"
            << R"("max":[1,1,0]}],"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":")"
            << name << R"(.bin"}]})";
        return at(name + ".gltf");
    }
    /// A ball of points as an OpenVDB file.
    std::string writeVdb(const std::string& name) const {
        const std::string command = std::string(STIPPLE_PROGRAM) + " convert " + writeBall("of_" + name + ".ply") +
                                    " -o " + at(name) + " >" + at("said");
        EXPECT_EQ(std::system(command.c_str()), 0);
        return at(name);
    }
    /// Descriptors of this process that are of files without a name.
    static std::ptrdiff_t namelessFiles() {
        std::error_code error;
        const fs::directory_iterator all("/proc/self/fd");
        return std::count_if(begin(all), end(all), [&](const fs::directory_entry& e) {
            return fs::read_symlink(e.path(), error).string().find("stipple-vdb") != std::string::npos;
        });
    }
};

/// Both wait for one build: the second finds what the first has made.
TEST_F(ApiThreads, OneOfTwoThatOpenAScanBuildsIt) {
    const std::string ball = writeBall("shared.ply");
    std::atomic<int> built{0}, opened{0};
    together(4, [&](size_t) {
        stipple::OpenSettings s;
        s.listener.note = [&](const std::string& line) {
            if (line.find("built into the cache") != std::string::npos) ++built;
        };
        const auto scene = stipple::Scene::open({ball}, s);
        if (scene) ++opened;
    });
    EXPECT_EQ(opened, 4);
    EXPECT_EQ(built, 1);
}

TEST_F(ApiThreads, SceneFilesAreOpenedAtOnce) {
    const std::string same = writeTriangle("same");
    const std::vector<std::string> own{writeTriangle("a"), writeTriangle("b"), writeTriangle("c"), writeTriangle("d")};
    std::atomic<int> opened{0};
    together(4, [&](size_t i) {
        for (const std::string& path : {same, own[i], same})
            if (const auto scene = stipple::Scene::open({path})) ++opened;
    });
    EXPECT_EQ(opened, 12);
}

/// Each of a listener's calls comes while no other runs, whatever threads build.
TEST_F(ApiThreads, AListenerIsCalledByOneAtATime) {
    std::atomic<int> inside{0}, most{0}, asked{0};
    std::set<std::thread::id> threads;  // that called
    const auto call = [&] {
        const int now = ++inside;
        for (int before = most; before < now && !most.compare_exchange_weak(before, now);) {
        }
        if (now == 1) threads.insert(std::this_thread::get_id());
        std::this_thread::sleep_for(std::chrono::milliseconds(2));  // others come meanwhile
        --inside;
    };
    stipple::BuildSettings s;
    s.threads = 4;
    s.listener.progress = [&](const stipple::Progress&) { call(); };
    s.listener.note = [&](const std::string&) { call(); };
    s.listener.isStopped = [&] {
        call();
        ++asked;
        return false;
    };
    std::vector<std::string> balls;
    for (int i = 0; i < 12; ++i) balls.push_back(writeBall("heard" + std::to_string(i) + ".ply", 3 * i, 20000));
    const auto built = stipple::build(balls, at("heard.stipple"), s);
    EXPECT_TRUE(built) << built.error().line();
    EXPECT_GT(asked, 0);
    EXPECT_GT(threads.size(), 1u) << "(several threads have something to ask)";
    EXPECT_EQ(most, 1);
}

/// Who says it once need not say it again.
TEST_F(ApiThreads, AStopIsHeardWhereverACallIs) {
    const std::string vdb = writeVdb("stopped.vdb"), scan = writeBall("stopped.ply");
    for (const std::string& input : {vdb, scan}) {
        stipple::OpenSettings s;
        std::atomic<int> asked{0};
        s.listener.isStopped = [&] { return asked++ == 0; };
        const auto scene = stipple::Scene::open({input}, s);
        ASSERT_FALSE(scene) << input;
        EXPECT_EQ(scene.error().kind, ErrorKind::interrupted) << scene.error().line();
        EXPECT_EQ(asked, 1);
        EXPECT_TRUE(stipple::Scene::open({input})) << "and the next one is not";
    }
}

/// While another thread builds it, and never ends.
TEST_F(ApiThreads, AStopIsHeardWhileWaitingForABuild) {
    const std::string ball = writeBall("waited.ply");
    std::atomic<bool> isBuilding{false}, mayEnd{false}, isOver{false};
    std::thread builder([&] {
        stipple::OpenSettings s;
        s.listener.isStopped = [&] {
            isBuilding = true;
            while (!mayEnd) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            return false;
        };
        EXPECT_TRUE(stipple::Scene::open({ball}, s));
        isOver = true;
    });
    while (!isBuilding && !isOver) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    stipple::OpenSettings s;
    std::atomic<bool> hasWaited{false};
    s.listener.note = [&](const std::string& line) {
        hasWaited = hasWaited || line.find("waiting for it") != std::string::npos;
    };
    s.listener.isStopped = [&] { return hasWaited.load(); };
    const auto scene = stipple::Scene::open({ball}, s);
    mayEnd = true;
    builder.join();
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().kind, ErrorKind::interrupted) << scene.error().line();
    EXPECT_TRUE(hasWaited);
}

TEST_F(ApiThreads, WhatWasConvertedGoesWithTheCall) {
    const std::string vdb = writeVdb("kept.vdb");
    const auto scene = stipple::Scene::open({vdb});
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(namelessFiles(), 0);
}

/// A host without standard streams, whose pipes are numbers that the reader of OpenVDB files gets.
TEST_F(ApiThreads, AHostMayHaveClosedItsStandardStreams) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const std::string vdb = writeVdb("closed.vdb");
    const auto open = [&] {
        for (int descriptor = 0; descriptor < 4; ++descriptor) ::close(descriptor);
        const auto scene = stipple::Scene::open({vdb});
        fs::remove_all(folder_);
        fs::remove_all(std::getenv("XDG_CACHE_HOME"));
        ::_exit(scene ? 42 : static_cast<int>(scene.error().kind));
    };
    EXPECT_EXIT(open(), testing::ExitedWithCode(42), "");
}

/// The program ends with 6 there; renderFrame draws what fits.
TEST_F(ApiThreads, TooLittleMemoryIsAnErrorOfRender) {
    const auto opened = stipple::Scene::open({writeBall("tight.ply", 0, 100000)});
    ASSERT_TRUE(opened) << opened.error().line();
    const stipple::Scene& scene = *opened;
    const stipple::Device d = device();
    const auto camera = scene.overview(1);
    auto whole = renderer(d, scene);
    ASSERT_TRUE(whole.render(camera, 512, 512));
    const uint64_t wanted = whole.info().residentBytes;
    auto tight = stipple::Renderer::create(d, scene, wanted / 2);
    ASSERT_TRUE(tight);
    const auto image = tight->render(camera, 512, 512);
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().kind, ErrorKind::budget);
    EXPECT_NE(image.error().line().find("residentBytes"), std::string::npos) << image.error().line();
    EXPECT_FALSE(tight->info().isComplete);
    stipple::Image coarse;
    auto drawn = tight->renderFrame(camera, 512, 512, coarse);
    for (int f = 0; f < 200 && drawn && drawn->records == 0; ++f) drawn = tight->renderFrame(camera, 512, 512, coarse);
    ASSERT_TRUE(drawn) << drawn.error().line();
    EXPECT_FALSE(drawn->isComplete);
    EXPECT_GT(drawn->records, 0u);
    EXPECT_GT(drawn->errorPixels, 1);
    stipple_device* device = nullptr;  // in C
    stipple_scene* own = nullptr;
    stipple_renderer* small = nullptr;
    const std::string path = at("tight.ply");
    const char* const input = path.c_str();
    ASSERT_EQ(stipple_device_open("cpu", &device), 0);
    ASSERT_EQ(stipple_scene_open(&input, 1, &own), 0);
    ASSERT_EQ(stipple_renderer_create_sized(device, own, wanted / 2, &small), 0);
    stipple_camera eye{};
    ASSERT_EQ(stipple_scene_overview(own, 1, &eye), 0);
    std::vector<uint8_t> rgba(size_t{4} * 512 * 512);
    EXPECT_EQ(stipple_render(small, &eye, 512, 512, 1, rgba.data(), nullptr), static_cast<int>(ErrorKind::budget));
    stipple_renderer_destroy(small);
    stipple_scene_close(own);
    stipple_device_close(device);
    auto enough = stipple::Renderer::create(d, scene, wanted);
    EXPECT_TRUE(enough->render(camera, 512, 512)) << "the control";
}

}  // namespace
