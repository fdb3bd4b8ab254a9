// A queue between threads. Values move through it. (Mutexes live in this folder only.)
#pragma once

#include <cstddef>
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
    /// From now on that many fit without memory being taken: whoever pushes cannot fail.
    void reserve(size_t count) {
        const std::lock_guard lock(mutex_);
        items_.reserve(count);
    }
    /// Everything that has arrived since the last call, in order of arrival.
    std::vector<T> takeAll() {
        const std::lock_guard lock(mutex_);
        return std::exchange(items_, {});
    }
    /// The same into `items`, whose memory is used for what comes next.
    void takeAll(std::vector<T>& items) {
        items.clear();
        const std::lock_guard lock(mutex_);
        items.reserve(items_.capacity());
        std::swap(items, items_);
    }

  private:
    std::mutex mutex_;
    std::vector<T> items_;
};

}  // namespace stipple
