// Who is told how far a long call is, and who may end it.
#pragma once

#include <stipple/namespace.h>

#include <functional>
#include <string>

namespace stipple::v1 {

struct Progress {
    std::string stage;
    double fraction = 0;      ///< of the whole, 0 to 1; never falls
    double secondsLeft = -1;  ///< estimated; -1: not known yet
};

/// Any of these may be empty. They are called by threads of the library, one at a time, while a call runs; what they
/// call themselves must not be of the same Device or Scene.
struct Listener {
    std::function<void(const Progress&)> progress;      ///< at most ten times a second
    std::function<void(const std::string& line)> note;  ///< what is odd about an input
    std::function<bool()> isStopped;                    ///< true: the call ends soon, with ErrorKind::interrupted
};

}  // namespace stipple::v1
