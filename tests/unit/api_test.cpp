// The library as other programs see it: its public headers alone, linked to libstipple.so.
#include <stipple/c.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <sstream>
#include <thread>

#include "tests/unit/api.h"

namespace {

namespace fs = std::filesystem;
using stipple::ErrorKind;
using stipple_test::Api;

TEST_F(Api, DrawsThePicturesOfTheProgram) {
    const stipple::Scene scene = sceneOf("ball.ply");
    stipple::Renderer r = renderer(device(), scene);
    const auto image = r.render(scene.overview(160.0 / 90), 160, 90);
    ASSERT_TRUE(image) << image.error().line();
    ASSERT_TRUE(stipple::writeImage(at("own.png"), *image));
    const std::string command = std::string(STIPPLE_PROGRAM) + " render " + at("ball.ply") + " -o " +
                                at("program.png") + " --size 160x90 --device cpu --quiet";
    ASSERT_EQ(std::system(command.c_str()), 0);
    EXPECT_TRUE(bytesOf(at("own.png")) == bytesOf(at("program.png")));
    EXPECT_GT(bytesOf(at("own.png")).size(), 1000u);
    // The control: another mode is another picture.
    stipple::RenderSettings coarse;
    coarse.mode = "points";
    const auto other = r.render(scene.overview(160.0 / 90), 160, 90, coarse);
    ASSERT_TRUE(other);
    EXPECT_NE(other->rgba, image->rgba);
}

/// `*` and `->` without looking first end the program with the error's line, and not somewhere else later.
TEST_F(Api, AnErrorThatIsTakenForAValueSaysWhichOneItWas) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");  // (libraries have threads by now)
    EXPECT_DEATH((void)*stipple::Scene::open({"/nowhere/scan.laz"}), "stipple: /nowhere/scan.laz: No such file");
    const stipple::Result<int> none = stipple::Error{ErrorKind::input, "cut off", "a.las", ""};
    EXPECT_DEATH((void)*none, "stipple: a.las: cut off");
    stipple::Result<std::string> text = stipple::Error{ErrorKind::input, "cut off", "b.las", "copy it again"};
    EXPECT_DEATH((void)text->size(), "stipple: b.las: cut off .copy it again.");
    text = std::string("fine");
    EXPECT_EQ(text->size() + size_t(*stipple::Result<int>(3)), 7u);
}

/// A picture of a damaged store is not taken for one of a whole one.
TEST_F(Api, ChunksThatCannotBeReadAreAnErrorOfRender) {
    ASSERT_TRUE(stipple::build({writeBall("damaged.ply")}, at("damaged.stipple")));
    {
        std::fstream file(at("damaged.stipple"), std::ios::in | std::ios::out | std::ios::binary);
        const auto middle = std::filesystem::file_size(at("damaged.stipple")) / 2;
        for (uint64_t k = 0; k < 64; ++k) {
            file.seekg(static_cast<std::streamoff>(middle + k));
            const auto byte = static_cast<char>(file.get() ^ 0x55);
            file.seekp(static_cast<std::streamoff>(middle + k));
            file.put(byte);
        }
    }
    auto device = stipple::Device::open("cpu", 2);
    auto scene = stipple::Scene::open({at("damaged.stipple")});
    ASSERT_TRUE(device && scene);
    auto drawn = renderer(*device, *scene);
    const auto image = drawn.render(scene->overview(1), 256, 256);
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().kind, ErrorKind::input);
    EXPECT_NE(image.error().line().find("cannot be read"), std::string::npos) << image.error().line();
}

TEST_F(Api, WhatHasBeenMovedFromIsACopy) {
    auto opened = stipple::Device::open("cpu", 2);
    ASSERT_TRUE(opened);
    const stipple::Device device = std::move(*opened);
    EXPECT_EQ(opened->name(), device.name());
    stipple::Scene scene = sceneOf("moved.ply");
    const stipple::Scene other = std::move(scene);
    const auto here = renderer(*opened, scene).render(other.overview(1), 64, 64);
    const auto there = renderer(device, other).render(other.overview(1), 64, 64);
    ASSERT_TRUE(here && there);
    EXPECT_EQ(here->rgba, there->rgba);
}

TEST_F(Api, SeveralScenesAndRenderersShareADeviceAndEndInAnyOrder) {
    auto opened = stipple::Device::open("cpu", 2);
    ASSERT_TRUE(opened);
    auto d = std::make_unique<stipple::Device>(std::move(*opened));
    auto left = std::make_unique<stipple::Scene>(sceneOf("left.ply"));
    auto right = std::make_unique<stipple::Scene>(sceneOf("right.ply", 5));
    const stipple::Camera camera = left->overview(1);
    auto first = std::make_unique<stipple::Renderer>(renderer(*d, *left));
    auto second = std::make_unique<stipple::Renderer>(renderer(*d, *right));
    auto third = std::make_unique<stipple::Renderer>(renderer(*d, *left));
    const auto alone = first->render(camera, 64, 64);
    const auto elsewhere = second->render(camera, 64, 64);
    ASSERT_TRUE(alone && elsewhere);
    EXPECT_NE(alone->rgba, elsewhere->rgba);
    d.reset();
    left.reset();
    first.reset();
    const auto again = third->render(camera, 64, 64);
    ASSERT_TRUE(again) << again.error().line();
    EXPECT_EQ(again->rgba, alone->rgba);
    right.reset();
    third.reset();
    ASSERT_TRUE(second->render(camera, 64, 64));
}

TEST_F(Api, AnEnvironmentLightsAndIsSeenBehindWhereThatIsAskedFor) {
    {
        std::ofstream out(at("even.hdr"), std::ios::binary);
        out << "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n";
        for (int i = 0; i < 16 * 8; ++i) out << "\x80\x40\x20\x80";  // 1/2, 1/4, 1/8
    }
    const stipple::Scene scene = sceneOf("ball.ply");
    stipple::Renderer r = renderer(device(), scene);
    stipple::RenderSettings s;
    s.wantDepthAndNormal = true;
    s.environment = at("even.hdr");
    const auto corner = [&] {
        const auto image = r.render(scene.overview(1), 64, 64, s);
        EXPECT_TRUE(image) << image.error().line();
        return std::vector<float>(image->linear.begin(), image->linear.begin() + 3);
    };
    EXPECT_LT(corner()[0], 0.1f) << "the control";
    s.environmentIsBackground = true;
    const std::vector<float> behind = corner();
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(behind[k], 0.5f / static_cast<float>(1u << k), 1e-3f);
    s.environmentScale = 3;
    EXPECT_NEAR(corner()[0], 1.5f, 3e-3f) << "another scale is another picture";
    s.environment.clear();
    const auto none = r.render(scene.overview(1), 64, 64, s);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().kind, ErrorKind::usage);
    s.environment = at("none.hdr");
    EXPECT_FALSE(r.render(scene.overview(1), 64, 64, s));
}

TEST_F(Api, FramesGoOnUntilNothingIsMissing) {
    const stipple::Scene scene = sceneOf("ball.ply");
    stipple::Renderer r = renderer(device(), scene);
    stipple::Image image;
    stipple::FrameInfo info;
    // (By the clock: on a busy machine many frames may pass before a reading thread has its turn.)
    const auto begin = std::chrono::steady_clock::now();
    while (!info.isComplete && std::chrono::steady_clock::now() - begin < std::chrono::seconds(60)) {
        const auto drawn = r.renderFrame(scene.overview(1), 96, 96, image);
        ASSERT_TRUE(drawn) << drawn.error().line();
        info = *drawn;
    }
    ASSERT_TRUE(info.isComplete);
    EXPECT_LE(info.errorPixels, 1);
    const auto waited = r.render(scene.overview(1), 96, 96);
    ASSERT_TRUE(waited);
    EXPECT_EQ(image.rgba, waited->rgba);
}

TEST_F(Api, ASecondThreadIsRefusedOrWaitsForNobody) {
    const stipple::Device d = device();
    const stipple::Scene scene = sceneOf("ball.ply");
    const stipple::Camera camera = scene.overview(1);
    stipple::Renderer one = renderer(d, scene), two = renderer(d, scene);
    std::atomic<bool> isRefused{false}, isOther{false};
    const auto draw = [&](stipple::Renderer& r) {
        const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
        while (!isRefused && !isOther && std::chrono::steady_clock::now() < until) {
            const auto image = r.render(camera, 64, 64);
            if (!image) (image.error().kind == ErrorKind::usage ? isRefused : isOther) = true;
        }
    };
    std::thread beside([&] { draw(two); });
    draw(one);
    beside.join();
    EXPECT_TRUE(isRefused);
    EXPECT_FALSE(isOther);
    EXPECT_TRUE(one.render(camera, 64, 64));
    // It ends while another draws.
    std::thread drawing([&] { (void)one.render(camera, 640, 640); });
    { const stipple::Renderer gone = std::move(two); }
    drawing.join();
    EXPECT_TRUE(one.render(camera, 64, 64));
}

TEST_F(Api, WhatFailsIsAValue) {
    const auto kindOf = [](const auto& result) {
        EXPECT_FALSE(result.error().what.empty());
        return result ? ErrorKind::interrupted : result.error().kind;
    };
    EXPECT_EQ(kindOf(stipple::Device::open("abacus")), ErrorKind::usage);
    EXPECT_EQ(kindOf(stipple::Scene::open({})), ErrorKind::usage);
    EXPECT_EQ(kindOf(stipple::Scene::open({at("none.ply")})), ErrorKind::input);
    EXPECT_EQ(kindOf(stipple::Store::open(at("none.stipple"))), ErrorKind::input);
    EXPECT_EQ(kindOf(stipple::build({at("none.ply")}, at("out.stipple"))), ErrorKind::input);
    EXPECT_EQ(kindOf(stipple::build({writeBall("b.ply")}, folder_.string())), ErrorKind::output);
    EXPECT_EQ(kindOf(stipple::writeImage(at("x.png"), {})), ErrorKind::usage);
    const stipple::Scene scene = sceneOf("ball.ply");
    stipple::Renderer r = renderer(device(), scene);
    stipple::Camera nowhere = scene.overview(1);
    nowhere.target = nowhere.eye;
    EXPECT_EQ(kindOf(r.render(nowhere, 32, 32)), ErrorKind::usage);
    nowhere = scene.overview(1);
    nowhere.eye[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(kindOf(r.render(nowhere, 32, 32)), ErrorKind::usage);
    EXPECT_EQ(kindOf(r.render(scene.overview(1), 0, 32)), ErrorKind::usage);
    stipple::RenderSettings settings;
    settings.mode = "oil";
    EXPECT_EQ(kindOf(r.render(scene.overview(1), 32, 32, settings)), ErrorKind::usage);
    settings = {};
    settings.effects = "sparkles";
    EXPECT_EQ(kindOf(r.render(scene.overview(1), 32, 32, settings)), ErrorKind::usage);
    stipple::Scene coloured = scene;
    EXPECT_EQ(kindOf(coloured.colourBy("taste")), ErrorKind::usage);
    const stipple::Renderer moved = std::move(r);
    EXPECT_EQ(kindOf(r.render(scene.overview(1), 32, 32)), ErrorKind::usage);  // NOLINT(bugprone-use-after-move)
}

stipple::PointSource grid() {
    stipple::PointSource source;
    source.name = "grid";
    source.parts = {3000, 5000};
    source.hasColour = true;
    source.read = [](size_t part, uint64_t first, uint64_t count, stipple::Points& to) -> stipple::Result<void> {
        for (uint64_t i = first; i < first + count; ++i) {
            const uint64_t n = part * 3000 + i;
            to.position.push_back({500'000.25 + static_cast<double>(n % 100), 4e6 + static_cast<double>(n / 100), 7});
            to.colour.push_back({10, 200, 30});
        }
        return {};
    };
    return source;
}

TEST_F(Api, PointsOfAProgramAreBuilt) {
    stipple::BuildSettings settings;
    double fraction = -1;
    settings.listener.progress = [&](const stipple::Progress& p) {
        EXPECT_GE(p.fraction, fraction);
        fraction = p.fraction;
    };
    const auto built = stipple::buildPoints(grid(), at("grid.stipple"), settings);
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->in, 8000u);
    EXPECT_EQ(built->kept, 8000u);
    const auto store = stipple::Store::open(at("grid.stipple"));
    ASSERT_TRUE(store);
    EXPECT_EQ(store->primitive(), "point");
    EXPECT_EQ(store->primitives(), 8000u);
    EXPECT_NEAR(store->boundsMin()[0], 500'000.25, 1e-6);
    EXPECT_NEAR(store->boundsMax()[1], 4e6 + 79, 1e-6);
    EXPECT_EQ(store->up(), (stipple::Vec3{0, 0, 1}));
    // Placed twice.
    stipple::Place beside;
    beside.translation = {200, 0, 0};
    const auto scene = stipple::Scene::of({{*store, {}}, {*store, beside}});
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(scene->primitives(), 16000u);
    EXPECT_NEAR(scene->boundsMax()[0], 500'299.25, 1e-6);
    beside.rotation[0] = {-1, 0, 0};
    EXPECT_FALSE(stipple::Scene::of({{*store, beside}})) << "a mirror";
}

TEST_F(Api, ASourceThatFailsOrBreaksItsWordLeavesNothingBehind) {
    stipple::PointSource source = grid();
    source.read = [](size_t, uint64_t, uint64_t, stipple::Points&) -> stipple::Result<void> {
        return stipple::Error{ErrorKind::input, "the sensor is unplugged", "port 3", ""};
    };
    const auto failed = stipple::buildPoints(source, at("a.stipple"));
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().what, "the sensor is unplugged");
    source = grid();
    source.hasNormal = true;
    const auto short_ = stipple::buildPoints(source, at("a.stipple"));
    ASSERT_FALSE(short_);
    EXPECT_EQ(short_.error().kind, ErrorKind::input);
    source.read = nullptr;
    EXPECT_FALSE(stipple::buildPoints(source, at("a.stipple")));
    stipple::BuildSettings stopped;
    stopped.listener.isStopped = [] { return true; };
    const auto ended = stipple::buildPoints(grid(), at("a.stipple"), stopped);
    ASSERT_FALSE(ended);
    EXPECT_EQ(ended.error().kind, ErrorKind::interrupted);
    EXPECT_FALSE(fs::exists(at("a.stipple")));
}

TEST_F(Api, BytesInMemoryBuildTheStoreOfTheFile) {
    const std::string ball = writeBall("ball.ply"), bytes = bytesOf(ball);
    ASSERT_TRUE(stipple::build({ball}, at("file.stipple")));
    fs::remove(ball);
    const auto built = stipple::buildBytes({{"ball.ply", bytes.data(), bytes.size()}}, at("memory.stipple"));
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->kept, 4000u);
    EXPECT_EQ(bytesOf(at("memory.stipple")), bytesOf(at("file.stipple")));
    EXPECT_EQ(stipple_build_bytes("ball.ply", bytes.data(), bytes.size(), at("c.stipple").c_str()), 0);
    EXPECT_EQ(bytesOf(at("c.stipple")), bytesOf(at("file.stipple")));
    EXPECT_EQ(stipple_build_bytes("ball.ply", nullptr, 3, at("c.stipple").c_str()), 2);
    EXPECT_EQ(stipple_build_bytes("ball.ply", bytes.data(), 0, at("c.stipple").c_str()), 3);
    // It is drawn.
    const auto store = stipple::Store::open(at("memory.stipple"));
    ASSERT_TRUE(store);
    const auto scene = stipple::Scene::of({{*store, {}}});
    ASSERT_TRUE(scene);
    const auto image = Api::renderer(Api::device(), *scene).render(scene->overview(1), 48, 48);
    ASSERT_TRUE(image);
    size_t covered = 0;
    for (size_t i = 3; i < image->rgba.size(); i += 4) covered += image->rgba[i] > 0 ? 1 : 0;
    EXPECT_GT(covered, 500u);
    // Half of it, what is no input, and a store.
    const auto half = stipple::buildBytes({{"half.ply", bytes.data(), bytes.size() / 2}}, at("half.stipple"));
    ASSERT_FALSE(half);
    EXPECT_NE(half.error().line().find("half.ply"), std::string::npos) << half.error().line();
    EXPECT_FALSE(fs::exists(at("half.stipple")));
    const auto vdb = stipple::buildBytes({{"a.vdb", "something", 9}}, at("half.stipple"));
    ASSERT_FALSE(vdb);
    EXPECT_NE(vdb.error().line().find("a.vdb: is OpenVDB, which is read from files only"), std::string::npos);
    const std::string whole = bytesOf(at("file.stipple"));
    EXPECT_FALSE(stipple::buildBytes({{"a.ply", whole.data(), whole.size()}}, at("half.stipple")));
}

TEST_F(Api, MeshesAndScenesInMemoryBuildTheStoreOfTheFile) {
    std::ofstream(at("a.ply")) << "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                                  "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                                  "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    std::ofstream(at("b.obj")) << "mtllib m.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    std::ofstream(at("m.mtl")) << "newmtl red\nKd 1 0 0\n";
    std::ofstream(at("c.swc")) << "1 1 0 0 0 1 -1\n2 3 0 0 1 0.5 1\n3 3 0 0 2 0.5 2\n";
    for (const std::string name : {"a.ply", "b.obj", "c.swc"}) {
        SCOPED_TRACE(name);
        const std::string bytes = bytesOf(at(name)), material = bytesOf(at("m.mtl"));
        const auto ofFile = stipple::build({at(name)}, at("file.stipple"));
        ASSERT_TRUE(ofFile) << ofFile.error().line();
        fs::rename(at(name), at("gone"));
        const stipple::Resolve resolve = [&](const std::string& wanted) -> stipple::Result<std::vector<uint8_t>> {
            if (wanted != "m.mtl") return stipple::Error{ErrorKind::input, "is not there", wanted, ""};
            return std::vector<uint8_t>(material.begin(), material.end());
        };
        const std::vector<stipple::Bytes> input{{name, bytes.data(), bytes.size()}};
        const auto built = stipple::buildBytes(input, at("memory.stipple"), {}, resolve);
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_EQ(built->primitive, ofFile->primitive);
        EXPECT_EQ(bytesOf(at("memory.stipple")), bytesOf(at("file.stipple")));
        // Without what it names, which lies beside the place where it was, it is another.
        const auto alone = stipple::buildBytes(input, at("alone.stipple"));
        ASSERT_TRUE(alone) << alone.error().line();
        EXPECT_EQ(bytesOf(at("alone.stipple")) == bytesOf(at("file.stipple")), name != "b.obj");
    }
}

TEST_F(Api, OneWithoutFacesBesideOthersIsNamed) {
    const std::string ball = bytesOf(writeBall("ball.ply"));
    const std::string mesh =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n";
    const auto both = stipple::buildBytes(
        {{"mesh.ply", mesh.data(), mesh.size()}, {"points.ply", ball.data(), ball.size()}}, at("both.stipple"));
    ASSERT_FALSE(both);
    EXPECT_NE(both.error().line().find("points.ply: has no faces"), std::string::npos) << both.error().line();
}

TEST_F(Api, NamesOfPointsAreNoFiles) {
    // A folder of scans of that name, seen from where the program runs, is another's.
    writeBall("ball.ply");
    const std::string bytes = bytesOf(at("ball.ply"));
    stipple::PointSource source = grid();
    source.name = folder_.string();
    const auto points = stipple::buildPoints(source, at("grid.stipple"));
    ASSERT_TRUE(points) << points.error().line();
    EXPECT_EQ(points->in, 8000u);
    writeBall("other.ply");
    for (const std::string& name : {folder_.string(), at("*.ply")}) {
        const auto built = stipple::buildBytes({{name, bytes.data(), bytes.size()}}, at("b.stipple"));
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_EQ(built->in, 4000u);
    }
}

TEST_F(Api, TheSubsetForCRefusesWhatIsNotThereAndDrawsTheSame) {
    EXPECT_EQ(stipple_device_open("cpu", nullptr), 2);
    EXPECT_NE(std::string(stipple_last_error()), "");
    stipple_device* device = nullptr;
    EXPECT_EQ(stipple_device_open("abacus", &device), 2);
    EXPECT_EQ(device, nullptr);
    ASSERT_EQ(stipple_device_open("cpu", &device), 0);
    const std::string ball = writeBall("ball.ply");
    const char* const inputs[] = {ball.c_str(), nullptr};
    stipple_scene* scene = nullptr;
    EXPECT_EQ(stipple_scene_open(inputs, 2, &scene), 2);
    ASSERT_EQ(stipple_scene_open(inputs, 1, &scene), 0) << stipple_last_error();
    stipple_camera camera;
    ASSERT_EQ(stipple_scene_overview(scene, 1, &camera), 0);
    stipple_renderer* renderer = nullptr;
    EXPECT_EQ(stipple_renderer_create(device, nullptr, &renderer), 2);
    ASSERT_EQ(stipple_renderer_create(device, scene, &renderer), 0);
    stipple_device_close(device);
    stipple_scene_close(scene);
    std::vector<uint8_t> rgba(size_t{4} * 48 * 48);
    double kept = -1;
    EXPECT_EQ(stipple_render(renderer, &camera, 48, 48, 1, nullptr, &kept), 2);
    EXPECT_EQ(stipple_render(renderer, &camera, 48, 48, -1, rgba.data(), &kept), 2);
    ASSERT_EQ(stipple_render(renderer, &camera, 48, 48, 1, rgba.data(), &kept), 0) << stipple_last_error();
    EXPECT_GT(kept, 0);
    EXPECT_LE(kept, 1);
    stipple_renderer_destroy(renderer);
    stipple_renderer_destroy(nullptr);
    const stipple::Scene same = sceneOf("ball.ply");
    stipple::Renderer r = Api::renderer(Api::device(), same);
    const auto image = r.render(same.overview(1), 48, 48);
    ASSERT_TRUE(image);
    EXPECT_EQ(image->rgba, rgba);
}

}  // namespace
