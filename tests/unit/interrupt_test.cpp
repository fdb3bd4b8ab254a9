// Ctrl-C ends every long command with 7: it says what is there, and leaves nothing half-written.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>

#include "tests/support/program.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::RunningProgram;
using test::runProgram;
using test::TempFolder;

void expectInterrupted(const Outcome& r, const std::string& text) {
    EXPECT_EQ(r.code, 7) << r.err;
    EXPECT_NE(r.err.find("interrupted"), std::string::npos) << r.err;
    EXPECT_NE(r.err.find(text), std::string::npos) << r.err;
}
/// Files that a reader could take for whole ones are; temporary names are gone.
void expectNoTemporaries(const std::string& folder) {
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        EXPECT_EQ(entry.path().filename().string().find(".partial"), std::string::npos) << entry.path();
}
/// It catches signals (SIGTERM as the last), and is at work.
bool isAtWork(const RunningProgram& program) { return program.catches(SIGTERM) && program.processorSeconds() > 0.3; }

TEST(Interrupt, PicturesOfAPathStayAndAreCounted) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 5k").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    RunningProgram render(folder, {"render", "a.stipple", "-o", "o.png", "--size", "320x200", "--orbit", "9999",
                                   "--quiet", "--device", "cpu"});
    ASSERT_TRUE(render.await([&] { return fs::exists(folder / "o_0001.png"); }));
    render.signal(SIGINT);
    const Outcome r = render.end();
    size_t written = 0;
    while (fs::exists(folder /
                      ("o_" + std::string(4 - std::to_string(written).size(), '0') + std::to_string(written) + ".png")))
        ++written;
    expectInterrupted(r, std::to_string(written) + " of 9999 pictures are written");
    expectNoTemporaries(folder.path());
}

TEST(Interrupt, OnePictureIsWrittenWholeOrNotAtAll) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow scan -o a.las --points 5k").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --quiet").code, 0);
    const std::vector<std::vector<std::string>> ways{
        {"--mode", "reference", "--samples", "64"}, {"--frames", "1000000"}, {"--accumulate", "4096"}};
    for (const auto& way : ways) {
        SCOPED_TRACE(way.front());
        std::vector<std::string> arguments{"render", "a.stipple", "-o", "a.png", "--size", "1280x720", "--quiet"};
        arguments.insert(arguments.end(), way.begin(), way.end());
        RunningProgram render(folder, arguments);
        ASSERT_TRUE(render.await([&] { return isAtWork(render); }));
        render.signal(SIGTERM);
        expectInterrupted(render.end(), "nothing is written");
        EXPECT_FALSE(fs::exists(folder / "a.png"));
        expectNoTemporaries(folder.path());
    }
}

TEST(Interrupt, ABuildInsideRenderStops) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow tree -o a.glb --leaves 200k").code, 0);
    RunningProgram render(folder, {"render", "a.glb", "-o", "a.png", "--size", "64x48", "--quiet"});
    ASSERT_TRUE(render.await([&] { return isAtWork(render); }));
    render.signal(SIGINT);
    const Outcome r = render.end();
    expectInterrupted(r, "nothing is written");
    EXPECT_EQ(r.err.find("was written"), std::string::npos) << "once is enough: " << r.err;
    EXPECT_FALSE(fs::exists(folder / "a.png"));
    expectNoTemporaries(folder.path());
}

TEST(Interrupt, VerifyingStops) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow tree -o a.glb --leaves 200k").code, 0);
    ASSERT_EQ(runProgram(folder, "build a.glb -o a.stipple --quiet").code, 0);
    RunningProgram info(folder, {"info", "a.stipple", "--verify"});
    // From here to the end it verifies, but for some milliseconds; all of it takes about a second.
    ASSERT_TRUE(info.await([&] { return info.catches(SIGTERM); }));
    info.signal(SIGINT);
    expectInterrupted(info.end(), "a.stipple");
}

TEST(Interrupt, GrowingStops) {
    const TempFolder folder;
    for (const std::vector<std::string>& what :
         {std::vector<std::string>{"scan", "-o", "a.las", "--points", "100M"},
          std::vector<std::string>{"forest", "-o", "a.glb", "--leaves", "10M", "--variants", "16"},
          std::vector<std::string>{"terrain", "-o", "a.glb", "--triangles", "10M"}}) {
        SCOPED_TRACE(what.front());
        std::vector<std::string> arguments{"grow"};
        arguments.insert(arguments.end(), what.begin(), what.end());
        RunningProgram grow(folder, arguments);
        ASSERT_TRUE(grow.await([&] { return isAtWork(grow); }));
        grow.signal(SIGINT);
        expectInterrupted(grow.end(), "nothing is written");
        EXPECT_FALSE(fs::exists(folder / what[2]));
        expectNoTemporaries(folder.path());
    }
}

TEST(Interrupt, ConvertingStops) {
    const TempFolder folder;
    ASSERT_EQ(runProgram(folder, "grow tree -o t.glb --leaves 200k --as triangles").code, 0);
    RunningProgram convert(folder, {"convert", "t.glb", "--curves", "-o", "s.stipple"});
    ASSERT_TRUE(convert.await([&] { return isAtWork(convert); }));
    convert.signal(SIGINT);
    expectInterrupted(convert.end(), "nothing ");
    EXPECT_FALSE(fs::exists(folder / "s.stipple"));
    expectNoTemporaries(folder.path());
}

}  // namespace
}  // namespace stipple
