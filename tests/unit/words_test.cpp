// What the program says: whose help an error names, what was probably meant, help that can be read, JSON that can be
// parsed, coordinates with their own digits.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace stipple {
namespace {

using test::expectOneLine;
using test::Outcome;
using test::runProgram;
using test::TempFolder;

TEST(Words, UsageErrorsNameTheirCommandsHelp) {
    const TempFolder folder;
    const auto expect = [&](const std::string& arguments, const std::vector<std::string>& texts) {
        SCOPED_TRACE(arguments);
        expectOneLine(runProgram(folder, arguments), 2, texts);
    };
    expect("frobnicate", {"frobnicate: is neither a command nor a file", "see stipple --help"});
    expect("render", {"SCENE is missing", "see stipple render --help"});
    expect("render a.las", {"--output is missing", "see stipple render --help"});
    expect("build a.las -o a.stipple --memory potato", {"--memory: 'potato'", "see stipple build --help"});
    expect("build a.las -o a.stipple --memory", {"--memory: needs a value", "see stipple build --help"});
    expect("compare a.png b.png c.png", {"'c.png' is one argument too many", "see stipple compare --help"});
    expect("grow", {"needs one of scan, rock", "see stipple grow --help"});
    expect("grow scan -o a.las --points many", {"--points: 'many'", "see stipple grow scan --help"});
    expect("render a.las -o a.png --orbit 3 --camera-path p.json", {"--camera-path", "stipple render --help"});
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()) || !std::filesystem::exists(folder / "a.stipple"));
}

TEST(Words, ProposesWhatWasProbablyMeant) {
    const TempFolder folder;
    const auto expect = [&](const std::string& arguments, const std::string& meant) {
        SCOPED_TRACE(arguments);
        expectOneLine(runProgram(folder, arguments), 2, {"did you mean '" + meant + "'?"});
    };
    expect("rendr a.las -o a.png", "render");
    expect("veiw a.las", "view");
    expect("grow frest -o f.glb", "forest");
    expect("render a.las -o a.png --colr class", "--colour");
    expect("render a.las --ouput a.png", "--output");
    expect("render a.las -o a.png --memry 1G", "--memory");  // of a group of options
    expect("build a.las -o a.stipple --normals fien", "fine");
    expect("render a.las -o a.png --mode pulpush", "pullpush");
    expect("render a.las -o a.png --shade=unlitt", "unlit");
    ASSERT_EQ(runProgram(folder, "grow scan -o s.las --points 500").code, 0);
    expect("render s.las -o a.png --quiet --colour intensty", "intensity");
    expect("render s.las out.png", "-o out.png");
    expect("help budget", "budgets");
    expect("help rendr", "render");
    const Outcome far = runProgram(folder, "render a.las -o a.png --xyzzy 3");
    EXPECT_EQ(far.err.find("did you mean"), std::string::npos) << "nothing is near: " << far.err;
}

TEST(Words, CountsAndSizesAreWrittenAlike) {
    const TempFolder folder;
    const Outcome grown = runProgram(folder, "grow scan -o a.las --points 1.5k --json");
    ASSERT_EQ(grown.code, 0) << grown.err;
    EXPECT_EQ(nlohmann::json::parse(grown.out)["points"], 1500);
    for (const char* bad : {"0x10", "-5", "nan", "inf", "1.5", "0", "10Q"}) {
        SCOPED_TRACE(bad);
        expectOneLine(runProgram(folder, std::string("grow scan -o b.las --points ") + bad), 2, {"--points", bad});
        expectOneLine(runProgram(folder, std::string("grow forest -o b.glb --trees ") + bad), 2, {"--trees", bad});
        expectOneLine(runProgram(folder, std::string("grow tree -o b.glb --leaves ") + bad), 2, {"--leaves", bad});
        if (std::string(bad) != "0")
            expectOneLine(runProgram(folder, std::string("render a.las -o a.png --budget-points ") + bad), 2,
                          {"--budget-points", bad});
    }
    for (const char* bad : {"0x10", "-5", "nan", "10Q"})
        for (const char* option : {"--memory", "--resident"})
            expectOneLine(runProgram(folder, fmt::format("render a.las -o a.png {} {}", option, bad)), 2,
                          {option, bad});
    for (const char* bad : {"0x10", "nan", "inf", "-1", "0"})
        expectOneLine(runProgram(folder, fmt::format("render a.las -o a.png --error {}", bad)), 2, {"--error", bad});
    EXPECT_EQ(runProgram(folder, "grow rock -o a.glb --triangles 1k").code, 0);
    EXPECT_EQ(runProgram(folder, "build a.glb -o b.stipple --surfels 1k --quiet").code, 0);
    EXPECT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    EXPECT_EQ(runProgram(folder, "render a.stipple -o a.png --size 64x48 --budget-points 0.1M --quiet").code, 0);
}

TEST(Words, OutputsThatCannotBeAreFoundBeforeTheWork) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 500").code, 0);
    for (const char* arguments : {"render a.las -o no/a.png", "render a.las -o no/a.png --orbit 3",
                                  "build a.las -o no/a.stipple", "grow scan -o no/b.las --points 500M"})
        expectOneLine(runProgram(folder, arguments), 4, {"there is no folder no"});
    const std::string render = "render a.las -o a.png --size 64x48 ";
    expectOneLine(runProgram(folder, render + "--camera-path no.json"), 3, {"no.json"});
    expectOneLine(runProgram(folder, render + "--environment no.hdr"), 3, {"no.hdr"});
    expectOneLine(runProgram(folder, render + "--background 0,0,256"), 2, {"--background"});
    expectOneLine(runProgram(folder, render + "--background environment"), 2,
                  {"--background environment", "--environment, which is not given"});
    expectOneLine(runProgram(folder, render + "--colour height --colour-map jet"), 2, {"jet"});
    const Outcome cached = runProgram(folder, "cache list");
    EXPECT_EQ(cached.out.find("a.las"), std::string::npos) << "nothing was built: " << cached.out;
    expectOneLine(runProgram(folder, "grow scan -o b.xyz --points 500M"), 2, {".las or .ply"});
}

TEST(Words, AFileInsteadOfACommandIsViewed) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o scan.las --points 500").code, 0);
    expectOneLine(runProgram(folder, "scan.las", "DISPLAY= WAYLAND_DISPLAY="), 5, {"stipple render"});
    expectOneLine(runProgram(folder, "scna.las", "DISPLAY= WAYLAND_DISPLAY="), 2, {"scna.las: is neither"});
}

TEST(Words, WithoutArgumentsTheShortHelpIsPrinted) {
    const TempFolder folder;
    const Outcome r = runProgram(folder, "");
    EXPECT_EQ(r.code, 0);
    EXPECT_EQ(r.err, "");
    EXPECT_NE(r.out.find("A newcomer's three lines:"), std::string::npos) << r.out;
    EXPECT_EQ(r.out, runProgram(folder, "--help").out);
    EXPECT_EQ(r.out, runProgram(folder, "help").out);
    EXPECT_NE(r.out.find("Usage: stipple COMMAND"), std::string::npos) << r.out;
}

TEST(Words, EveryHelpFitsAHundredColumnsAndNamesTheExitCodes) {
    const TempFolder folder;
    std::vector<std::string> commands{"build", "info", "render", "view", "compare", "convert", "grow", "help"};
    for (const char* kind : {"scan", "rock", "building", "terrain", "tree", "orchard", "forest", "meadow", "demo"})
        commands.push_back(std::string("grow ") + kind);
    for (const std::string& command : commands) {
        SCOPED_TRACE(command);
        const Outcome r = runProgram(folder, command + " --help");
        EXPECT_EQ(r.code, 0);
        EXPECT_EQ(r.out.find("newcomer"), std::string::npos) << "only at the top";
        EXPECT_NE(r.out.find("Usage: stipple " + command), std::string::npos) << r.out;
        EXPECT_NE(r.out.find("Exit codes: 0 fine"), std::string::npos) << r.out;
        EXPECT_EQ(r.out.find("TEXT"), std::string::npos) << "values are named: " << r.out;
        std::istringstream lines(r.out);
        for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
        if (command.find(' ') == std::string::npos) EXPECT_EQ(runProgram(folder, "help " + command).out, r.out);
    }
}

TEST(Words, TopicsExplainWhatConcernsSeveralCommands) {
    const TempFolder folder;
    const Outcome budgets = runProgram(folder, "help budgets");
    EXPECT_EQ(budgets.code, 0);
    for (const char* option : {"--memory", "--resident", "--budget-points"})
        EXPECT_NE(budgets.out.find(option), std::string::npos) << budgets.out;
    EXPECT_NE(runProgram(folder, "help exit-codes").out.find("7  interrupted"), std::string::npos);
    EXPECT_NE(runProgram(folder, "help formats").out.find(".laz"), std::string::npos);
    EXPECT_NE(runProgram(folder, "help json").out.find("stipple.error/2"), std::string::npos);
    expectOneLine(runProgram(folder, "help xyzzy"), 2, {"topics: budgets, effects, exit-codes, formats, json"});
}

TEST(Words, ErrorsAreJsonWhereThatIsAskedFor) {
    const TempFolder folder;
    const auto errorOf = [&](const std::string& arguments, int code) {
        const Outcome r = runProgram(folder, arguments);
        EXPECT_EQ(r.code, code) << arguments << r.err;
        const auto j = nlohmann::json::parse(r.out, nullptr, false);
        EXPECT_EQ(j.value("schema", ""), "stipple.error/2") << arguments << r.out;
        EXPECT_EQ(j["error"]["exit"], code) << r.out;
        for (const char* key : {"kind", "what", "where", "hint"}) EXPECT_TRUE(j["error"][key].is_string()) << key;
        return j["error"];
    };
    EXPECT_EQ(errorOf("info missing.las --json", 3)["kind"], "input");
    EXPECT_NE(errorOf("info missing.las --json", 3)["where"].get<std::string>().find("missing.las"), std::string::npos);
    const auto usage = errorOf("render --json a.las", 2);
    EXPECT_EQ(usage["kind"], "usage");
    EXPECT_EQ(usage["hint"], "see stipple render --help");
    EXPECT_EQ(errorOf("frobnicate --json", 2)["kind"], "usage");
    EXPECT_EQ(runProgram(folder, "info missing.las").out, "") << "only where it is asked for";
}

TEST(Words, ErrorsHaveNoCodesOfLibraries) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 500").code, 0);
    test::spit(folder / "bad.gltf", "{\"asset\": {\"version\": \"2.0\"}, nonsense}");
    test::spit(folder / "p.json", "{\"keys\": [{\"t\": \"soon\"}]}");
    test::spit(folder / "q.json", "{\"keys\": [");
    for (const char* arguments : {"info bad.gltf", "render a.las -o a.png --camera-path p.json",
                                  "render a.las -o a.png --camera-path q.json"}) {
        const Outcome r = runProgram(folder, arguments);
        EXPECT_EQ(r.code, 3) << r.err;
        EXPECT_EQ(r.err.find("exception"), std::string::npos) << r.err;
    }
}

TEST(Words, ResultsSayWhichSchemaTheyHave) {
    const TempFolder folder;
    const auto schemaOf = [&](const std::string& arguments) {
        const Outcome r = runProgram(folder, arguments + " --json");
        EXPECT_EQ(r.code, 0) << arguments << r.err;
        return nlohmann::json::parse(r.out, nullptr, false).value("schema", "");
    };
    EXPECT_EQ(schemaOf("grow scan -o a.las --points 1k"), "stipple.grow/2");
    EXPECT_EQ(schemaOf("build a.las -o a.stipple"), "stipple.build/2");
    EXPECT_EQ(schemaOf("info a.las"), "stipple.info/2");
    EXPECT_EQ(schemaOf("info a.stipple"), "stipple.info/2");
    EXPECT_EQ(schemaOf("info a.stipple --at 0,0,0"), "stipple.info/2");
    EXPECT_EQ(schemaOf("render a.stipple -o a.png --size 64x48 --device cpu"), "stipple.render/2");
    EXPECT_EQ(schemaOf("compare a.png a.png"), "stipple.compare/2");
}

TEST(Words, PipedProgressIsSilentUnlessJsonIsAskedFor) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 20k").code, 0);
    EXPECT_EQ(runProgram(folder, "build a.las -o a.stipple --json").err, "") << "--json is about the result";
    EXPECT_EQ(runProgram(folder, "build a.las -o b.stipple").err, "");
    ASSERT_EQ(runProgram(folder, "grow scan -o large.las --points 1M").code, 0);
    const Outcome onDisk =
        runProgram(folder, "build large.las -o c.stipple --memory 135M --threads 2 --progress json --json");
    EXPECT_EQ(onDisk.code, 0) << onDisk.err;
    std::istringstream lines(onDisk.err);
    int found = 0;
    for (std::string line; std::getline(lines, line); ++found)
        EXPECT_EQ(nlohmann::json::parse(line, nullptr, false).value("schema", ""), "stipple.progress/1") << line;
    EXPECT_GT(found, 0) << "the note on temporary files at least";
    const Outcome cached = runProgram(folder, "render a.las -o a.png --size 64x48");
    EXPECT_EQ(cached.code, 0);
    EXPECT_EQ(cached.err.find('{'), std::string::npos) << cached.err;
}

TEST(Words, CoordinatesHaveTheDigitsOfTheScanner) {
    const TempFolder folder;
    test::writeLas(folder / "a.las", {{12, 29, 7}, {1012, 1029, 107}, {2010, 3, 50}}, 0.01,
                   glm::dvec3(500000, 5400000, 0));
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    const Outcome at = runProgram(folder, "info a.stipple --at 500000,5400000,0");
    EXPECT_EQ(at.out.rfind("500000.12 5400000.29 0.07, ", 0), 0u) << at.out;
    const Outcome json = runProgram(folder, "info a.stipple --at 500000,5400000,0 --json");
    EXPECT_NE(json.out.find("5400000.29,"), std::string::npos) << json.out;
    for (const char* file : {"a.stipple", "a.las"}) {
        const Outcome info = runProgram(folder, std::string("info ") + file);
        EXPECT_NE(info.out.find("500000.12 5400000.03 0.07"), std::string::npos) << info.out;
        EXPECT_NE(info.out.find("500020.10 5400010.29 1.07"), std::string::npos) << info.out;
    }
}

}  // namespace
}  // namespace stipple
