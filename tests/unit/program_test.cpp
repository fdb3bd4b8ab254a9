// The program as a newcomer runs it: exit codes, one line on standard error, no half-written file.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using test::expectOneLine;
using test::Outcome;
using test::runProgram;

TEST(Program, BuildsShowsAndComparesAScan) {
    const test::TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 20000 --origin 500000,5400000,300").code, 0);
    const Outcome built = runProgram(folder, "build a.las -o a.stipple --json --quiet");
    ASSERT_EQ(built.code, 0) << built.err;
    const auto report = nlohmann::json::parse(built.out);
    for (const char* key : {"points_in", "points_out", "dropped", "seconds", "points_per_second", "peak_rss_bytes",
                            "bytes_out", "content_hash"})
        EXPECT_TRUE(report.contains(key)) << key;
    EXPECT_EQ(report["points_in"], 20000);
    EXPECT_EQ(runProgram(folder, "info a.stipple --verify").code, 0);
    EXPECT_EQ(runProgram(folder, "info a.las --verify --json").code, 0);
    const Outcome rendered =
        runProgram(folder, "render a.stipple -o a.png --size 320x200 --json --frames 3 --device cpu");
    ASSERT_EQ(rendered.code, 0) << rendered.err;
    const auto j = nlohmann::json::parse(rendered.out);
    for (const char* key :
         {"backend", "device", "frame_ms", "passes", "records_drawn", "nodes_drawn", "tau_eff_px", "bytes_streamed",
          "resident_bytes", "peak_rss_bytes", "first_image_ms", "complete_ms", "counters"})
        EXPECT_TRUE(j.contains(key)) << key;
    EXPECT_EQ(runProgram(folder, "render a.las -o b.png --size 320x200 --device cpu --quiet").code, 0)
        << "through the cache";
    EXPECT_EQ(runProgram(folder, "render a.stipple -o b.exr --size 64x48 --device reference --quiet").code, 0);
    const Outcome compared = runProgram(folder, "compare a.png b.png --json --diff d.png");
    EXPECT_EQ(nlohmann::json::parse(compared.out)["max_diff"], 0) << "built beside and in the cache: the same";
    EXPECT_EQ(runProgram(folder, "render a.stipple -o o.png --size 64x48 --orbit 3 --quiet").code, 0);
    EXPECT_TRUE(std::filesystem::exists(folder / "o_0002.png"));
}

TEST(Program, SaysWhatIsWrongInOneLine) {
    const test::TempFolder folder;
    std::ofstream(folder / "empty.ply");
    std::filesystem::create_directory(folder / "dir");
    std::ofstream(folder / "text.las") << "hello";
    std::ofstream(folder / "none.ply") << "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float "
                                          "y\nproperty float z\nend_header\n";
    std::ofstream(folder / "nan.ply") << "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
                                         "y\nproperty float z\nend_header\nnan 1 2\n";
    std::ofstream(folder / "one.ply") << "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
                                         "y\nproperty float z\nend_header\n1 2 3\n";
    expectOneLine(runProgram(folder, "build missing.ply -o o.stipple"), 3, {"missing.ply"});
    expectOneLine(runProgram(folder, "build dir -o o.stipple"), 3, {"no .las"});
    expectOneLine(runProgram(folder, "build empty.ply -o o.stipple"), 3, {"empty"});
    expectOneLine(runProgram(folder, "build text.las -o o.stipple"), 3, {"text.las"});
    expectOneLine(runProgram(folder, "build none.ply -o o.stipple"), 3, {"no points"});
    expectOneLine(runProgram(folder, "build nan.ply -o o.stipple"), 3, {"none of its 1 points"});
    expectOneLine(runProgram(folder, "build one.ply -o no/such/folder/o.stipple"), 4, {"no/such/folder"});
    expectOneLine(runProgram(folder, "build one.ply -o o.stipple --memory potato"), 2, {"potato"});
    expectOneLine(runProgram(folder, "build one.ply -o o.stipple --memory 1M"), 6, {"--memory"});
    expectOneLine(runProgram(folder, "render one.ply -o a.tiff"), 2, {".png"});
    expectOneLine(runProgram(folder, "render one.ply -o a.png --size 0x4"), 2, {"0x4"});
    expectOneLine(runProgram(folder, "render one.ply -o a.png --eye 1,2"), 2, {"--eye"});
    expectOneLine(runProgram(folder, "render one.ply -o a.png --device abacus"), 2, {"abacus"});
    expectOneLine(runProgram(folder, "frobnicate"), 2, {"--help"});
    expectOneLine(runProgram(folder, "compare empty.ply one.ply"), 3, {"empty.ply"});
    EXPECT_FALSE(std::filesystem::exists(folder / "o.stipple"));
    EXPECT_EQ(runProgram(folder, "build one.ply -o one.stipple --quiet").code, 0);
    EXPECT_EQ(runProgram(folder, "render one.stipple -o one.png --quiet --size 64x64").code, 0)
        << "a single point is a scene";
    EXPECT_EQ(runProgram(folder, "--help").code, 0);
    EXPECT_EQ(runProgram(folder, "render --help").code, 0);
    EXPECT_EQ(runProgram(folder, "--version").code, 0);
}

TEST(Program, AFullDiskLeavesTheOldFileAlone) {
    const test::TempFolder folder;
    std::filesystem::create_directory(folder / "small");
    // A file size limit stands for the full disk: both end in a failed write.
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 50000").code, 0);
    ASSERT_EQ(runProgram(folder, "grow scan -o old.las --points 100").code, 0);
    ASSERT_EQ(runProgram(folder, "build old.las -o small/a.stipple --quiet").code, 0);
    const std::string old = test::slurp(folder / "small/a.stipple");
    expectOneLine(runProgram(folder, "build a.las -o small/a.stipple --quiet", "ulimit -f 64;"), 4, {"ulimit"});
    EXPECT_TRUE(test::slurp(folder / "small/a.stipple") == old);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    ASSERT_EQ(runProgram(folder, "render a.stipple -o small/a.png --size 16x16 --quiet").code, 0);
    const std::string oldPicture = test::slurp(folder / "small/a.png");
    expectOneLine(runProgram(folder, "render a.stipple -o small/a.png --size 1280x720 --quiet", "ulimit -f 64;"), 4,
                  {"ulimit"});
    EXPECT_TRUE(test::slurp(folder / "small/a.png") == oldPicture);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "small"), {}), 2);
}

TEST(Program, ATruncatedSceneIsRefused) {
    const test::TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.ply --points 5000").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.ply -o a.stipple --quiet").code, 0);
    const auto size = std::filesystem::file_size(folder / "a.stipple");
    for (const auto keep : {uintmax_t{0}, uintmax_t{100}, size / 2, size - 1}) {
        std::filesystem::copy_file(folder / "a.stipple", folder / "b.stipple",
                                   std::filesystem::copy_options::overwrite_existing);
        std::filesystem::resize_file(folder / "b.stipple", keep);
        expectOneLine(runProgram(folder, "render b.stipple -o b.png"), 3, {"b.stipple"});
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "b.png"));
}

TEST(Program, CurvesAreDrawnAndWhatTheyCannotDoIsSaid) {
    const test::TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow tree -o a.glb --leaves 500 --species birch").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.glb -o a.stipple --quiet").code, 0);
    const Outcome info = runProgram(folder, "info a.stipple --verify");
    EXPECT_NE(info.out.find("segments"), std::string::npos) << info.out;
    EXPECT_EQ(runProgram(folder, "render a.stipple -o a.png --size 64x64 --accumulate 2 --quiet").code, 0);
    expectOneLine(runProgram(folder, "render a.stipple -o b.png --colour height"), 2, {"ribbons and tubes"});
    expectOneLine(runProgram(folder, "info a.stipple --at 0,0,0"), 2, {"no points"});
    expectOneLine(runProgram(folder, "grow tree -o b.glb --leaves none"), 2, {"--leaves"});
    test::spit(folder / "a.swc", "1 1 0 0\n");
    expectOneLine(runProgram(folder, "build a.swc -o b.stipple --quiet"), 3, {"line 1"});
    EXPECT_FALSE(std::filesystem::exists(folder / "b.stipple"));
    EXPECT_FALSE(std::filesystem::exists(folder / "b.png"));
}

TEST(Program, GrowsForestsMeadowsAndConvertsPlants) {
    const test::TempFolder folder;
    const Outcome forest = runProgram(folder, "grow forest -o f.glb --trees 100 --leaves 2k --variants 1 --json");
    ASSERT_EQ(forest.code, 0) << forest.err;
    EXPECT_EQ(nlohmann::json::parse(forest.out)["instances"], 100);
    const Outcome far = runProgram(folder, "render f.glb -o f.png --size 320x200 --error 2 --json --device cpu");
    ASSERT_EQ(far.code, 0) << far.err;
    const auto j = nlohmann::json::parse(far.out);
    EXPECT_LE(j["tau_eff_px"].get<double>(), 2.0001);
    EXPECT_GT(j["records_drawn"].get<uint64_t>(), 100u);
    EXPECT_LT(j["records_drawn"].get<uint64_t>(), 200'000u) << "100 trees of thousands of segments each";
    EXPECT_EQ(j["counters"]["nodes_swaying"], 0);
    const Outcome windy = runProgram(
        folder, "render f.glb -o w.png --size 320x200 --eye 0,4,30 --target 0,4,0 --wind 0.05 --time 3 --json");
    ASSERT_EQ(windy.code, 0) << windy.err;
    EXPECT_GT(nlohmann::json::parse(windy.out)["counters"]["nodes_swaying"].get<uint64_t>(), 0u);
    EXPECT_EQ(runProgram(folder, "grow meadow -o m.glb --size 6").code, 0);
    EXPECT_EQ(runProgram(folder, "render m.glb -o m.png --size 160x120 --device cpu").code, 0);
    ASSERT_EQ(runProgram(folder, "grow tree -o t.glb --leaves 500 --as triangles").code, 0);
    const Outcome converted = runProgram(folder, "convert t.glb --curves -o t.stipple --json");
    ASSERT_EQ(converted.code, 0) << converted.err;
    const auto c = nlohmann::json::parse(converted.out);
    EXPECT_NEAR(c["ribbons"].get<double>(), 500, 10);
    EXPECT_GT(c["triangles_left"].get<uint64_t>(), 0u);
    EXPECT_EQ(c["written"].size(), 3u);
    EXPECT_EQ(runProgram(folder, "info t.stipple --verify").code, 0);
    EXPECT_EQ(runProgram(folder, "render t.scene.glb -o t.png --size 160x120 --device cpu").code, 0);
    expectOneLine(runProgram(folder, "convert t.glb -o x.stipple"), 2, {"--curves"});
    expectOneLine(runProgram(folder, "convert missing.glb --curves -o x.stipple"), 3, {"missing.glb"});
    expectOneLine(runProgram(folder, "convert t.glb --curves -o x.txt"), 2, {"x.txt"});
    expectOneLine(runProgram(folder, "grow forest -o f.glb --trees none"), 2, {"--trees"});
    expectOneLine(runProgram(folder, "grow forest -o no/such/f.glb --trees 1 --leaves 100 --variants 1"), 4,
                  {"no/such"});
}

}  // namespace
}  // namespace stipple
