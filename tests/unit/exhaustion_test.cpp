// Memory that runs out, anywhere: the program ends by itself, soon, with code 0 or 6.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>

#include "engine/base/rng.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class Exhaustion : public testing::Test {
  protected:
    static constexpr int kMost = 4'000'000;  ///< kilobytes of address space, more than any of this takes
    void SetUp() override {
        if (test::isSanitized) GTEST_SKIP() << "address spaces of sanitizers have no limits";
    }
    /// Under a limit of address space (KiB, 0: none); 137 is a program that hangs. Whole runs take half a second of
    /// processor time at most, and one that finds no memory ends earlier: that this is within a second is told from a
    /// hang by any limit, and ten seconds of processor time or thirty by the clock are none that a busy machine
    /// reaches.
    int run(int limit, const std::string& arguments) const {
        const std::string limits = limit > 0 ? "ulimit -v " + std::to_string(limit) + "; " : "";
        const int status = std::system(("cd " + folder_.path() + " && XDG_CACHE_HOME=" + folder_.path() +
                                        "/cache timeout -s KILL 30 bash -c 'ulimit -t 10; " + limits + "exec " +
                                        STIPPLE_PROGRAM + " " + arguments + "' >out 2>err")
                                           .c_str());
        return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
    /// Kilobytes of address space with which the program starts at all.
    int fewest() const {
        int limit = 16'000;
        for (; run(limit, "--help") != 0; limit += 2000)
            if (limit >= kMost) {
                ADD_FAILURE() << "it starts with none: " << test::slurp(folder_ / "err");
                break;
            }
        return limit;
    }
    void sweep(const std::string& arguments) const {
        ASSERT_EQ(run(0, arguments), 0) << test::slurp(folder_ / "err");
        int exhausted = 0, fine = 0;
        for (int limit = fewest(); fine < 2 && limit < kMost; limit += std::max(3000, limit / 14)) {
            const int code = run(limit, arguments);
            const std::string said = test::slurp(folder_ / "err");
            // The C library's own end, where the few bytes that a thread's first variable takes are missing.
            const bool isGlibc = code == 128 + SIGABRT && said.find("Fatal glibc error") != std::string::npos;
            EXPECT_TRUE(code == 0 || code == 6 || isGlibc)
                << arguments << " with " << limit << ": " << code << " " << said;
            exhausted += code == 6 ? 1 : 0;
            fine += code == 0 ? 1 : 0;
        }
        EXPECT_GT(exhausted, 0) << "otherwise nothing was tried: " << arguments;
    }
    test::TempFolder folder_;
};

TEST_F(Exhaustion, BuildsOfPointsEndByThemselves) {
    ASSERT_EQ(run(0, "grow scan -o a.las --points 120000"), 0);
    sweep("build a.las -o a.stipple --quiet --threads 4");
}

TEST_F(Exhaustion, BuildsOfCurvesEndByThemselves) {
    std::string text;
    Rng rng(1);
    for (int i = 1; i <= 12'000; ++i)
        text += fmt::format("{} 3 {:.3f} {:.3f} {:.3f} 0.2 {}\n", i, 0.1 * i, 30 * rng.uniform(), 30 * rng.uniform(),
                            i == 1        ? -1
                            : i % 40 == 0 ? static_cast<int>(1 + rng.below(i - 1))
                                          : i - 1);
    test::spit(folder_ / "a.swc", text);
    sweep("build a.swc -o a.stipple --quiet --threads 4");
}

TEST_F(Exhaustion, BuildsOfTrianglesEndByThemselves) {
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 10000\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 19602\nproperty list uchar int vertex_indices\nend_header\n";
    for (int i = 0; i < 10'000; ++i) text += fmt::format("{} {} {}\n", i % 100, i / 100, i * 7919 % 13 * 0.1);
    for (int y = 0; y < 99; ++y)
        for (int x = 0; x < 99; ++x) {
            const int i = 100 * y + x;
            text += fmt::format("3 {} {} {}\n3 {} {} {}\n", i, i + 1, i + 100, i + 1, i + 101, i + 100);
        }
    test::spit(folder_ / "a.ply", text);
    sweep("build a.ply -o a.stipple --quiet --threads 4");
}

TEST_F(Exhaustion, PicturesEndByThemselves) {
    ASSERT_EQ(run(0, "grow scan -o a.las --points 120000"), 0);
    ASSERT_EQ(run(0, "build a.las -o a.stipple --quiet"), 0);
    sweep("render a.stipple -o a.png --quiet --size 400x300 --device cpu --threads 4");
}

}  // namespace
}  // namespace stipple
