// The study: its measures on what is known beforehand, and `stipple study --seeds` as a person runs it.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/study/papers.h"
#include "apps/study/pictures.h"
#include "apps/study/study.h"
#include "engine/cpu/cpu_backend.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

render::Image filled(uint32_t width, uint32_t height, uint32_t rgba) {
    render::Image image;
    image.width = width;
    image.height = height;
    image.rgba.assign(size_t{width} * height, rgba);
    return image;
}

TEST(Study, PicturesStandBesideEachOther) {
    const render::Image red = filled(4, 3, 0x0000ffu), blue = filled(2, 3, 0xffff0000u);
    const render::Image row = study::sideBySide({red, blue});
    ASSERT_EQ(row.width, 4u + 4 + 2);
    ASSERT_EQ(row.height, 3u);
    EXPECT_EQ(row.rgba[0], 0xff0000ffu) << "opaque";
    EXPECT_EQ(row.rgba[5], 0xffffffffu) << "the gap";
    EXPECT_EQ(row.rgba[29], 0xffff0000u);
    const render::Image column = study::stacked({red, blue});
    ASSERT_EQ(column.width, 4u);
    ASSERT_EQ(column.height, 3u + 4 + 3);
    EXPECT_EQ(column.rgba[4 * 9], 0xffff0000u);
    render::Image part = filled(4, 4, 0);
    part.rgba[4 * 2 + 1] = 7;
    const render::Image zoomed = study::cropped(part, 1, 2, 2, 2, 3);
    ASSERT_EQ(zoomed.width, 6u);
    EXPECT_EQ(zoomed.rgba[0], 7u);
    EXPECT_EQ(zoomed.rgba[6 * 2 + 2], 7u);
    EXPECT_EQ(zoomed.rgba[3], 0u);
}

/// A sphere of facets as an OBJ.
std::string objSphere(int rings) {
    std::string text;
    const int sides = 2 * rings;
    for (int r = 0; r <= rings; ++r)
        for (int s = 0; s < sides; ++s) {
            const double a = 3.14159265358979 * r / rings, b = 2 * 3.14159265358979 * s / sides;
            const double p[3] = {std::sin(a) * std::cos(b), std::cos(a), -std::sin(a) * std::sin(b)};
            char line[120];
            std::snprintf(line, sizeof line, "v %.9f %.9f %.9f\nvn %.9f %.9f %.9f\n", p[0], p[1], p[2], p[0], p[1],
                          p[2]);
            text += line;
        }
    for (int r = 0; r < rings; ++r)
        for (int s = 0; s < sides; ++s) {
            const int a = r * sides + s + 1, b = r * sides + (s + 1) % sides + 1, c = a + sides, d = b + sides;
            char line[160];
            std::snprintf(line, sizeof line, "f %d//%d %d//%d %d//%d\nf %d//%d %d//%d %d//%d\n", a, a, c, c, b, b, b, b,
                          c, c, d, d);
            text += line;
        }
    return text;
}

TEST(Study, OutlinesOfASphereAreWhatTheyAre) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::spit(folder / "sphere.obj", objSphere(60));
    const auto sphere = study::readSurface(folder / "sphere.obj", folder.path());
    ASSERT_TRUE(sphere) << sphere.error().line();
    EXPECT_NEAR(sphere->area, 4 * 3.14159265, 0.02);
    study::OutlineSettings settings;
    settings.folder = folder.path();
    settings.size = 300;
    settings.spacings = {3, 10};
    settings.azimuths = {10};
    const auto rows = study::measureOutlines(
        *sphere, settings, [&] { return cpu::makeCpuBackend(*executor); }, *executor);
    ASSERT_TRUE(rows) << rows.error().line();
    const size_t kinds = render::reconstructions().size() + 1;
    ASSERT_EQ(rows->size(), 2 * kinds);
    for (size_t i = 0; i < kinds; ++i) {
        const study::OutlineRow &fine = (*rows)[i], &coarse = (*rows)[kinds + i];
        EXPECT_EQ(fine.what, coarse.what);
        EXPECT_NEAR(static_cast<double>(fine.points) / static_cast<double>(coarse.points), 100.0 / 9, 0.2);
        if (fine.what == "points") {  // open: the control
            EXPECT_LT(fine.overlap, 0.8);
            continue;
        }
        EXPECT_GT(fine.overlap, 0.96) << fine.what;
        EXPECT_LT(fine.distance, 2) << fine.what;
        EXPECT_LE(fine.outside, fine.distance) << fine.what;
        if (fine.what == "splat") EXPECT_GT(fine.outside, 0.5 * fine.distance) << "discs touch the ball from outside";
        EXPECT_LT(fine.normal, 3) << fine.what;
        EXPECT_GT(coarse.distance, fine.distance) << fine.what;
        // Discs of 10 px are wide enough to be smoothed, those of 3 are facets.
        if (fine.what != "surface") EXPECT_GT(coarse.normal, fine.normal) << fine.what;
    }
    EXPECT_EQ(rows->back().what, "traced discs");
    EXPECT_EQ(rows->back().discOverlap, 1);
    EXPECT_EQ(rows->back().discNormal, 0);
}

TEST(Study, EveryRowOfThePapersHasAModelAndFigures) {
    EXPECT_EQ(study::modelRows().size(), 18u);
    for (const study::ModelRow& r : study::modelRows()) {
        EXPECT_GT(r.points, 50'000u);
        EXPECT_FALSE(r.sizes.empty());
        EXPECT_NE(std::string_view(r.theirs).find_first_of("0123456789"), std::string_view::npos);
    }
}

TEST(Study, SeedsWithoutDataNameWhatIsMissing) {
    const test::TempFolder folder;
    test::expectOneLine(test::runProgram(folder, "study --seeds --quick -o s --data nowhere --quiet"), 3,
                        {"nowhere", "--data"});
    EXPECT_FALSE(fs::exists(folder / "s"));
    fs::create_directory(folder / "empty");
    const test::Outcome r = test::runProgram(folder, "study --seeds --quick --rounds 1 -o s --data empty --json");
    ASSERT_EQ(r.code, 0) << r.err;
    const nlohmann::json j = nlohmann::json::parse(r.out, nullptr, false);
    ASSERT_TRUE(j.is_object());
    EXPECT_EQ(r.err.find("gzip"), std::string::npos) << r.err;
    EXPECT_EQ(j["schema"], "stipple.study/2");
    ASSERT_EQ(j["models"].size(), 1u) << "the checker plane";
    EXPECT_GE(j["not_made"].size(), 10u);
    const auto& errors = j["models"][0]["errors"];
    // (All its discs lie in one plane: which of them is the nearest is left to rounding.)
    for (const char* mode : {"ewa", "points"}) {
        EXPECT_TRUE(errors[mode]["implementation_db"] == "inf" || errors[mode]["implementation_db"] > 50) << mode;
    }
    const auto& open = j["pinholes"]["open"];
    EXPECT_GT(j["pinholes"]["pixels"], 100'000);
    EXPECT_EQ(open["splat"], 0);
    EXPECT_EQ(open["ewa"], 0);
    EXPECT_EQ(open["pullpush-exact"], 0);
    EXPECT_GT(open["points"], 1'000) << "the control";
    const std::string index = test::slurp(folder / "s/index.md");
    EXPECT_NE(index.find("Ren, Pfister & Zwicker 2002, Table 1"), std::string::npos);
    EXPECT_NE(index.find("![A checker plane to the horizon](checkers.png)"), std::string::npos);
    EXPECT_TRUE(fs::exists(folder / "s/checkers.png"));
    EXPECT_EQ(nlohmann::json::parse(test::slurp(folder / "s/seeds.json"))["pinholes"], j["pinholes"]);
    EXPECT_GE(j["machine"]["threads"], 1);
    EXPECT_EQ(j["machine"]["date"].get<std::string>().size(), 10u);
    EXPECT_NE(test::slurp(folder / "s/index.md").find(j["machine"]["processor"].get<std::string>()), std::string::npos);
    test::expectOneLine(test::runProgram(folder, "study -o t"), 2, {"--seeds"});
}

}  // namespace
}  // namespace stipple
