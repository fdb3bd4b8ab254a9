// A queue between threads. Values move through it. (Mutexes live in this folder only.)
#pragma once

#include <mutex>
#include <utility>
#include <vector>

namespace stipple {

template <typename T>
class CompletionQueue {
  public:
    void push(T value) {
        const std::lock_guard lock(mutex_);
        items_.push_back(std::move(value));
    }
    /// Everything that has arrived since the last call, in order of arrival.
    std::vector<T> takeAll() {
        const std::lock_guard lock(mutex_);
        return std::exchange(items_, {});
    }

  private:
    std::mutex mutex_;
    std::vector<T> items_;
};

}  // namespace stipple
