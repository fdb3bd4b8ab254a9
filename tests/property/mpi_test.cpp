// Built by several processes together: the file is the one that a single process writes.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "engine/base/process.h"
#include "tests/support/big_inputs.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

#ifdef STIPPLE_MPIRUN
constexpr const char* kMpirun = STIPPLE_MPIRUN;
#else
constexpr const char* kMpirun = "";
#endif

/// The exit code; what was said is in `folder`/out and /err.
int mpirun(int ranks, const std::string& arguments, const test::TempFolder& folder) {
    const std::string command = fmt::format("{} --oversubscribe --bind-to none -n {} {} {} >{} 2>{}", kMpirun, ranks,
                                            STIPPLE_PROGRAM, arguments, folder / "out", folder / "err");
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

class Mpi : public ::testing::Test {
  protected:
    void SetUp() override {
        if (*kMpirun == 0) GTEST_SKIP() << "built without MPI: builds by several ranks are not tested";
        ::setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 1);
        ::setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 1);
        // What Open MPI itself does not give back at the end is not for us to mend.
        const char* const given = std::getenv("ASAN_OPTIONS");
        ::setenv("ASAN_OPTIONS", (std::string(given == nullptr ? "" : given) + ":detect_leaks=0").c_str(), 1);
    }
};

TEST_F(Mpi, TwoAndFourRanksWriteTheBytesOfOneProcess) {
    const test::TempFolder folder;
    Rng rng(3);
    fs::create_directory(folder / "tiles");
    for (int tile = 0; tile < 5; ++tile) {
        std::vector<glm::ivec3> points;
        for (int i = 0; i < 150'000; ++i) {
            const double x = rng.uniform(0, 1e5) + 1e5 * tile, y = rng.uniform(0, 1e5) * rng.uniform();
            points.emplace_back(x, y, 2e3 * std::sin(x * 1e-4) + 20 * rng.normal());
        }
        test::writeLas(folder / fmt::format("tiles/{}.las", tile), points, 0.001, {1e5, 2e6, 0});
    }
    const std::string inputs = folder / "tiles", one = folder / "one.stipple", many = folder / "many.stipple";
    for (const std::string options : {"", " --attributes all --normals fine --duplicates merge", " --normals none"}) {
        const std::string arguments = "build " + inputs + " --quiet --threads 1 --memory 1G" + options + " -o ";
        ASSERT_EQ(std::system((STIPPLE_PROGRAM + (" " + arguments + one) + " >/dev/null").c_str()), 0);
        for (const int ranks : {2, 4}) {
            ASSERT_EQ(mpirun(ranks, arguments + many + " --mpi", folder), 0) << test::slurp(folder / "err");
            EXPECT_TRUE(test::slurp(one) == test::slurp(many)) << ranks << " ranks," << options;
            const std::string said = test::slurp(folder / "out");
            EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
            EXPECT_FALSE(fs::exists(many + ".build"));
            fs::remove(many);
        }
    }
}

TEST_F(Mpi, AnErrorOfOneRankEndsAllOfThemWithOneLine) {
    const test::TempFolder folder;
    fs::create_directory(folder / "tiles");
    // Tile c, which rank 2 of 4 reads, has a row that is no number: nobody else sees that.
    for (const std::string name : {"a", "b", "c", "d"}) {
        std::string text =
            "ply\nformat ascii 1.0\nelement vertex 5000\nproperty float x\nproperty float y\nproperty float z\n"
            "end_header\n";
        for (int i = 0; i < 5000; ++i)
            text += name == "c" && i == 4000 ? "1 x 2\n" : fmt::format("{} {} {}\n", i % 100, i / 100, name[0] - 'a');
        test::spit(folder / ("tiles/" + name + ".ply"), text);
    }
    const std::string out = folder / "a.stipple";
    const std::string command = "build " + (folder / "tiles") + " --mpi --quiet -o " + out;
    EXPECT_EQ(mpirun(4, command, folder), 3);
    const std::string said = test::slurp(folder / "err");
    EXPECT_NE(said.find("c.ply"), std::string::npos) << said;
    size_t lines = 0;
    for (size_t at = 0; (at = said.find("stipple: ", at)) != std::string::npos; ++at) ++lines;
    EXPECT_EQ(lines, 1u) << said;
    EXPECT_FALSE(fs::exists(out));
    // Left out, it is counted.
    EXPECT_EQ(mpirun(4, command + " --skip-bad --json", folder), 0) << test::slurp(folder / "err");
    EXPECT_NE(test::slurp(folder / "out").find("\"points_out\": 15000"), std::string::npos)
        << test::slurp(folder / "out");
    EXPECT_FALSE(fs::exists(out + ".build"));
    // A folder that cannot be made.
    EXPECT_EQ(mpirun(2, command + " --skip-bad --temp /proc/nowhere", folder), 4);
}

/// What one process writes, of all kinds of content.
struct Kind {
    std::string name, arguments;
};
std::vector<Kind> kinds(const test::TempFolder& folder) {
    Rng rng(3);
    std::vector<glm::ivec3> points;
    for (int i = 0; i < 900'000; ++i) {
        const double x = rng.uniform(0, 5e5), y = rng.uniform(0, 1e5) * rng.uniform();
        points.emplace_back(x, y, 2e3 * std::sin(x * 1e-4) + 20 * rng.normal());
    }
    test::writeLas(folder / "points.las", points, 0.001, {1e5, 2e6, 0});
    test::writeGround(folder / "ground.ply", 350, 5, false);
    test::writeLawn(folder / "lawn.hair", 12'000);
    test::spit(folder / "a.swc", "1 1 0 0 0 1 -1\n2 3 1 0 0 1 1\n");
    std::vector<Kind> out;
    for (const std::string name : {"points.las", "ground.ply", "lawn.hair", "a.swc"})
        out.push_back({name, "build " + (folder / name) + " --quiet --threads 1 -o "});
    return out;
}

TEST_F(Mpi, TrianglesAndCurvesAreThoseOfOneProcessToo) {
    const test::TempFolder folder;
    const std::string one = folder / "one.stipple", many = folder / "many.stipple";
    for (const Kind& kind : kinds(folder)) {
        ASSERT_EQ(std::system((STIPPLE_PROGRAM + (" " + kind.arguments + one) + " >/dev/null").c_str()), 0);
        for (const int ranks : {2, 4}) {
            ASSERT_EQ(mpirun(ranks, kind.arguments + many + " --mpi --memory 400M", folder), 0)
                << kind.name << test::slurp(folder / "err");
            EXPECT_TRUE(test::slurp(one) == test::slurp(many)) << ranks << " ranks, " << kind.name;
            EXPECT_FALSE(fs::exists(many + ".build"));
            fs::remove(many);
        }
        fs::remove(one);
    }
}

TEST_F(Mpi, KilledAtAnyMomentTheyGoOnWithAnyNumberOfRanks) {
    const test::TempFolder folder;
    const std::string one = folder / "one.stipple", many = folder / "many.stipple";
    Rng rng(8);
    for (const Kind& kind : kinds(folder)) {
        if (kind.name == "a.swc") continue;
        ASSERT_EQ(std::system((STIPPLE_PROGRAM + (" " + kind.arguments + one) + " >/dev/null").c_str()), 0);
        const std::string input = folder / kind.name;
        // Of a whole build, on this machine as busy as it is.
        const double start = nowSeconds();
        ASSERT_EQ(mpirun(3, kind.arguments + many + " --mpi --memory 400M", folder), 0) << test::slurp(folder / "err");
        const double took = (nowSeconds() - start) * 1e3;
        fs::remove(many);
        const auto isKeeping = [&] { return fs::exists(many + ".build"); };
        int kills = 0, kept = 0;
        const int wanted = test::isThorough() ? 6 : 3;
        for (int run = 0; kills < wanted && run < 30; ++run) {
            const std::string ranks = run % 3 == 2 ? "3" : "2";
            const std::vector<std::string> command{
                kMpirun,   "--oversubscribe", "--bind-to", "none", "-n", ranks,   STIPPLE_PROGRAM, "build", input,
                "--quiet", "--threads",       "1",         "-o",   many, "--mpi", "--memory",      "400M"};
            // Any moment of all, and any after the first of what is kept has been written.
            const bool isDone =
                run % 2 == 0
                    ? test::runAndKill(command, static_cast<int>(took * rng.uniform(0.1, 1)), SIGKILL)
                    : test::runAndKill(command, static_cast<int>(took * rng.uniform(0, 0.4)), SIGKILL, isKeeping);
            test::killAllWith(many);
            kept += isKeeping() ? 1 : 0;
            if (!isDone && !fs::exists(many)) {
                ++kills;
                continue;
            }
            EXPECT_TRUE(test::slurp(one) == test::slurp(many)) << kind.name;
            fs::remove(many);
        }
        ASSERT_EQ(mpirun(3, kind.arguments + many + " --mpi --memory 400M", folder), 0) << test::slurp(folder / "err");
        EXPECT_TRUE(test::slurp(one) == test::slurp(many)) << kind.name;
        EXPECT_FALSE(fs::exists(many + ".build"));
        EXPECT_GE(kills, wanted) << kind.name;
        EXPECT_GE(kept, 1) << kind.name;
        std::printf("%s: %d kills, after %d of them something was kept\n", kind.name.c_str(), kills, kept);
        fs::remove(many);
        fs::remove(one);
    }
}

}  // namespace
}  // namespace stipple::lod
