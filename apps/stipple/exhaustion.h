// Memory or threads that run out end the program with code 6, wherever that is noticed.
#pragma once

#include <exception>

namespace stipple::app {

/// Memory or threads are what ran out. (Asking takes no memory.)
bool isExhausted(const std::exception& thrown);

/// Where an exception cannot be thrown on (a destructor, a thread of a library that starts another): the same line and
/// code instead of a signal. What has been written so far stays as after a kill.
void exitWhereNothingCatches();

}  // namespace stipple::app
