// Calls into somebody else's code, from threads that have tasks of ours.
#pragma once

#include <functional>

namespace stipple {

/// Calls `work`; threads that wait within it, as for a parallel loop of their own, pick up no task from outside.
void isolated(const std::function<void()>& work);

}  // namespace stipple
