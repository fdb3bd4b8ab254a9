// A picture that misses something is not fine: exit codes and figures of `render`, of one view and of paths.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class Complete : public testing::Test {
  protected:
    void SetUp() override {
        const auto executor = makeTbbExecutor(2);
        test::writePly(folder_ / "a.ply", test::bumpySphere(60'000, 1));
        test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor, 2048);
        breakLeaves();
        // Looks at the sphere first, and away from it at the end.
        test::spit(folder_ / "path.json",
                   R"({"keys": [{"t": 0, "eye": [0,0,2], "target": [0,0,0], "up": [0,1,0]},
                                {"t": 1, "eye": [0,0,2], "target": [0,0,0.5], "up": [0,1,0]},
                                {"t": 1.01, "eye": [0,0,9], "target": [0,0,20], "up": [0,1,0]},
                                {"t": 2, "eye": [0,0,9], "target": [0,0,20], "up": [0,1,0]}]})");
    }
    /// A byte of every leaf's chunk changed.
    void breakLeaves() const {
        std::string file = test::slurp(folder_ / "a.stipple");
        const auto store = lod::openStore(folder_ / "a.stipple");
        for (const lod::Node& n : store->hierarchy.nodes)
            if (n.isLeaf()) file[n.chunkOffset + n.chunkBytes / 2] ^= 1;
        test::spit(folder_ / "bad.stipple", file);
    }
    int run(const std::string& arguments) {
        std::filesystem::remove(folder_ / "p.png");
        const int code = test::shell("cd " + folder_.path() + "; export XDG_CACHE_HOME=" + folder_.path() + "/cache",
                                     "render " + arguments, folder_.path());
        out_ = test::slurp(folder_ / "out");
        err_ = test::slurp(folder_ / "err");
        // Half of the path looks away from the sphere, which a note says.
        if (err_.starts_with("note: ") && err_.find("show nothing of the scene") < err_.find('\n'))
            err_.erase(0, err_.find('\n') + 1);
        return code;
    }
    void expectOneErrorLine(const std::string& text) const {
        EXPECT_EQ(std::count(err_.begin(), err_.end(), '\n'), 1) << err_;
        EXPECT_EQ(err_.rfind("stipple: ", 0), 0u) << err_;
        EXPECT_NE(err_.find(text), std::string::npos) << err_;
    }
    bool hasPicture() const { return std::filesystem::exists(folder_ / "p.png"); }

    test::TempFolder folder_;
    std::string out_, err_;
    const std::string size_ = " --size 200x120 --device cpu --error 0.3 ";
};

TEST_F(Complete, ABudgetBelowTheCoarsestLevelHasNoErrorToState) {
    // The coarsest level of the root's overview has six records.
    EXPECT_EQ(run("a.stipple -o p.png --json --budget-points 3" + size_), 6) << err_;
    expectOneErrorLine("--budget-points");
    EXPECT_TRUE(hasPicture());
    const auto j = nlohmann::json::parse(out_);
    EXPECT_FALSE(j["complete"].get<bool>());
    EXPECT_EQ(j["tau_eff_px"], "inf");
}

TEST_F(Complete, ABudgetOfSomeLevelOfTheOverviewHasItsError) {
    double before = std::numeric_limits<double>::infinity();
    for (const int budget : {6, 100, 1000}) {
        ASSERT_EQ(run("a.stipple -o p.png --json --budget-points " + std::to_string(budget) + size_), 0) << err_;
        EXPECT_NE(err_.find("records would bring it to 0.3 px"), std::string::npos) << err_;
        EXPECT_TRUE(hasPicture());
        const auto j = nlohmann::json::parse(out_);
        EXPECT_TRUE(j["complete"].get<bool>());
        EXPECT_GT(j["records_drawn"], 0);
        EXPECT_LE(j["records_drawn"], budget);
        EXPECT_LT(j["tau_eff_px"].get<double>(), before);
        EXPECT_GT(j["tau_eff_px"].get<double>(), 0.3);
        before = j["tau_eff_px"];
    }
}

TEST_F(Complete, CorruptChunksAreAnErrorUnlessPermitted) {
    EXPECT_EQ(run("a.stipple -o p.png --quiet" + size_), 0) << err_;
    EXPECT_EQ(err_, "");
    EXPECT_EQ(run("bad.stipple -o p.png --quiet" + size_), 3);
    EXPECT_TRUE(hasPicture()) << "it is written all the same";
    expectOneErrorLine("cannot be read");
    EXPECT_NE(err_.find("--skip-bad"), std::string::npos) << err_;
    EXPECT_EQ(run("bad.stipple -o p.png --quiet --skip-bad" + size_), 0) << err_;
    EXPECT_EQ(err_, "");
    EXPECT_EQ(run("bad.stipple -o p.png --skip-bad" + size_), 0);
    EXPECT_NE(err_.find("cannot be read"), std::string::npos) << "a note";
    EXPECT_EQ(run("bad.stipple -o p.png --quiet --no-wait" + size_), 0) << err_;
    EXPECT_EQ(run("bad.stipple -o p.png --json" + size_), 3);
    const auto j = nlohmann::json::parse(out_);
    EXPECT_EQ(j["complete"], false);
    EXPECT_GT(j["tau_eff_px"].get<double>(), 0.6);
}

TEST_F(Complete, EveryFrameOfAPathIsJudgedAndTheWorstIsTold) {
    EXPECT_EQ(run("bad.stipple -o p.png --json --camera-path path.json --frames 8" + size_), 3);
    const auto j = nlohmann::json::parse(out_);
    EXPECT_EQ(j["complete"], false) << "the last frames see nothing";
    EXPECT_GT(j["tau_eff_px"].get<double>(), 0.6);
    const auto incomplete = j["incomplete_pictures"].get<int>();
    EXPECT_GE(incomplete, 3);
    EXPECT_LE(incomplete, 5);
    EXPECT_LT(j["worst_picture"].get<int>(), 5);
    expectOneErrorLine(std::to_string(incomplete) + " of 8 pictures are incomplete");
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(std::filesystem::exists(folder_ / ("p_000" + std::to_string(i) + ".png")));
    EXPECT_EQ(run("a.stipple -o p.png --json --camera-path path.json --frames 8" + size_), 0);
    const auto whole = nlohmann::json::parse(out_);
    EXPECT_EQ(whole["complete"], true);
    EXPECT_EQ(whole["incomplete_pictures"], 0);
    EXPECT_LE(whole["tau_eff_px"].get<double>(), 0.3001);
}

TEST_F(Complete, TooLittleMemoryForChunksIsAnErrorABudgetOfPointsIsNot) {
    EXPECT_EQ(run("a.stipple -o p.png --quiet --resident 200K" + size_), 6);
    EXPECT_TRUE(hasPicture());
    expectOneErrorLine("--resident 200K");
    EXPECT_EQ(run("a.stipple -o p.png --quiet --resident 200K --orbit 3" + size_), 6);
    EXPECT_EQ(run("a.stipple -o p.png --quiet --resident 200K --skip-bad" + size_), 6) << "nothing is bad";
    EXPECT_EQ(run("a.stipple -o p.png --quiet --resident 200K --no-wait" + size_), 0);
    EXPECT_EQ(run("a.stipple -o p.png --json --budget-points 20k" + size_), 0) << err_;
    EXPECT_EQ(nlohmann::json::parse(out_)["complete"], true);
    EXPECT_EQ(run("a.stipple -o p.png --quiet --resident 1K" + size_), 6);
    EXPECT_FALSE(hasPicture()) << "there is nothing to show";
}

TEST_F(Complete, OneThreadIsEnoughForEveryCommand) {
    for (const std::string cores : {"", "taskset -c 0 "}) {
        const std::string threads = cores.empty() ? " --threads 1" : "";
        const auto command = [&](const std::string& arguments) {
            const std::string line = "cd " + folder_.path() + " && XDG_CACHE_HOME=" + folder_.path() + "/cache" +
                                     " timeout -s KILL 100 " + cores + STIPPLE_PROGRAM + " " + arguments + threads +
                                     " >/dev/null 2>err";
            const int status = std::system(line.c_str());
            EXPECT_EQ(WIFEXITED(status) ? WEXITSTATUS(status) : -1, 0) << line << "\n" << test::slurp(folder_ / "err");
            std::filesystem::remove_all(folder_ / "cache");
        };
        command("build a.ply -o b.stipple");
        command("render a.stipple -o p.png" + size_);
        command("render a.stipple -o p.png --orbit 3" + size_);
        command("render a.stipple -o p.png --no-wait" + size_);
        command("render a.ply -o p.png --mode reference --samples 1 --size 32x32");
        command("render a.stipple -o p.png --device reference --size 32x32");
    }
    for (const std::string arguments :
         {"grow tree -o t.glb --leaves 500 --as triangles", "build t.glb -o t.stipple", "info t.stipple --verify",
          "render t.stipple -o p.png --size 64x64", "convert t.glb --curves -o s.stipple"}) {
        const std::string line = "cd " + folder_.path() + " && XDG_CACHE_HOME=" + folder_.path() +
                                 "/cache timeout -s KILL 100 taskset -c 0 " + STIPPLE_PROGRAM + " " + arguments +
                                 " >/dev/null 2>err";
        EXPECT_EQ(std::system(line.c_str()), 0) << line << "\n" << test::slurp(folder_ / "err");
    }
}

}  // namespace
}  // namespace stipple
