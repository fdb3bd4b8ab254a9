// Files that are written: what may be replaced, what killed processes leave, what stays of the old file.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "engine/base/file.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

size_t entriesOf(const std::string& folder) {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Output, OnlyRegularFilesAreReplaced) {
    const test::TempFolder folder;
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    const auto written = writeWholeFile(folder / "pipe", "x", 1);
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().kind, ErrorKind::output);
    EXPECT_NE(written.error().line().find("pipe"), std::string::npos);
    EXPECT_EQ(fs::status(folder / "pipe").type(), fs::file_type::fifo) << "it is still there";
    // (A link to a device, so that a failing test replaces the link.)
    fs::create_symlink("/dev/null", folder / "device");
    const auto device = writeWholeFile(folder / "device", "x", 1);
    ASSERT_FALSE(device);
    EXPECT_NE(device.error().line().find("device"), std::string::npos);
    EXPECT_TRUE(fs::is_symlink(folder / "device"));
    EXPECT_FALSE(writeWholeFile(folder.path(), "x", 1));
    for (const char* none : {"", "folder/"}) {
        const auto unnamed = writeWholeFile(none, "x", 1);
        ASSERT_FALSE(unnamed);
        EXPECT_EQ(unnamed.error().kind, ErrorKind::usage);
    }
    EXPECT_EQ(entriesOf(folder.path()), 2u);
}

TEST(Output, WhatALinkLeadsToIsReplacedAndTheLinkStays) {
    const test::TempFolder folder;
    fs::create_directory(folder / "far");
    test::spit(folder / "far/real", "old");
    fs::create_symlink("far/real", folder / "link");
    fs::create_symlink("link", folder / "second");
    ASSERT_TRUE(writeWholeFile(folder / "second", "new", 3));
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    EXPECT_TRUE(fs::is_symlink(folder / "second"));
    EXPECT_FALSE(fs::is_symlink(folder / "far/real"));
    EXPECT_EQ(test::slurp(folder / "far/real"), "new");
    EXPECT_EQ(entriesOf(folder / "far"), 1u);
    fs::create_symlink("nowhere", folder / "dangling");
    fs::create_symlink("round", folder / "round");
    for (const char* name : {"dangling", "round"}) {
        const auto refused = writeWholeFile(folder / name, "x", 1);
        ASSERT_FALSE(refused) << name;
        EXPECT_EQ(refused.error().kind, ErrorKind::output);
        EXPECT_NE(refused.error().what.find("link"), std::string::npos) << refused.error().what;
        EXPECT_TRUE(fs::is_symlink(folder / name));
    }
}

TEST(Output, PermissionsStay) {
    const test::TempFolder folder;
    test::spit(folder / "a", "old");
    ASSERT_EQ(::chmod((folder / "a").c_str(), 0640), 0);
    ASSERT_TRUE(writeWholeFile(folder / "a", "new", 3));
    struct stat info {};
    ASSERT_EQ(::stat((folder / "a").c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 07777, 0640u);
    EXPECT_EQ(test::slurp(folder / "a"), "new");
}

/// A process that begins to write `path` and is killed; its number.
pid_t writeAndDie(const std::string& path) {
    const pid_t child = ::fork();
    if (child == 0) {
        auto file = OutputFile::create(path);
        if (file && file->append("half", 4)) ::kill(::getpid(), SIGKILL);
        ::_exit(1);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    return child;
}

TEST(Output, WhatKilledProcessesLeftIsCleared) {
    const test::TempFolder folder;
    const pid_t died = writeAndDie(folder / "a");
    ASSERT_TRUE(fs::exists(fmt::format("{}.partial.{}", folder / "a", died)));
    // The number of a process that is gone may be another's now: here, this one's parent.
    fs::rename(fmt::format("{}.partial.{}", folder / "a", died),
               fmt::format("{}.partial.{}", folder / "a", ::getppid()));
    test::spit(folder / "a.partial.notes", "mine");
    test::spit(folder / "b.partial.123456", "of another output");
    auto other = OutputFile::create(folder / "a");  // still being written
    ASSERT_TRUE(other && other->append("other", 5));
    ASSERT_TRUE(writeWholeFile(folder / "a", "new", 3));
    EXPECT_FALSE(fs::exists(fmt::format("{}.partial.{}", folder / "a", ::getppid())));
    EXPECT_TRUE(fs::exists(other->temporaryPath()));
    EXPECT_EQ(test::slurp(folder / "a"), "new");
    ASSERT_TRUE(other->commit());
    EXPECT_EQ(test::slurp(folder / "a"), "other");
    EXPECT_TRUE(fs::exists(folder / "a.partial.notes"));
    EXPECT_TRUE(fs::exists(folder / "b.partial.123456"));
    EXPECT_EQ(entriesOf(folder.path()), 3u);
}

TEST(Output, OneProcessAtATimeGoesOn) {
    const test::TempFolder folder;
    auto first = OutputFile::resume(folder / "a", folder / "a.partial", 0);
    ASSERT_TRUE(first && first->append("first", 5));
    const auto second = OutputFile::resume(folder / "a", folder / "a.partial", 0);
    ASSERT_FALSE(second);
    EXPECT_NE(second.error().what.find("another process"), std::string::npos);
    ASSERT_TRUE(first->commit());
    EXPECT_EQ(test::slurp(folder / "a"), "first");
    ASSERT_EQ(::mkfifo((folder / "b.partial").c_str(), 0600), 0);
    EXPECT_FALSE(OutputFile::resume(folder / "b", folder / "b.partial", 0));
}

}  // namespace
}  // namespace stipple
