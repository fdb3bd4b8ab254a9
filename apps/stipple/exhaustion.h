// Memory or threads that run out end the program with code 6, wherever that is noticed.
#pragma once

#include <exception>

namespace stipple::app {

/// Prints the one line for something that was thrown to main; its exit code.
int reportThrown(const std::exception& thrown);

/// Where an exception cannot be thrown on (a destructor, a thread of a library that starts another): the same line and
/// code instead of a signal. What has been written so far stays as after a kill.
void exitWhereNothingCatches();

}  // namespace stipple::app
