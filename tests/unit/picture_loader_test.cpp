// What writes pictures is loaded with the first picture or beside long work, which stops where it cannot be loaded.
#include <dlfcn.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <link.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "tests/support/program.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;
using test::expectOneLine;
using test::runProgram;

/// Its name, which the loader knows.
std::string openImageIo() {
    void* const module = ::dlopen((fs::path(STIPPLE_PROGRAM).parent_path() / "libstipple_oiio.so").c_str(), RTLD_NOW);
    EXPECT_NE(module, nullptr) << ::dlerror();
    std::string found;
    ::dl_iterate_phdr(
        [](dl_phdr_info* info, size_t, void* to) {
            if (const std::string name = fs::path(info->dlpi_name).filename(); name.starts_with("libOpenImageIO.so"))
                *static_cast<std::string*>(to) = name;
            return 0;
        },
        &found);
    EXPECT_FALSE(found.empty()) << "the module is not linked with OpenImageIO";
    return found;
}

/// OpenImageIO as a pipe: who loads it waits for its first byte.
class HeldLibrary {
  public:
    explicit HeldLibrary(const test::TempFolder& folder) : path_(folder / "libraries/" + openImageIo()) {
        fs::create_directory(folder / "libraries");
        EXPECT_EQ(::mkfifo(path_.c_str(), 0600), 0);
        ::setenv("LD_LIBRARY_PATH", (folder / "libraries").c_str(), 1);
    }
    ~HeldLibrary() {
        ::unsetenv("LD_LIBRARY_PATH");
        if (end_ >= 0) ::close(end_);
    }
    HeldLibrary(const HeldLibrary&) = delete;
    HeldLibrary& operator=(const HeldLibrary&) = delete;
    /// Does somebody wait for it?
    bool isAwaited() {
        if (end_ < 0) end_ = ::open(path_.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);  // fails where nobody reads
        return end_ >= 0;
    }
    /// It turns out to be no library.
    void fail() {
        fs::remove(path_);
        test::spit(path_, "no library");
        ::close(std::exchange(end_, -1));
    }

  private:
    std::string path_;
    int end_ = -1;
};

std::vector<std::string> wordsOf(const std::string& line) {
    std::istringstream in(line);
    return {std::istream_iterator<std::string>(in), {}};
}

bool isBuilt(const test::TempFolder& folder) {
    std::error_code none;
    const fs::recursive_directory_iterator files(folder / ".cache", none);
    return std::any_of(begin(files), end(files), [](const auto& f) { return f.path().extension() == ".stipple"; });
}

/// Work on one thread, as glibc starts none while it loads libraries.
class Work : public testing::TestWithParam<const char*> {};

TEST_P(Work, BeginsBeforeTheyAreLoadedAndEndsWhereTheyCannotBe) {
    const test::TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 3000").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    HeldLibrary library(folder);
    test::RunningProgram program(folder, wordsOf(std::string(GetParam()) + " --quiet --threads 1"));
    ASSERT_TRUE(program.await([&] { return library.isAwaited(); }));
    EXPECT_EQ(isBuilt(folder), std::string(GetParam()).find("a.las") != std::string::npos) << "the build waits";
    const double before = program.processorSeconds();
    ASSERT_TRUE(program.await([&] { return program.processorSeconds() > before + 0.5; })) << "frames wait";
    library.fail();
    expectOneLine(program.end(), 4, {"picture module"});
    EXPECT_FALSE(fs::exists(folder / "a.png"));
}

INSTANTIATE_TEST_SUITE_P(OfPictures, Work,
                         testing::Values("render a.las -o a.png --size 1280x720 --device cpu --accumulate 4096",
                                         "render a.stipple -o a.png --size 1280x720 --device cpu --accumulate 4096",
                                         "render a.las -o a.png --size 640x480 --mode reference --samples 64",
                                         "render a.stipple -o a.png --size 640x480 --mode reference --samples 64"),
                         [](const auto& of) { return std::to_string(of.index); });

TEST(PictureLoader, FramesThatAreDrawnForTheirTimeHaveTheMachineToThemselves) {
    const test::TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 3000").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple").code, 0);
    HeldLibrary library(folder);
    test::RunningProgram program(
        folder, wordsOf("render a.stipple -o a.png --size 64x64 --device cpu --quiet --frames 1000000 --threads 1"));
    // (Other work loads beside itself after two seconds, and one thread has no more of the processor than those.)
    EXPECT_FALSE(program.await([&] { return library.isAwaited() || program.processorSeconds() > 4; }) &&
                 library.isAwaited());
    program.signal(SIGINT);
    EXPECT_EQ(program.end().code, 7);
}

TEST(PictureLoader, PicturesThatCannotBeWrittenEndALongBuild) {
    const test::TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 3M").code, 0);
    fs::create_directory(folder / "libraries");
    test::spit(folder / "libraries/" + openImageIo(), "no library");
    expectOneLine(
        runProgram(folder, "render a.las -o a.png --size 16x16 --quiet --threads 1", "LD_LIBRARY_PATH=libraries"), 4,
        {"picture module"});
    EXPECT_FALSE(isBuilt(folder));
}

}  // namespace
}  // namespace stipple
