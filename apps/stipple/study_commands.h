// The commands of the program of studies, and what the other program says of them.
#pragma once

#include <array>

namespace stipple::app {

struct StudyCommandName {
    const char *name, *about;
};
inline constexpr StudyCommandName kStudyCommand{"study", "what accuracy costs in time, on your scenes"};
inline constexpr StudyCommandName kSelfTestCommand{"selftest",
                                                   "hard cases of precision, on this machine and its devices"};
inline constexpr std::array<StudyCommandName, 2> kStudyCommands{kStudyCommand, kSelfTestCommand};

}  // namespace stipple::app
