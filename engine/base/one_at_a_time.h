// Calls of what must not run twice at once.
#pragma once

#include <mutex>

namespace stipple {

class OneAtATime {
  public:
    template <typename Call>
    auto operator()(const Call& call) {
        const std::lock_guard lock(mutex_);
        return call();
    }

  private:
    std::mutex mutex_;
};

}  // namespace stipple
