// Stopping a long job without a signal.
#pragma once

namespace stipple {

/// From now on isStopRequested() is true, e.g. as the user closed the window while a scene was being built.
void askToStop();

}  // namespace stipple
