// OBJ files and camera paths of other programs: whatever is in them, they end in a scene or in an error that names it.
#include <gtest/gtest.h>

#include "engine/scene/camera.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using test::spit;
using test::TempFolder;

TEST(ForeignObj, MutatedFilesEndInASceneOrAnError) {
    const TempFolder folder;
    const std::string obj =
        "mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\no part\nusemtl a\n"
        "f 1/1/1 2/2/1 4//1 3\nf -1 -2 -3\ns 1\ng x\nusemtl b\nf 1 2 3\n";
    const std::string mtl = "newmtl a\nKd 1 0 0\nmap_Kd -s 1 1 1 t.png\nd 0.5\nnewmtl b\nKe 1 1 1\n";
    Rng rng(5);
    const auto mutate = [&](std::string text) {
        static const std::string bytes("0123456789/-+. \n\r\tevfnt\0\xff", 25);
        for (uint64_t n = 1 + rng.below(4); n > 0; --n) {
            const size_t at = rng.below(text.size());
            if (rng.below(4) == 0)
                text.insert(at, rng.below(2) == 0 ? "999999999999" : "1e400");
            else
                text[at] = bytes[rng.below(bytes.size())];
        }
        return text;
    };
    for (int k = 0; k < 500; ++k) {
        spit(folder / "a.obj", mutate(obj));
        spit(folder / "a.mtl", mutate(mtl));
        const auto scene = readObj(folder / "a.obj");
        if (!scene) continue;
        (void)meshBounds(*scene);
        (void)surfaceMaterials(*scene);
        ASSERT_TRUE(triangleSource(*scene, placements(*scene)).read([](const lod::TriangleMesh&) -> Result<void> {
            return {};
        }));
    }
}

TEST(ForeignPaths, EveryValueOfACameraPathIsCheckedByName) {
    const TempFolder folder;
    const std::string key = R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, 0]})";
    const std::vector<std::pair<std::string, std::string>> bad{
        {R"({"t": 0, "eye": [1e300, 0, 1], "target": [0, 0, 0]})", "'eye'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0]})", "'target'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, "1"]})", "'target'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, 1]})", "'target'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, 0], "fov": 180})", "'fov'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, 0], "fov": 0})", "'fov'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, 0], "fov": null})", "'fov'"},
        {R"({"t": 0, "eye": [0, 0, 1], "target": [0, 0, 0], "up": [0, 0, 0]})", "'up'"},
        {R"({"t": 1e300, "eye": [0, 0, 1], "target": [0, 0, 0]})", "'t'"},
        {R"({"eye": [0, 0, 1], "target": [0, 0, 0]})", "'t'"}};
    for (const auto& [text, name] : bad) {
        spit(folder / "p.json", R"({"keys": [)" + text + "]}");
        const auto path = readCameraPath(folder / "p.json");
        ASSERT_FALSE(path) << text;
        EXPECT_NE(path.error().what.find("key 0: " + name), std::string::npos) << path.error().line();
    }
    for (const char* fps : {"0", "-1", "1e300", "\"30\""}) {
        spit(folder / "p.json", R"({"fps": )" + std::string(fps) + R"(, "keys": [)" + key + "]}");
        const auto path = readCameraPath(folder / "p.json");
        ASSERT_FALSE(path) << fps;
        EXPECT_NE(path.error().what.find("'fps'"), std::string::npos) << path.error().line();
    }
    spit(folder / "p.json",
         R"({"fps": 1000, "keys": [)" + key + R"(, {"t": 1e8, "eye": [0, 0, 1], "target": [0, 0, 0]}]})");
    EXPECT_FALSE(readCameraPath(folder / "p.json")) << "10^11 frames";
    for (const char* text : {"[]", "7", "{", R"({"keys": 1})", R"({"keys": [1e999]})", R"({"keys": [7]})"}) {
        spit(folder / "p.json", text);
        const auto path = readCameraPath(folder / "p.json");
        ASSERT_FALSE(path) << text;
        EXPECT_EQ(path.error().line().find("exception"), std::string::npos) << path.error().line();
    }
    // A misspelt name is not passed over.
    for (const auto& [text, meant] :
         {std::pair<std::string, std::string>{R"({"fsp": 30, "keys": [)" + key + "]}",
                                              "the path: 'fsp' is not known (did you mean 'fps'?)"},
          {R"({"keys": [{"t": 0, "eye": [0, 0, 1], "targte": [0, 0, 0], "target": [0, 0, 0]}]})",
           "key 0: 'targte' is not known (did you mean 'target'?)"},
          {R"({"keys": [{"t": 0, "eye": [0, 0, 1], "target": [0, 0, 0], "roll": 5}]})",
           "key 0: 'roll' is not known (there are t, eye, target, up, fov, ortho)"}}) {
        spit(folder / "p.json", text);
        const auto path = readCameraPath(folder / "p.json");
        ASSERT_FALSE(path) << text;
        EXPECT_NE(path.error().line().find(meant), std::string::npos) << path.error().line();
    }
    // Between keys with wide angles the curve swings out, but not beyond what a picture can show.
    spit(folder / "p.json",
         R"({"keys": [{"t": 0, "eye": [0,0,1], "target": [0,0,0], "fov": 1}, {"t": 1, "eye": [0,0,1],
             "target": [0,0,0], "fov": 179}, {"t": 2, "eye": [0,0,1], "target": [0,0,0], "fov": 179},
             {"t": 3, "eye": [0,0,1], "target": [0,0,0], "fov": 1}]})");
    const auto path = readCameraPath(folder / "p.json");
    ASSERT_TRUE(path) << path.error().line();
    for (double t = 0; t <= 3; t += 0.01) EXPECT_LE(path->at(t).fovDegrees, 179);
}

}  // namespace
}  // namespace stipple::scene
