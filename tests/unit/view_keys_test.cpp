// Keys of the window on keyboards of several layouts, and what they change.
#include <gtest/gtest.h>

#include <set>

#include "apps/stipple/view_keys.h"

namespace stipple::app {
namespace {

using gpu::commandOf;
using gpu::nameOf;

TEST(Keys, LettersAreThoseOfTheLayout) {
    EXPECT_EQ(commandOf('M', "m"), 'M');
    // French: M is right of L, where a US keyboard has the semicolon; a comma is where M was.
    EXPECT_EQ(commandOf(';', "m"), 'M');
    EXPECT_EQ(commandOf('M', ","), 0);
    EXPECT_EQ(commandOf('A', "q"), 'Q');
    // German and Dvorak.
    EXPECT_EQ(commandOf('Y', "z"), 'Z');
    EXPECT_EQ(commandOf('J', "c"), 'C');
    EXPECT_EQ(commandOf('C', "j"), 'J');
}

TEST(Keys, DigitsAreWhereTheyAre) {
    EXPECT_EQ(commandOf('1', "&"), '1');         // French
    EXPECT_EQ(commandOf('2', "\xc3\xa9"), '2');  // French: e with acute accent
    EXPECT_EQ(commandOf('9', "9"), '9');
}

TEST(Keys, OtherScriptsGoByPosition) {
    EXPECT_EQ(commandOf('M', "\xd1\x8c"), 'M');  // Russian soft sign
    EXPECT_EQ(commandOf('F', "\xcf\x86"), 'F');  // Greek phi
    EXPECT_EQ(commandOf('P', ""), 'P');          // the system does not say
    EXPECT_EQ(commandOf('W', "\xc3\xa9"), 0);    // a Latin letter with an accent is no other script
    EXPECT_EQ(commandOf(';', "\xd0\xb6"), 0);
    EXPECT_EQ(commandOf('[', "["), 0);
}

TEST(Keys, SteeringKeysAreCalledAsPrinted) {
    EXPECT_EQ(nameOf('W', "z"), 'Z');
    EXPECT_EQ(nameOf('Q', "'"), '\'');
    EXPECT_EQ(nameOf('W', "\xd1\x86"), 'W');
    const auto help = keyHelp({'Z', 'Q', 'S', 'D', 'A', 'E'});
    const bool named =
        std::any_of(help.begin(), help.end(), [](const KeyHelp& k) { return k.key == "Z Q S D or arrows"; });
    EXPECT_TRUE(named);
}

TEST(Keys, HelpNamesEveryCommand) {
    const std::string text = keyHelpText();
    for (const char* key :
         {"F ", "M ", "C ", "L ", "U ", "V ", "P ", "Space", "Tab", "H or F1", "Esc", "1 to 9", "W A S D"})
        EXPECT_NE(text.find(std::string("\n  ") + key), std::string::npos) << key;
    EXPECT_NE(text.find("dropped"), std::string::npos);
}

TEST(Keys, EachChangesWhatItSays) {
    ViewSettings s;
    s.frame.draw.lit = true;
    EXPECT_FALSE(applyKeys("MVL", s).quit);
    EXPECT_EQ(s.frame.mode, render::Mode::splat);
    EXPECT_EQ(s.frame.draw.debugView, 1u);
    EXPECT_FALSE(s.frame.draw.lit);
    EXPECT_TRUE(s.frame.draw.unlitTriangles);
    applyKeys("M5", s);
    EXPECT_EQ(s.frame.mode, render::Mode::ewa);
    applyKeys("M", s);
    EXPECT_EQ(s.frame.mode, render::Mode::points);
    applyKeys("M", s);
    EXPECT_EQ(s.frame.mode, render::Mode::pullpushExact);
    applyKeys("M", s);
    EXPECT_EQ(s.frame.mode, render::Mode::surface) << "around";
    EXPECT_EQ(s.frame.budgets.errorPixels, 4);
    const KeyRequests asked = applyKeys("FCUP ", s);
    EXPECT_TRUE(asked.fly && asked.colours && asked.up && asked.picture && asked.pause);
    EXPECT_FALSE(asked.quit);
}

TEST(Keys, OnlyWhatChangesThePictureRendersAnew) {
    ViewSettings s;
    EXPECT_FALSE(applyKeys("\tHP \x1b", s).rendersAnew);
    for (const char key : std::string("FMVLCU159")) EXPECT_TRUE(applyKeys(std::string(1, key), s).rendersAnew) << key;
}

TEST(Keys, TabGoesThroughTheFigures) {
    ViewSettings s;
    EXPECT_EQ(s.detail, Detail::brief);
    std::set<Detail> seen;
    for (int i = 0; i < 3; ++i) {
        seen.insert(s.detail);
        applyKeys("\t", s);
    }
    EXPECT_EQ(seen.size(), 3u);
    EXPECT_EQ(s.detail, Detail::brief);
}

TEST(Keys, EscapeClosesTheHelpFirst) {
    ViewSettings s;
    applyKeys("H", s);
    EXPECT_TRUE(s.help);
    EXPECT_FALSE(applyKeys("\x1b", s).quit);
    EXPECT_FALSE(s.help);
    EXPECT_TRUE(applyKeys("\x1b", s).quit);
}

TEST(Hands, KeysSteerByPosition) {
    gpu::Input in;
    in.names = {'Z', 'Q', 'S', 'D', 'A', 'E'};
    in.held[gpu::kSteerForward] = in.held[gpu::kSteerRight] = in.held[gpu::kSteerUp] = true;
    EXPECT_EQ(motionOf(in).step, glm::dvec3(1, 1, 1));
    in.held[gpu::kSteerLeft] = true;
    EXPECT_EQ(motionOf(in).step, glm::dvec3(0, 1, 1));
}

TEST(Hands, AKeyIsNotTwoThingsAtOnce) {
    gpu::Input in;
    in.names = {'W', 'A', 'R', 'S', 'Q', 'F'};  // Colemak: F is where E is on a US keyboard
    in.held[gpu::kSteerUp] = true;
    EXPECT_TRUE(motionOf(in).isIdle());
    in.arrows[gpu::kSteerUp] = true;
    EXPECT_EQ(motionOf(in).step, glm::dvec3(0, 1, 0));
}

TEST(Hands, DragsAndWheel) {
    gpu::Input in;
    in.width = 640;
    in.height = 480;
    EXPECT_TRUE(motionOf(in).isIdle());
    in.leftDrag = {3, -4};
    in.scroll = 2;
    EXPECT_EQ(motionOf(in).turn, glm::dvec2(3, -4));
    EXPECT_EQ(motionOf(in).slide, glm::dvec2(0));
    EXPECT_EQ(motionOf(in).scroll, 2);
    in.leftDrag = {0, 0};
    in.rightDrag = {3, -4};
    EXPECT_EQ(motionOf(in).slide, glm::dvec2(3, -4));
}

TEST(Hands, AKeyThatIsOnlyTouchedMovesToo) {
    gpu::Input in;  // seconds: 0, as after waiting
    in.arrows[gpu::kSteerForward] = true;
    EXPECT_GT(motionOf(in).seconds, 0);
}

}  // namespace
}  // namespace stipple::app
