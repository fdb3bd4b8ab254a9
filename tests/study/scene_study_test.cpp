// `stipple study SCENE...` as a person runs it: what it writes, that it goes on, that its errors are the same bytes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/study/sweep/journal.h"
#include "apps/study/sweep/plan.h"
#include "apps/study/sweep/scene_drawer.h"
#include "engine/cpu/cpu_backend.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

TEST(SceneStudy, BlocksDrawEveryCellInAnOrderOfTheirOwn) {
    const auto first = study::orderOf(200, 0, 1);
    EXPECT_EQ(first, study::orderOf(200, 0, 1));
    EXPECT_NE(first, study::orderOf(200, 1, 1));
    EXPECT_NE(first, study::orderOf(200, 0, 2));
    auto sorted = first;
    std::sort(sorted.begin(), sorted.end());
    for (uint32_t i = 0; i < 200; ++i) EXPECT_EQ(sorted[i], i);
}

TEST(SceneStudy, JournalsForgetTornLinesAndKeepWholeOnes) {
    const test::TempFolder folder;
    const study::CsvRow head{"a", "b"};
    {
        auto journal = study::Journal::open(folder / "j.csv", head);
        ASSERT_TRUE(journal);
        ASSERT_TRUE(journal->append({{"1", "x"}, {"2", study::csvNumber(0.1)}}));
    }
    test::spit(folder / "j.csv", test::slurp(folder / "j.csv") + "3,to");
    {
        auto journal = study::Journal::open(folder / "j.csv", head, [](const auto& row) { return row[0] != "1"; });
        ASSERT_TRUE(journal);
        ASSERT_EQ(journal->rows().size(), 1u);
        EXPECT_EQ(study::numberOf(journal->rows()[0][1]), 0.1);
        ASSERT_TRUE(journal->append({{"4", ""}}));
    }
    EXPECT_EQ(test::slurp(folder / "j.csv"), "a,b\n2,0.1\n4,\n");
    EXPECT_FALSE(study::Journal::open(folder / "j.csv", {"a", "c"}));
    EXPECT_TRUE(std::isnan(study::numberOf("")));
    EXPECT_EQ(study::csvName("a,\"b\"\n"), "a__b__");
}

size_t linesOf(const std::string& path) {
    const std::string text = test::slurp(path);
    return static_cast<size_t>(std::count(text.begin(), text.end(), '\n'));
}

constexpr const char* kSmall =
    "study ring.ply --modes surface,pullpush --errors 1,4 --sizes 96x64 --views 1 --blocks 2 "
    "--frames 2 --budgets 500,2k --quiet ";

void writeScene(const test::TempFolder& folder) {
    test::writePly(folder / "ring.ply", test::samplesOf(test::Shape::torus, 4'000, 3));
}

TEST(SceneStudy, WritesRowsFiguresAndAReportThatStandsAlone) {
    const test::TempFolder folder;
    writeScene(folder);
    const test::Outcome r = test::runProgram(folder, std::string(kSmall) + "-o s --json");
    ASSERT_EQ(r.code, 0) << r.err;
    const nlohmann::json j = nlohmann::json::parse(r.out, nullptr, false);
    ASSERT_TRUE(j.is_object());
    EXPECT_EQ(j["schema"], "stipple.scene-study/2");
    EXPECT_EQ(j["plan"]["cells"], 4 * (2 * 2 + 2));
    ASSERT_EQ(j["configurations"].size(), 4u);
    ASSERT_EQ(j["budgets"].size(), 2u);
    const auto& surface = j["configurations"][0];
    EXPECT_EQ(surface["mode"], "surface");
    EXPECT_GT(surface["ms"]["median"], 0);
    EXPECT_GT(surface["errors"]["audited_pixels"], 2'000);
    EXPECT_EQ(surface["errors"]["beyond_pixels"], 0);
    EXPECT_LE(surface["errors"]["lod_px_max"], 1.5);
    EXPECT_GT(surface["errors"]["implementation_db"], 50);
    EXPECT_GT(surface["errors"]["silhouette_iou"], 0.9);
    EXPECT_GT(surface["passes_ms"]["splat"], 0);
    EXPECT_FALSE(j["provenance"]["processor"].get<std::string>().empty());
    EXPECT_EQ(j["provenance"]["program"].get<std::string>().size(), 16u);
    EXPECT_EQ(j["scenes"][0]["content"].get<std::string>().size(), 16u);
    EXPECT_GT(surface["errors"]["flicker_mean"], 0);
    // Budgets: fewer records, and what they leave of the error is stated and kept.
    const auto stated = [](const nlohmann::json& of) {
        const nlohmann::json& px = of["errors"]["stated_px"];
        return px.is_string() ? std::numeric_limits<double>::infinity() : px.get<double>();
    };
    double coarser = stated(surface);
    for (const size_t k : {1, 0}) {
        const auto& within = j["budgets"][k];
        EXPECT_EQ(within["records_at_most"], k == 0 ? 500 : 2000);
        EXPECT_LE(within["errors"]["records"], within["records_at_most"]);
        EXPECT_GE(stated(within), coarser);
        EXPECT_EQ(within["errors"]["beyond_pixels"], 0);
        coarser = stated(within);
    }
    EXPECT_GT(coarser, 2);
    // Every point of the file, against the store.
    ASSERT_EQ(j["originals"].size(), 1u);
    const size_t points = test::samplesOf(test::Shape::torus, 4'000, 3).size();
    EXPECT_EQ(j["originals"][0]["points"], points);
    EXPECT_EQ(j["originals"][0]["records"], points);
    for (const char* beyond : {"places_beyond", "normals_beyond", "colours_beyond"})
        EXPECT_EQ(j["originals"][0][beyond], 0) << beyond;
    // A cold start, and a jump to each other path.
    ASSERT_EQ(j["arrivals"].size(), 4u);
    EXPECT_EQ(j["arrivals"][0]["event"], "cold start");
    EXPECT_EQ(j["arrivals"][3]["event"], "jump to grazing");
    EXPECT_GT(j["arrivals"][0]["bytes"], 10'000);
    for (const auto& a : j["arrivals"]) EXPECT_TRUE(a["is_complete"]) << a.dump();
    EXPECT_EQ(linesOf(folder / "s/rows.csv"), 1u + 24 * 2 * 2) << "a row a frame";
    EXPECT_EQ(linesOf(folder / "s/errors.csv"), 1u + 24);
    const std::string html = test::slurp(folder / "s/report.html");
    size_t charts = 0;
    for (size_t at = html.find("<svg"); at != std::string::npos; at = html.find("<svg", at + 1)) ++charts;
    EXPECT_EQ(charts, 10u);
    EXPECT_NE(html.find("data:image/png;base64,iVBORw0KGgo"), std::string::npos) << "crops";
    for (const char* outside : {"src=\"http", "href=\"http", "<script", "@import", "url("})
        EXPECT_EQ(html.find(outside), std::string::npos) << outside;
    for (const char* plot : {"error-ms", "flip-ms", "detail-ms", "bounds", "error-bytes", "frames", "passes", "budgets",
                             "arrival-seconds", "arrival-bytes"}) {
        EXPECT_TRUE(fs::exists(folder / (std::string("s/plots/s0-96x64-") + plot + ".svg"))) << plot;
        EXPECT_TRUE(
            nlohmann::json::accept(test::slurp(folder / (std::string("s/plots/s0-96x64-") + plot + ".vl.json"))))
            << plot;
    }
}

TEST(SceneStudy, ErrorsAreTheSameBytesAndItGoesOnWhereItStopped) {
    const test::TempFolder folder;
    writeScene(folder);
    ASSERT_EQ(test::runProgram(folder, std::string(kSmall) + "-o a --threads 1").code, 0);
    ASSERT_EQ(test::runProgram(folder, std::string(kSmall) + "-o b --threads 2 --seed 5").code, 0);
    const std::string errors = test::slurp(folder / "a/errors.csv");
    EXPECT_EQ(errors, test::slurp(folder / "b/errors.csv"));
    EXPECT_EQ(test::slurp(folder / "a/truths.csv"), test::slurp(folder / "b/truths.csv"));
    for (const auto& crop : fs::directory_iterator(folder / "a/crops"))
        EXPECT_EQ(test::slurp(crop.path()), test::slurp(folder / ("b/crops/" + crop.path().filename().string())));
    // As if it had been killed in the midst of errors, and of a visit.
    const std::string times = test::slurp(folder / "a/times.csv");
    size_t line = 0;
    for (int i = 0; i < 8; ++i) line = times.find('\n', line) + 1;
    test::spit(folder / "a/errors.csv", errors.substr(0, errors.size() / 2));
    test::spit(folder / "a/times.csv", times.substr(0, line) + times.substr(line, 3));
    const test::Outcome again = test::runProgram(folder, std::string(kSmall) + "-o a --threads 1");
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(test::slurp(folder / "a/errors.csv"), errors);
    const std::string resumed = test::slurp(folder / "a/times.csv");
    size_t whole = 0;  // the head and three visits of two frames
    for (int i = 0; i < 7; ++i) whole = times.find('\n', whole) + 1;
    EXPECT_EQ(resumed.substr(0, whole), times.substr(0, whole)) << "what was finished is kept";
    EXPECT_EQ(std::count(resumed.begin(), resumed.end(), '\n'), 1 + 24 * 2 * 2);
    EXPECT_EQ(linesOf(folder / "a/rows.csv"), 1u + 24 * 2 * 2);
}

TEST(SceneStudy, RefusesWhatItCannotDoBeforeItBegins) {
    const test::TempFolder folder;
    writeScene(folder);
    ASSERT_EQ(test::runProgram(folder, std::string(kSmall) + "-o a").code, 0);
    test::expectOneLine(test::runProgram(folder, std::string(kSmall) + "-o a --seed 9"), 4, {"another study", "seed"});
    test::expectOneLine(test::runProgram(folder, "study -o t"), 2, {"SCENE", "--seeds"});
    test::expectOneLine(test::runProgram(folder, "study nowhere.ply -o t --quiet"), 3, {"nowhere.ply"});
    test::expectOneLine(test::runProgram(folder, std::string(kSmall) + "-o ring.ply"), 4, {"ring.ply"});
    fs::create_directory(folder / "full");
    test::spit(folder / "full/letter.txt", "mine");
    test::expectOneLine(test::runProgram(folder, std::string(kSmall) + "-o full"), 4, {"no folder of a study"});
    EXPECT_EQ(test::slurp(folder / "full/letter.txt"), "mine");
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --modes surfaces"), 2, {"surface"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --sizes big"), 2, {"big"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --errors 0"), 2, {"--errors"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --budgets few"), 2, {"--budgets few"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --builds fine"), 2, {"fine-normals"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --seeds"), 2, {"--seeds"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply -o t --rounds 3"), 2, {"--rounds"});
    EXPECT_FALSE(fs::exists(folder / "t"));
}

/// A torus of triangles, its radii times `scale`, as text.
void writeTorus(const std::string& path, double scale, bool hasGround = false) {
    lod::TriangleMesh mesh = test::torusMesh(120, 60);
    if (hasGround) {
        const auto first = static_cast<uint32_t>(mesh.position.size());
        for (const auto& [x, z] : {std::pair{-3, 3}, {3, 3}, {3, -3}, {-3, -3}}) mesh.position.emplace_back(x, -2, z);
        for (const uint32_t corner : {0u, 1u, 2u, 0u, 2u, 3u}) mesh.indices.push_back(first + corner);
    }
    std::string text = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement "
        "face "
        "{}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.position.size(), mesh.indices.size() / 3);
    for (const glm::dvec3& p : mesh.position) text += fmt::format("{} {} {}\n", scale * p.x, scale * p.y, scale * p.z);
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
        text += fmt::format("3 {} {} {}\n", mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2]);
    test::spit(path, text);
}

TEST(SceneStudy, AuditsPatchesAgainstTheMeshThatTheyWereBuiltFrom) {
    const test::TempFolder folder;
    writeTorus(folder / "torus.ply", 1);
    writeTorus(folder / "larger.ply", 1.05);
    ASSERT_EQ(test::runProgram(folder, "build torus.ply --patches -o p.stipple --quiet").code, 0);
    const std::string study =
        "study p.stipple --errors 0.5,4 --sizes 160x120 --views 1 --blocks 1 --frames 1 --budgets none --quiet --json ";
    const auto auditOf = [&](const std::string& more) {
        const test::Outcome r = test::runProgram(folder, study + more);
        EXPECT_EQ(r.code, 0) << r.err;
        nlohmann::json j = nlohmann::json::parse(r.out, nullptr, false);
        double beyond = 0;
        for (const auto& c : j["configurations"]) {
            EXPECT_GT(c["errors"]["audited_pixels"], 5'000);
            beyond += c["errors"]["beyond_pixels"].get<double>();
        }
        std::printf("%s: %.0f beyond, against %s\n", more.c_str(), beyond,
                    j["scenes"][0]["audited_against"].get<std::string>().c_str());
        return std::pair(beyond, j["scenes"][0]["audited_against"].get<std::string>());
    };
    EXPECT_EQ(auditOf("--against torus.ply -o a"), std::pair(0.0, std::string("torus.ply")));
    EXPECT_EQ(auditOf("-o b").second, "leaves");
    EXPECT_GT(auditOf("--against larger.ply -o c").first, 1'000) << "the control: a mesh 5 % farther out";
    test::expectOneLine(test::runProgram(folder, study + "--against larger.ply -o a"), 4, {"another study", "against"});
    for (const char* odd :
         {"study torus.ply --against torus.ply -o d", "study p.stipple p.stipple --against torus.ply -o d",
          "study p.stipple --against p.stipple -o d"})
        test::expectOneLine(test::runProgram(folder, std::string(odd) + " --quiet"), 2, {"--against"});
    EXPECT_FALSE(fs::exists(folder / "d"));
}

TEST(SceneStudy, AuditsShadowsOfALightThatCasts) {
    const test::TempFolder folder;
    writeTorus(folder / "torus.ply", 1, true);
    ASSERT_EQ(test::runProgram(folder, "build torus.ply -o t.stipple --quiet").code, 0);
    const auto auditOf = [&](const std::string& name, const std::string& light) {
        test::spit(folder / (name + ".gltf"), fmt::format(R"({{"asset": {{"version": "2.0"}}, "scene": 0,
            "scenes": [{{"nodes": [0, 1]}}], "extensionsUsed": ["STIPPLE_store", "KHR_lights_punctual"],
            "nodes": [{{"extensions": {{"STIPPLE_store": {{"uri": "t.stipple"}}}}}},
                      {{"rotation": [-0.5, 0, 0, 0.8660254],
                       "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}],
            "extensions": {{"KHR_lights_punctual": {{"lights": [{{"type": "{}", "intensity": 3}}]}}}}}})",
                                                          light));
        const test::Outcome r = test::runProgram(
            folder, fmt::format("study {0}.gltf -o {0} --modes surface --errors 1 --sizes 240x180 --views 1 --blocks 1 "
                                "--frames 1 --budgets none --quiet --json",
                                name));
        EXPECT_EQ(r.code, 0) << r.err;
        return nlohmann::json::parse(r.out, nullptr, false);
    };
    const nlohmann::json sun = auditOf("sun", "directional"), point = auditOf("point", "point");
    EXPECT_GT(sun["audit"]["shadow_pixels"], 10'000);
    EXPECT_EQ(sun["audit"]["shadow_beyond"], 0);
    const nlohmann::json& errors = sun["configurations"][0]["errors"];
    EXPECT_GT(errors["shadow_dark"], 200) << "the ring's shadow on the ground";
    EXPECT_GE(errors["shadow_wrong"], 0);
    EXPECT_NE(test::slurp(folder / "sun/report.html").find("Shadows: 0 of "), std::string::npos);
    EXPECT_EQ(point["audit"]["shadow_pixels"], 0) << "it casts none";
    EXPECT_EQ(test::slurp(folder / "point/report.html").find("Shadows:"), std::string::npos);
}

/// A chunk that two instances need lies in its file once.
TEST(SceneStudy, CountsTheBytesOfSharedChunksOnce) {
    const test::TempFolder folder;
    auto points = test::samplesOf(test::Shape::torus, 4'000, 3);
    for (test::TestPoint& p : points) p.normal = {0, 0, 1};  // no node faces away
    test::writePly(folder / "ring.ply", points);
    const auto executor = makeTbbExecutor(2);
    const auto store = test::buildAndOpen(folder / "ring.ply", folder / "ring.stipple", *executor);
    uint64_t chunks = 0;
    for (uint32_t n = 0; n < store->hierarchy.nodes.size(); ++n) chunks += lod::chunkPlace(store->hierarchy, n).bytes;
    lod::View view;
    view.eye = {0, 0, 5};
    view.width = view.height = 64;
    view.focalPixels = 60;
    for (const size_t count : {1, 2}) {
        study::StudyScene scene;
        for (size_t i = 0; i < count; ++i) {
            lod::Instance place;
            place.translation = {0.1 * static_cast<double>(i), 0, 0};
            scene.placed.push_back({store, place, {}});
        }
        study::SceneDrawer drawer(scene, cpu::makeCpuBackend(*executor), *executor, uint64_t{1} << 28);
        ASSERT_TRUE(drawer.draw(view, render::Mode::surface, 0.01));
        EXPECT_EQ(drawer.cutBytes(), chunks);
    }
}

TEST(SceneStudy, BuildsScenesInOtherWays) {
    const test::TempFolder folder;
    auto points = test::samplesOf(test::Shape::torus, 4'000, 3);
    points.insert(points.end(), points.begin(), points.begin() + 1'000);
    test::writePly(folder / "ring.ply", points);
    const test::Outcome r = test::runProgram(
        folder,
        "study ring.ply --builds usual,merged --modes surface --errors 2 --sizes 96x64 --views 1 --blocks 1 "
        "--frames 1 --budgets none --quiet --json -o s");
    ASSERT_EQ(r.code, 0) << r.err;
    const nlohmann::json j = nlohmann::json::parse(r.out, nullptr, false);
    ASSERT_EQ(j["scenes"].size(), 2u);
    EXPECT_EQ(j["scenes"][1]["name"], "ring.ply (merged)");
    EXPECT_NE(j["scenes"][0]["content"], j["scenes"][1]["content"]);
    EXPECT_EQ(j["configurations"].size(), 2u);
    EXPECT_EQ(j["budgets"].size(), 0u);
}

TEST(SceneStudy, CalibratesAndChoosesErrorsByWhatFramesCost) {
    const test::TempFolder folder;
    writeScene(folder);
    const std::string render = "render ring.ply -o p.png --size 96x64 --device cpu --threads 1 ";
    test::expectOneLine(test::runProgram(folder, render + "--quiet --target-ms 50"), 3, {"study SCENE --calibrate"});
    EXPECT_FALSE(fs::exists(folder / "p.png"));
    const test::Outcome made =
        test::runProgram(folder,
                         "study ring.ply --calibrate --modes surface --errors 1,4 --sizes 96x64,192x128 "
                         "--blocks 2 --frames 2 --threads 1 --quiet --json");
    ASSERT_EQ(made.code, 0) << made.err;
    const nlohmann::json j = nlohmann::json::parse(made.out, nullptr, false);
    ASSERT_EQ(j["samples"].size(), 2u * 2 * 4);
    for (const auto& s : j["samples"]) EXPECT_GT(s["ms"], 0);
    const test::Outcome plenty = test::runProgram(folder, render + "--target-ms 10000");
    ASSERT_EQ(plenty.code, 0) << plenty.err;
    EXPECT_NE(plenty.out.find("0.125 px of error: "), std::string::npos) << plenty.out;
    EXPECT_NE(plenty.out.find(" ms a frame by the calibration"), std::string::npos) << plenty.out;
    const std::string picture = test::slurp(folder / "p.png");
    ASSERT_EQ(test::runProgram(folder, render + "--error 0.125").code, 0);
    EXPECT_EQ(test::slurp(folder / "p.png"), picture) << "a picture of that error, and nothing else";
    EXPECT_NE(test::runProgram(folder, render + "--target-error 2").out.find("2 px of error: "), std::string::npos);
    test::expectOneLine(test::runProgram(folder, render + "--quiet --target-ms 10 --mode ewa"), 3, {"--modes ewa"});
    test::expectOneLine(test::runProgram(folder, render + "--quiet --target-ms 10 --mode reference"), 2, {"reference"});
    test::expectOneLine(test::runProgram(folder, render + "--quiet --target-ms 10 --error 1"), 2, {"--error"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply --calibrate -o x"), 2, {"--output"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply --data x -o x"), 2, {"--data"});
    test::expectOneLine(test::runProgram(folder, "study ring.ply"), 2, {"--output"});
}

}  // namespace
}  // namespace stipple
