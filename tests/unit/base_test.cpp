#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <thread>

#include "engine/base/file.h"
#include "engine/base/process.h"
#include "engine/base/units.h"
#include "lod/store/hierarchy.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

TEST(OutputFile, LeavesNothingBehindWithoutCommit) {
    const test::TempFolder folder;
    {
        auto file = OutputFile::create(folder / "a");
        ASSERT_TRUE(file);
        ASSERT_TRUE(file->append("hello", 5));
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(OutputFile, KeepsTheOldFileUntilCommit) {
    const test::TempFolder folder;
    ASSERT_TRUE(writeWholeFile(folder / "a", "old", 3));
    auto file = OutputFile::create(folder / "a");
    ASSERT_TRUE(file && file->append("newer", 5));
    EXPECT_EQ(*readTextFile(folder / "a", 100), "old");
    ASSERT_TRUE(file->commit());
    EXPECT_EQ(*readTextFile(folder / "a", 100), "newer");
}

TEST(OutputFile, SaysWhereItCannotWrite) {
    const auto file = OutputFile::create("/proc/no-such-folder/a");
    ASSERT_FALSE(file);
    EXPECT_EQ(file.error().kind, ErrorKind::output);
    EXPECT_NE(file.error().line().find("/proc/no-such-folder/a"), std::string::npos);
}

TEST(InputFile, RefusesToReadPastTheEnd) {
    const test::TempFolder folder;
    ASSERT_TRUE(writeWholeFile(folder / "a", "abc", 3));
    const auto file = InputFile::open(folder / "a");
    ASSERT_TRUE(file);
    std::array<char, 8> bytes{};
    EXPECT_TRUE(file->readAt(1, bytes.data(), 2));
    EXPECT_FALSE(file->readAt(2, bytes.data(), 2));
    EXPECT_FALSE(file->readAt(~uint64_t{0}, bytes.data(), 2));
}

TEST(ParseBytes, KnowsUnitsAndRefusesTheRest) {
    EXPECT_EQ(parseBytes("2G"), uint64_t{2} << 30);
    EXPECT_EQ(parseBytes("512MiB"), uint64_t{512} << 20);
    EXPECT_EQ(parseBytes("1000"), 1000u);
    for (const char* bad : {"", "x", "-1G", "2Q", "1Gx", "nan", "1e99"}) EXPECT_EQ(parseBytes(bad), 0u) << bad;
}

TEST(ErrorScale, RoundsUpOverManyDecades) {
    const lod::ErrorScale scale{3.7e-3};
    EXPECT_EQ(scale.encodeUp(0), 0u);
    Rng rng(1);
    for (int i = 0; i < 100'000; ++i) {
        const double e = scale.smallest * std::exp2(rng.uniform(-20, 31.7));
        const uint32_t code = scale.encodeUp(e);
        ASSERT_GE(scale.decode(code), e);
        if (code > 1) ASSERT_LT(scale.decode(code - 1), e);
    }
    for (uint32_t code = 1; code <= lod::ErrorScale::kLargest; ++code)
        ASSERT_EQ(scale.encodeUp(scale.decode(code)), code);
}

/// However many others there are: an executor of one thread must not take those of the whole process.
TEST(Executor, HasItsThreadsBesideOthers) {
    const auto one = makeTbbExecutor(1), four = makeTbbExecutor(4), two = makeTbbExecutor(2);
    for (const auto* executor : {&four, &two}) {
        const auto count = static_cast<size_t>((*executor)->threads());
        std::atomic<size_t> together{0};
        const double start = nowSeconds();
        (*executor)->parallelFor(count, 1, [&](size_t, size_t) {
            ++together;  // each waits for all
            while (together < count && nowSeconds() < start + 20) std::this_thread::yield();
        });
        EXPECT_EQ(together, count);
        EXPECT_LT(nowSeconds(), start + 20) << count << " threads were never there at once";
    }
    std::atomic<int> inside{0}, most{0};
    one->parallelFor(1000, 1, [&](size_t, size_t) {
        most = std::max(most.load(), ++inside);
        --inside;
    });
    EXPECT_EQ(most, 1);
}

TEST(Executor, ReadingKeepsNoWorkerFromItsWork) {
    const auto executor = makeTbbExecutor(2);
    std::atomic<bool> isOver{false};
    std::atomic<int> begun{0}, ended{0}, after{0};
    for (int i = 0; i < 8; ++i)
        executor->read([&] {
            while (!isOver) std::this_thread::yield();
            ++ended;
            executor->run([&] { ++after; });
        });
    // Two pieces that wait for each other: both workers must be free.
    std::atomic<bool> isMet{true};
    executor->parallelFor(2, 1, [&](size_t, size_t) {
        ++begun;
        const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
        while (begun < 2 && isMet)
            if (std::chrono::steady_clock::now() > until) isMet = false;
    });
    EXPECT_TRUE(isMet);
    EXPECT_EQ(ended, 0);
    isOver = true;
    executor->wait();
    EXPECT_EQ(ended, 8);
    EXPECT_EQ(after, 8) << "what reading starts is waited for, too";
}

TEST(Executor, RunsEverythingOnceWhateverTheThreads) {
    for (const int threads : {1, 2, 5}) {
        const auto executor = makeTbbExecutor(threads);
        std::vector<std::atomic<int>> hits(10'000);
        executor->parallelFor(hits.size(), 7, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) ++hits[i];
        });
        for (const auto& h : hits) ASSERT_EQ(h.load(), 1);
    }
}

TEST(Executor, ATaskBesideItsCallerIsDoneAfterWaiting) {
    for (const int threads : {1, 2, 5}) {
        const auto executor = makeTbbExecutor(threads);
        std::atomic<int> sum{0};
        const auto add = [&] {
            executor->parallelFor(1000, 1, [&](size_t begin, size_t end) { sum += static_cast<int>(end - begin); });
        };
        for (int k = 1; k <= 50; ++k) {
            const auto beside = executor->beside(add);
            executor->parallelFor(100, 1, [&](size_t begin, size_t end) { sum += static_cast<int>(end - begin); });
            beside->wait();
            ASSERT_EQ(sum, 1100 * k);
        }
        executor->beside(add).reset();  // waits, too
        EXPECT_EQ(sum, 56'000);
        // Of a task that is itself started.
        executor->run([&] { executor->beside(add)->wait(); });
        executor->wait();
        EXPECT_EQ(sum, 57'000);
    }
}

TEST(Executor, ATaskBesideItsCallerThrowsWhereItIsWaitedFor) {
    for (const int threads : {1, 2}) {
        const auto executor = makeTbbExecutor(threads);
        const auto beside = executor->beside([] { throw std::bad_alloc(); });
        EXPECT_THROW(beside->wait(), std::bad_alloc);
        executor->beside([] { throw std::bad_alloc(); }).reset();  // nobody wants to know
    }
}

}  // namespace
}  // namespace stipple
