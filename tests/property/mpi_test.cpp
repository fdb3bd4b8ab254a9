// Points built by several processes together: the file is the one that a single process writes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

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
    const std::string command = fmt::format(
        "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 {} --oversubscribe --bind-to none -n {} {} {} "
        ">{} 2>{}",
        kMpirun, ranks, STIPPLE_PROGRAM, arguments, folder / "out", folder / "err");
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

class Mpi : public ::testing::Test {
  protected:
    void SetUp() override {
        if (*kMpirun == 0) GTEST_SKIP() << "built without MPI: builds by several ranks are not tested";
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
    // What is no cloud of points is not for several ranks.
    test::spit(folder / "a.swc", "1 1 0 0 0 1 -1\n2 3 1 0 0 1 1\n");
    EXPECT_EQ(mpirun(2, "build " + (folder / "a.swc") + " --mpi -o " + out, folder), 2);
    EXPECT_NE(test::slurp(folder / "err").find("only points"), std::string::npos);
    // A folder that cannot be made.
    EXPECT_EQ(mpirun(2, command + " --skip-bad --temp /proc/nowhere", folder), 4);
}

}  // namespace
}  // namespace stipple::lod
