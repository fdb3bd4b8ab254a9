// What interrupted builds leave: who may go on with it, what is removed and what is not, and what it is counted as.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "lod/builder/build.h"
#include "lod/builder/octree/journal.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

class Leftover : public ::testing::Test {
  protected:
    const test::TempFolder folder_;
    const std::string output_ = folder_ / "a.stipple", work_ = output_ + ".build";

    Result<Journal> open(uint64_t identity, Leftovers leftovers = Leftovers::goOn) const {
        return Journal::open(work_, output_, identity, leftovers);
    }
    /// A build that was interrupted after its first step.
    void interrupt(uint64_t identity) const {
        auto journal = open(identity);
        ASSERT_TRUE(journal && journal->append(Journal::What::counted, {1, 2, 3}));
        test::spit(work_ + "/in-0", "input");
    }
};

TEST_F(Leftover, ABuildThatRunsKeepsItsFilesWhenAnotherIsRefused) {
    auto running = open(1);
    ASSERT_TRUE(running);
    test::spit(work_ + "/in-0", "input");
    const auto second = open(2);
    ASSERT_FALSE(second);
    EXPECT_NE(second.error().what.find("in use"), std::string::npos);
    EXPECT_TRUE(fs::exists(work_ + "/in-0"));
    EXPECT_TRUE(running->append(Journal::What::counted, {1}));
}

TEST_F(Leftover, WhatIsNotOfABuildIsNotTouched) {
    fs::create_directory(work_);
    test::spit(work_ + "/thesis", "four years");
    for (const Leftovers leftovers : {Leftovers::goOn, Leftovers::goOnOrReplace, Leftovers::replace}) {
        const auto refused = open(1, leftovers);
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().kind, ErrorKind::output);
        EXPECT_NE(refused.error().hint.find("--temp"), std::string::npos);
        EXPECT_EQ(test::slurp(work_ + "/thesis"), "four years");
    }
    for (const char* journal : {"", "my own journal of four years"}) {
        test::spit(work_ + "/journal", journal);
        EXPECT_FALSE(open(1, Leftovers::replace));
        EXPECT_EQ(test::slurp(work_ + "/journal"), journal);
        EXPECT_EQ(test::slurp(work_ + "/thesis"), "four years");
    }
    fs::remove_all(work_);
    test::spit(output_ + ".partial", "my own part");
    const auto refused = open(1, Leftovers::replace);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("a.stipple.partial"), std::string::npos);
    EXPECT_EQ(test::slurp(output_ + ".partial"), "my own part");
    fs::remove(output_ + ".partial");
    EXPECT_TRUE(open(1));
}

TEST_F(Leftover, OfAnotherBuildItIsRefusedOrReplaced) {
    interrupt(1);
    EXPECT_EQ(open(1)->takeEntries().size(), 1u);
    const auto refused = open(2);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, ErrorKind::input);
    EXPECT_NE(refused.error().hint.find("--restart"), std::string::npos);
    EXPECT_NE(refused.error().what.find("changed"), std::string::npos);
    EXPECT_TRUE(fs::exists(work_ + "/in-0"));
    EXPECT_EQ(open(1, Leftovers::goOnOrReplace)->takeEntries().size(), 1u);
    EXPECT_TRUE(fs::exists(work_ + "/in-0"));
    {
        auto other = open(2, Leftovers::goOnOrReplace);
        ASSERT_TRUE(other);
        EXPECT_EQ(other->takeEntries().size(), 0u);
        EXPECT_FALSE(fs::exists(work_ + "/in-0"));
    }
    interrupt(1);
    EXPECT_EQ(open(1, Leftovers::replace)->takeEntries().size(), 0u);
    EXPECT_FALSE(fs::exists(work_)) << "nothing to go on with";
}

TEST_F(Leftover, ItIsPartOfTheSpaceThatIsNeeded) {
    interrupt(1);
    constexpr uint64_t kOwn = uint64_t{64} << 20;  // reserved, not written
    const int file = ::open((work_ + "/in-1").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    const bool isReserved = ::fallocate(file, 0, 0, kOwn) == 0;
    ::close(file);
    if (!isReserved) GTEST_SKIP() << "no room, or space cannot be reserved here";
    auto journal = open(1);
    ASSERT_TRUE(journal);
    Progress silent(false);
    const auto room = [&] {  // asked for anew each time: others use the disk as well
        struct statvfs disk {};
        EXPECT_EQ(::statvfs(work_.c_str(), &disk), 0);
        return uint64_t{disk.f_bavail} * disk.f_frsize;
    };
    EXPECT_TRUE(journal->announce(room() + kOwn / 2, silent)) << "half of what is there already";
    const auto tooMuch = journal->announce(room() + 3 * kOwn, silent);
    ASSERT_FALSE(tooMuch);
    EXPECT_EQ(tooMuch.error().kind, ErrorKind::budget);
}

TEST_F(Leftover, AnInputThatChangedIsBuiltAnewWhenTold) {
    const std::string input = folder_ / "a.las";
    std::vector<glm::ivec3> points;
    Rng rng(4);
    for (int i = 0; i < 600'000; ++i) {
        const double x = rng.uniform(0, 5e5), y = rng.uniform(0, 1e5);
        points.emplace_back(x, y, 2e3 * std::sin(x * 1e-4) + 20 * rng.normal());
    }
    test::writeLas(input, points, 0.001, {0, 0, 0});
    BuildSettings settings;
    settings.memoryBytes = uint64_t{121} << 20;
    settings.isStopped = [&] { return fs::exists(output_ + ".partial"); };
    const auto executor = makeSerialExecutor();
    Progress silent(false);
    const auto build = [&] { return buildStore({input}, output_, settings, *executor, silent); };
    ASSERT_FALSE(build());
    ASSERT_TRUE(fs::exists(work_ + "/journal"));
    points.pop_back();
    test::writeLas(input, points, 0.001, {0, 0, 0});
    settings.isStopped = {};
    const auto refused = build();
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("--restart"), std::string::npos) << refused.error().line();
    settings.leftovers = Leftovers::replace;
    const auto built = build();
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_FALSE(built->isResumed);
    EXPECT_EQ(built->pointsOut, points.size());
    EXPECT_FALSE(fs::exists(work_));
    // Nor does it stay where the new build is done in memory.
    settings.isStopped = [&] { return fs::exists(output_ + ".partial"); };
    settings.leftovers = Leftovers::goOn;
    ASSERT_FALSE(build());
    ASSERT_TRUE(fs::exists(work_ + "/journal"));
    settings.isStopped = {};
    settings.leftovers = Leftovers::replace;
    settings.memoryBytes = uint64_t{2} << 30;
    ASSERT_TRUE(build());
    EXPECT_FALSE(fs::exists(work_));
}

}  // namespace
}  // namespace stipple::lod
