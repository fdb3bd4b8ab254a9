// What a command writes is never what it reads, and nothing else is destroyed unasked.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "engine/scene/scene.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;
using test::expectOneLine;
using test::runProgram;
using test::slurp;
using test::spit;

constexpr const char* kIsInput = "is an input of this command";

/// A small scan that is there, built beside it.
void growScan(const test::TempFolder& folder, const std::string& name) {
    ASSERT_EQ(runProgram(folder, "grow scan -o " + name + " --points 3000").code, 0);
}

/// A blade and a block, as triangles.
void writePlant(const std::string& path) {
    scene::Primitive blade, block;
    for (uint32_t i = 0; i <= 10; ++i) {
        for (const float x : {-0.05f, 0.05f}) blade.position.emplace_back(x, 0.2f * float(i), 0.01f * float(i * i));
        if (i > 0)
            blade.indices.insert(blade.indices.end(), {2 * i - 2, 2 * i - 1, 2 * i, 2 * i, 2 * i - 1, 2 * i + 1});
    }
    for (uint32_t i = 0; i < 8; ++i) block.position.emplace_back(1 + (i & 1), (i & 2) / 2, (i & 4) / 4);
    block.indices = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                     2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    scene::Scene plant;
    plant.meshes.resize(1);
    plant.meshes[0].primitives = {blade, block};
    plant.nodes.resize(1);
    plant.nodes[0].mesh = 0;
    ASSERT_TRUE(scene::writeGltf(plant, path));
}

TEST(Overwrite, NoInputWhateverItsNameIs) {
    const test::TempFolder folder;
    growScan(folder, "a.las");
    const std::string scan = slurp(folder / "a.las");
    fs::create_directory(folder / "tiles");
    spit(folder / "tiles/1.las", scan);
    fs::create_symlink("tiles", folder / "linked");
    fs::create_symlink("a.las", folder / "link.las");
    fs::create_hard_link(folder / "a.las", folder / "second.las");
    for (const char* command :
         {"build a.las -o a.las", "build a.las -o ./tiles/../a.las --force", "build a.las -o link.las",
          "build link.las -o a.las", "build a.las -o second.las --force", "build tiles -o tiles/1.las",
          "build linked/ -o tiles/1.las --force", "build tiles/*.las -o linked/1.las"})
        expectOneLine(runProgram(folder, std::string(command) + " --quiet"), 4, {kIsInput});
    EXPECT_TRUE(slurp(folder / "a.las") == scan);
    EXPECT_TRUE(slurp(folder / "tiles/1.las") == scan);
    EXPECT_TRUE(fs::is_symlink(folder / "link.las"));
    // A folder of tiles may hold what is made of them.
    EXPECT_EQ(runProgram(folder, "build tiles -o tiles/town.stipple --quiet").code, 0);
    EXPECT_EQ(runProgram(folder, "build tiles -o tiles/town.stipple --quiet").code, 0);
}

TEST(Overwrite, NoTextureByAnOrbitOfOnePicture) {
    const test::TempFolder folder;
    growScan(folder, "a.las");
    ASSERT_EQ(runProgram(folder, "render a.las -o colour.png --size 32x32 --quiet").code, 0);
    const std::string picture = slurp(folder / "colour.png");
    spit(folder / "sub.mtl", "newmtl m\nmap_Kd tex\\colour.png\n");
    fs::create_directory(folder / "tex");
    fs::rename(folder / "colour.png", folder / "tex/colour.png");
    spit(folder / "a.obj", "mtllib .\\sub.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    expectOneLine(runProgram(folder, "render a.obj --orbit 1 -o tex/colour.png --size 32x32 --quiet"), 4, {kIsInput});
    EXPECT_TRUE(slurp(folder / "tex/colour.png") == picture);
    spit(folder / "note.png", "not a picture");
    expectOneLine(runProgram(folder, "render a.las --orbit 1 -o note.png --size 32x32 --quiet"), 4, {"is no picture"});
    // Two outputs of one command are two files.
    writePlant(folder / "plant.glb");
    spit(folder / "b.rest.glb", "");
    fs::create_symlink("b.rest.glb", folder / "b.stipple");
    expectOneLine(runProgram(folder, "convert plant.glb --curves -o b.stipple --force"), 4, {"another output"});
}

TEST(Overwrite, NoPictureThatIsCompared) {
    const test::TempFolder folder;
    growScan(folder, "a.las");
    ASSERT_EQ(runProgram(folder, "render a.las -o a.png --size 32x32 --quiet").code, 0);
    fs::copy_file(folder / "a.png", folder / "b.png");
    const std::string picture = slurp(folder / "a.png");
    expectOneLine(runProgram(folder, "compare a.png b.png --diff b.png --force"), 4, {"b.png", kIsInput});
    EXPECT_TRUE(slurp(folder / "b.png") == picture);
    EXPECT_EQ(runProgram(folder, "compare a.png b.png --diff d.png").code, 0);
    EXPECT_EQ(runProgram(folder, "compare a.png b.png --diff d.png").code, 0) << "a picture replaces a picture";
    spit(folder / "notes.png", "not a picture, whatever its name says");
    expectOneLine(runProgram(folder, "compare a.png b.png --diff notes.png"), 4, {"notes.png", "--force"});
    EXPECT_EQ(runProgram(folder, "compare a.png b.png --diff notes.png --force").code, 0);
}

TEST(Overwrite, NoPartOfAScene) {
    const test::TempFolder folder;
    growScan(folder, "a.las");
    ASSERT_EQ(runProgram(folder, "render a.las -o colour.png --size 16x16 --quiet").code, 0);
    const std::string picture = slurp(folder / "colour.png");
    spit(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    spit(folder / "a.mtl", "newmtl m\nmap_Kd colour.png\n");
    expectOneLine(runProgram(folder, "render a.obj -o colour.png --size 16x16 --quiet"), 4, {"colour.png", kIsInput});
    EXPECT_TRUE(slurp(folder / "colour.png") == picture);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    const std::string store = slurp(folder / "a.stipple");
    spit(folder / "a.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "extensionsUsed":["STIPPLE_store"],
        "nodes":[{"extensions":{"STIPPLE_store":{"uri":"a.stipple"}}}]})");
    expectOneLine(runProgram(folder, "build a.gltf -o a.stipple --quiet"), 4, {"a.stipple", kIsInput});
    EXPECT_TRUE(slurp(folder / "a.stipple") == store);
    // Nor what numbered pictures would replace.
    fs::copy_file(folder / "colour.png", folder / "turn_0001.png");
    spit(folder / "a.mtl", "newmtl m\nmap_Kd turn_0001.png\n");
    expectOneLine(runProgram(folder, "render a.obj -o turn.png --orbit 3 --size 16x16 --quiet"), 4,
                  {"turn_0001.png", kIsInput});
    EXPECT_FALSE(fs::exists(folder / "turn_0000.png"));
}

TEST(Overwrite, ConvertedPlantsKeepTheirInput) {
    const test::TempFolder folder;
    writePlant(folder / "plant.glb");
    const std::string plant = slurp(folder / "plant.glb");
    ASSERT_EQ(runProgram(folder, "convert plant.glb --curves -o plant.stipple --json").code, 0);
    EXPECT_TRUE(slurp(folder / "plant.glb") == plant) << "the README's example";
    EXPECT_TRUE(fs::exists(folder / "plant.scene.glb"));
    EXPECT_TRUE(fs::exists(folder / "plant.rest.glb"));
    EXPECT_EQ(runProgram(folder, "render plant.scene.glb -o a.png --size 32x32 --quiet").code, 0);
    expectOneLine(runProgram(folder, "convert plant.glb --curves -o plant.glb --force"), 4, {kIsInput});
    fs::copy_file(folder / "plant.glb", folder / "tree.rest.glb");
    expectOneLine(runProgram(folder, "convert tree.rest.glb --curves -o tree.stipple --force"), 4,
                  {"tree.rest.glb", kIsInput});
    EXPECT_FALSE(fs::exists(folder / "tree.stipple")) << "before any work";
    EXPECT_TRUE(slurp(folder / "plant.glb") == plant);
    EXPECT_TRUE(slurp(folder / "tree.rest.glb") == plant);
}

TEST(Overwrite, OtherFilesOnlyWhenTold) {
    const test::TempFolder folder;
    growScan(folder, "a.las");
    spit(folder / "thesis", "four years");
    spit(folder / "empty", "");
    expectOneLine(runProgram(folder, "build a.las -o thesis --quiet"), 4, {"thesis", "--force"});
    EXPECT_EQ(slurp(folder / "thesis"), "four years");
    EXPECT_EQ(runProgram(folder, "build a.las -o empty --quiet").code, 0) << "nothing is lost";
    expectOneLine(runProgram(folder, "grow scan -o a.las --points 10"), 4, {"a.las", "--force"});
    expectOneLine(runProgram(folder, "grow rock -o a.las --triangles 100"), 4, {"a.las", "--force"});
    EXPECT_EQ(runProgram(folder, "grow scan -o a.las --points 3000 --force").code, 0);
    EXPECT_EQ(runProgram(folder, "build a.las -o thesis --quiet --force").code, 0);
    EXPECT_EQ(runProgram(folder, "build a.las -o thesis --quiet").code, 0) << "a built scene by now, whatever its name";
    // What cannot be a file is said before the work.
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    expectOneLine(runProgram(folder, "build a.las -o pipe --quiet --force"), 4, {"pipe"});
    expectOneLine(runProgram(folder, "build a.las -o \"\" --quiet"), 2, {"empty"});
    expectOneLine(runProgram(folder, "grow scan -o \"\""), 2, {"empty"});
    expectOneLine(runProgram(folder, "render a.las -o \"\""), 2, {"empty"});
    expectOneLine(runProgram(folder, "build \"\" -o b.stipple"), 2, {"empty"});
    EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
}

}  // namespace
}  // namespace stipple
