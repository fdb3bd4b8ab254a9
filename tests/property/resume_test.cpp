// A build that is interrupted while its input is brought to its places goes on there, whatever it is built from.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "lod/builder/build.h"
#include "lod/builder/curves/curve_build.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/ply/mesh.h"
#include "tests/support/big_inputs.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

struct Kind {
    std::string input;
    uint64_t memory;    ///< with which it goes through the disk
    std::string place;  ///< how files begin in which its input lies
};
std::vector<Kind> kinds(const test::TempFolder& folder) {
    Rng rng(4);
    std::vector<glm::ivec3> points;
    for (int i = 0; i < 1'200'000; ++i) {
        const double x = rng.uniform(0, 5e5), y = rng.uniform(0, 1e5) * rng.uniform();
        points.emplace_back(x, y, 2e3 * std::sin(x * 1e-4) + 20 * rng.normal());
    }
    test::writeLas(folder / "points.las", points, 0.001, {1e5, 2e6, 0});
    test::writeGround(folder / "ground.ply", 500, 3);
    test::writeLawn(folder / "lawn.hair", 25'000);
    return {{folder / "points.las", uint64_t{125} << 20, "points-"},
            {folder / "ground.ply", uint64_t{190} << 20, "in-"},
            {folder / "lawn.hair", uint64_t{170} << 20, "in-"}};
}

Result<BuildReport> build(const std::string& input, const std::string& output, const BuildLimits& limits) {
    Progress silent(false);
    const auto executor = makeSerialExecutor();
    const std::string kind = fs::path(input).extension();
    if (kind == ".las") {
        BuildSettings settings;
        static_cast<BuildLimits&>(settings) = limits;
        return buildStore({input}, output, settings, *executor, silent);
    }
    if (kind == ".ply") {
        MeshBuildSettings settings;
        settings.limits = limits;
        settings.description.materials.resize(1);
        STIPPLE_ASSIGN(const MeshSource source, openPlyMesh(input, 1 << 20, fs::path(output).parent_path().string()));
        return buildMeshStore(source, output, settings, *executor, silent);
    }
    CurveBuildSettings settings;
    settings.limits = limits;
    STIPPLE_ASSIGN(const CurveSource source, openCurves(input));
    return buildCurveStore(cleanSource(source, 0), output, settings, *executor, silent);
}

class Resume : public ::testing::Test {
  protected:
    const test::TempFolder folder_;
    const std::string output_ = folder_ / "a.stipple", work_ = output_ + ".build";

    bool isDistributing(const Kind& kind) const {
        std::error_code gone;
        if (fs::exists(output_ + ".partial")) return false;
        for (const auto& entry : fs::directory_iterator(work_, gone))
            if (entry.path().filename().string().starts_with(kind.place)) return true;
        return false;
    }
    /// Builds, but stops when asked for the `at`-th time while input is distributed. Counts how often it was asked
    /// before, and while distributing.
    Result<BuildReport> buildUntil(const Kind& kind, int at, int& before, int& distributing) const {
        BuildLimits limits;
        limits.memoryBytes = kind.memory;
        before = distributing = 0;
        limits.isStopped = [&, at] {
            if (fs::exists(output_ + ".partial")) return false;
            if (!isDistributing(kind)) {
                ++before;
                return false;
            }
            return ++distributing == at;
        };
        return build(kind.input, output_, limits);
    }
};

TEST_F(Resume, InTheMiddleOfTheInput) {
    for (const Kind& kind : kinds(folder_)) {
        int counting = 0, all = 0, before = 0, distributing = 0;
        ASSERT_TRUE(buildUntil(kind, -1, counting, all));
        const std::string whole = test::slurp(output_);
        fs::remove(output_);
        ASSERT_GE(all, 6) << kind.input;
        for (const int at : test::isThorough() ? std::vector{all / 2, all - 1} : std::vector{all / 2}) {
            const auto stopped = buildUntil(kind, at, before, distributing);
            ASSERT_FALSE(stopped) << kind.input;
            EXPECT_EQ(stopped.error().kind, ErrorKind::interrupted);
            EXPECT_NE(stopped.error().hint.find("to go on"), std::string::npos);
            EXPECT_TRUE(fs::exists(work_ + "/journal"));
            // (Another run, stopped at once, loses nothing.)
            ASSERT_FALSE(buildUntil(kind, 1, before, distributing));
            EXPECT_LT(before, counting) << "counted again";
            const auto built = buildUntil(kind, -1, before, distributing);
            ASSERT_TRUE(built) << built.error().line();
            EXPECT_TRUE(built->isResumed);
            EXPECT_LT(before, counting) << "counted again";
            EXPECT_TRUE(test::slurp(output_) == whole) << kind.input << ", stopped at " << at << " of " << all;
            EXPECT_FALSE(fs::exists(work_));
            fs::remove(output_);
        }
    }
}

TEST_F(Resume, WithMoreMemoryThanBefore) {
    for (const Kind& kind : kinds(folder_)) {
        int all = 0, before = 0, distributing = 0;
        ASSERT_TRUE(buildUntil(kind, -1, before, all));
        const std::string whole = test::slurp(output_);
        fs::remove(output_);
        ASSERT_FALSE(buildUntil(kind, all - 1, before, distributing));
        const auto built = build(kind.input, output_, {});  // it would fit in memory
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_TRUE(built->isResumed);
        EXPECT_TRUE(test::slurp(output_) == whole) << kind.input;
        EXPECT_FALSE(fs::exists(work_));
        fs::remove(output_);
    }
}

TEST_F(Resume, NotFromInputThatSomebodyChanged) {
    for (const Kind& kind : kinds(folder_)) {
        int all = 0, before = 0, distributing = 0;
        ASSERT_TRUE(buildUntil(kind, -1, before, all));
        fs::remove(output_);
        ASSERT_FALSE(buildUntil(kind, all - 1, before, distributing));
        // What was noted as being in its place is used: its first byte would show in the file.
        for (const auto& entry : fs::directory_iterator(work_)) {
            if (!entry.path().filename().string().starts_with(kind.place) || entry.file_size() == 0) continue;
            std::string bytes = test::slurp(entry.path());
            bytes[10] = static_cast<char>(bytes[10] ^ 1);
            test::spit(entry.path(), bytes);
        }
        const auto built = buildUntil(kind, -1, before, distributing);
        ASSERT_FALSE(built) << kind.input;
        EXPECT_NE(built.error().line().find("is not what was written"), std::string::npos) << built.error().line();
        fs::remove_all(work_);
        fs::remove(output_ + ".partial");
    }
}

TEST_F(Resume, AFailureBeforeAnythingIsKeptLeavesNothingBehind) {
    const Kind kind = kinds(folder_).front();
    BuildLimits limits;
    limits.memoryBytes = kind.memory;
    limits.isStopped = [] { return true; };
    const auto stopped = build(kind.input, output_, limits);
    ASSERT_FALSE(stopped);
    EXPECT_EQ(stopped.error().hint, "nothing was written");
    EXPECT_FALSE(fs::exists(work_));
    EXPECT_FALSE(fs::exists(output_));
}

}  // namespace
}  // namespace stipple::lod
