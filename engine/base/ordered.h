// Work that is done in any order and handed on in the given one.
#pragma once

#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <optional>

#include "engine/base/executor.h"
#include "engine/base/result.h"

namespace stipple {

/// Calls make(i) for i in [first, end) on up to `workers` threads, and use(i, what it gave) one after the other in
/// order, beside what others make. What is made waits in memory: a thread begins nothing more than `workers` items
/// ahead of the last used one; one that finds nothing left helps with loops inside of make. Stops at the first error;
/// what make or use throws is thrown to the caller, once all threads have stopped.
template <typename T, typename Make, typename Use>
Result<void> inOrder(Executor& executor, int workers, size_t first, size_t end, const Make& make, const Use& use) {
    std::mutex mutex;
    std::condition_variable changed;
    std::map<size_t, T> waiting;
    std::optional<Error> error;
    std::exception_ptr thrown;
    size_t next = first, used = first;
    bool isUsing = false;
    const auto isOver = [&] { return error || thrown || next >= end; };
    const auto work = [&](std::unique_lock<std::mutex>& lock) {
        const size_t index = next++;
        lock.unlock();
        Result<T> made = make(index);
        lock.lock();
        if (made)
            waiting.emplace(index, std::move(*made));
        else if (!error)
            error = made.error();
        while (!isUsing && !error && !thrown && !waiting.empty() && waiting.begin()->first == used) {
            auto item = waiting.extract(waiting.begin());
            isUsing = true;
            lock.unlock();
            const Result<void> result = use(item.key(), std::move(item.mapped()));
            item = {};  // its memory
            lock.lock();
            isUsing = false;
            if (!result && !error) error = result.error();
            ++used;
            changed.notify_all();
        }
    };
    executor.parallelForHelping(static_cast<size_t>(workers), [&](size_t from, size_t to) {
        for (size_t worker = from; worker < to; ++worker)
            for (;;) {
                std::unique_lock lock(mutex);
                changed.wait(lock, [&] { return isOver() || next <= used + static_cast<size_t>(workers); });
                if (isOver()) break;
                try {
                    work(lock);
                } catch (...) {  // the others wait for what this thread will never give them
                    if (!lock.owns_lock()) lock.lock();
                    if (!thrown) thrown = std::current_exception();
                }
                changed.notify_all();
            }
    });
    if (thrown) std::rethrow_exception(thrown);
    if (error) return tl::unexpected(*error);
    return {};
}

}  // namespace stipple
