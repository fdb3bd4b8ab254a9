// inOrder and the executors: what happens when the work fails, and when there is only one thread.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <new>
#include <thread>

#include "engine/base/ordered.h"

namespace stipple {
namespace {

/// Runs `work` on a thread of its own; false if it has not ended within a while (the thread is given up then).
bool endsSoon(std::function<void()> work) {
    auto done = std::make_shared<std::promise<void>>();
    auto future = done->get_future();
    std::thread([work = std::move(work), done] {
        work();
        done->set_value();
    }).detach();
    return future.wait_for(std::chrono::seconds(20)) == std::future_status::ready;
}

enum class Where { make, use };

/// What a run over 200 items throws whose item `at` throws.
std::string outcomeOf(Executor& executor, int workers, Where where, size_t at) {
    const auto mayThrow = [&](Where here, size_t i) {
        if (here == where && i == at) throw std::bad_alloc();
    };
    try {
        const auto result = inOrder<size_t>(
            executor, workers, 0, 200,
            [&](size_t i) -> Result<size_t> {
                mayThrow(Where::make, i);
                return i;
            },
            [&](size_t i, size_t made) -> Result<void> {
                mayThrow(Where::use, i);
                return i == made ? Result<void>() : fail(ErrorKind::input, "out of order");
            });
        return result ? "fine" : result.error().what;
    } catch (const std::bad_alloc&) {
        return "bad_alloc";
    }
}

TEST(InOrder, WhatMakeOrUseThrowsReachesTheCallerInsteadOfStoppingForEver) {
    for (const int threads : {1, 4})
        for (const int workers : {1, 3, 8})
            for (const Where where : {Where::make, Where::use})
                for (const size_t at : {size_t{0}, size_t{1}, size_t{7}, size_t{199}, size_t{200}}) {
                    auto outcome = std::make_shared<std::string>();
                    ASSERT_TRUE(endsSoon([=] {
                        const auto executor = makeTbbExecutor(threads);
                        *outcome = outcomeOf(*executor, workers, where, at);
                    })) << threads
                        << " threads, " << workers << " workers, item " << at;
                    EXPECT_EQ(*outcome, at < 200 ? "bad_alloc" : "fine") << threads << " " << workers << " " << at;
                }
}

TEST(InOrder, OthersAreMadeWhileOneIsUsed) {
    // The first is used until both of the others are made, which takes both threads in turn.
    ASSERT_TRUE(endsSoon([] {
        const auto executor = makeTbbExecutor(2);
        std::atomic<int> made{0};
        std::atomic<bool> isUsing{false};
        const auto result = inOrder<int>(
            *executor, 2, 0, 3, [&](size_t i) -> Result<int> { return static_cast<int>(i) + 0 * made++; },
            [&](size_t i, int) -> Result<void> {
                EXPECT_FALSE(isUsing.exchange(true)) << "two at once";
                while (i == 0 && made < 3) std::this_thread::yield();
                isUsing = false;
                return {};
            });
        EXPECT_TRUE(result);
    }));
}

TEST(InOrder, WhoeverHasNothingLeftHelpsInsideOfOthers) {
    // Of two items one is there at once; the other is two pieces that wait for each other, so that both threads are
    // needed: whichever of them, the caller or the worker, has the first.
    for (int round = 0; round < 20; ++round) {
        ASSERT_TRUE(endsSoon([] {
            const auto executor = makeTbbExecutor(2);
            std::atomic<int> together{0}, begun{0};
            const auto result = inOrder<int>(
                *executor, 2, 0, 2,
                [&](size_t i) -> Result<int> {
                    ++begun;
                    while (begun < 2) std::this_thread::yield();  // each has one
                    if (i == 0) return 0;
                    executor->parallelFor(2, 1, [&](size_t, size_t) {
                        ++together;
                        while (together < 2) std::this_thread::yield();
                    });
                    return 1;
                },
                [](size_t, int) -> Result<void> { return {}; });
            EXPECT_TRUE(result);
        })) << "round "
            << round;
    }
}

TEST(Executor, TasksMakeProgressWhileTheCallerWaitsForThemWhateverItsThreads) {
    for (const int threads : {1, 2, 4}) {
        ASSERT_TRUE(endsSoon([=] {
            const auto executor = makeTbbExecutor(threads);
            std::atomic<int> done{0};
            for (int i = 0; i < 50; ++i) executor->run([&] { ++done; });
            while (done < 50) std::this_thread::yield();  // nobody calls wait()
            for (int i = 0; i < 50; ++i) executor->run([&] { ++done; });
            executor->wait();
            EXPECT_EQ(done, 100);
            std::atomic<size_t> sum{0};
            executor->parallelFor(1000, 10, [&](size_t begin, size_t end) { sum += end - begin; });
            EXPECT_EQ(sum, 1000u);
        })) << threads
            << " threads";
    }
}

}  // namespace
}  // namespace stipple
