#include "engine/base/executor.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace stipple {
namespace {

#ifdef __SANITIZE_THREAD__
// ThreadSanitizer knows nothing of the synchronisation inside the (uninstrumented) TBB library and would report every
// task that is stolen. Plain threads instead: what is then reported is a race of ours.
class ThreadExecutor final : public Executor {
  public:
    explicit ThreadExecutor(int threads) : threads_(threads > 0 ? threads : 4) {}
    ~ThreadExecutor() override { ThreadExecutor::wait(); }
    void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) override {
        const size_t step = grain ? grain : 1;
        std::atomic<size_t> next{0};
        const auto work = [&] {
            for (size_t i = next.fetch_add(step); i < count; i = next.fetch_add(step))
                body(i, i + step < count ? i + step : count);
        };
        std::vector<std::thread> helpers;
        for (size_t t = 1; t < static_cast<size_t>(threads_) && t * step < count; ++t) helpers.emplace_back(work);
        work();
        for (std::thread& helper : helpers) helper.join();
    }
    void run(std::function<void()> task) override { tasks_.emplace_back(std::move(task)); }
    void wait() override {
        for (std::thread& task : std::exchange(tasks_, {})) task.join();
    }
    int threads() const override { return threads_; }

  private:
    int threads_;
    std::vector<std::thread> tasks_;
};
#endif

/// Takes the tasks of run() where an arena has one thread: that one may be waiting for what they give.
class SideThread {
  public:
    ~SideThread() {
        {
            const std::lock_guard lock(mutex_);
            isOver_ = true;
        }
        changed_.notify_all();
        if (thread_.joinable()) thread_.join();
    }
    void run(std::function<void()> task) {
        if (!thread_.joinable()) try {
                thread_ = std::thread([this] { work(); });
            } catch (const std::system_error&) {  // there is none to be had: here and now, then
                task();
                return;
            }
        {
            const std::lock_guard lock(mutex_);
            tasks_.push_back(std::move(task));
        }
        changed_.notify_all();
    }
    void wait() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return tasks_.empty() && !isBusy_; });
    }

  private:
    void work() {
        std::unique_lock lock(mutex_);
        for (;;) {
            changed_.wait(lock, [&] { return isOver_ || !tasks_.empty(); });
            if (tasks_.empty()) return;
            std::function<void()> task = std::move(tasks_.front());
            tasks_.pop_front();
            isBusy_ = true;
            lock.unlock();
            task();
            task = nullptr;  // and what it holds
            lock.lock();
            isBusy_ = false;
            changed_.notify_all();
        }
    }
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::function<void()>> tasks_;
    bool isBusy_ = false, isOver_ = false;
    std::thread thread_;
};

/// Where more threads than cores are asked for, TBB's market must be told so, or an arena never gets them. Of several
/// controls the smallest counts, for the whole process: there is one, of the most that was ever asked for.
void allowThreads(size_t threads) {
    static std::mutex mutex;
    static tbb::global_control* control = nullptr;  // until the process ends
    constexpr auto kMost = tbb::global_control::max_allowed_parallelism;
    const std::lock_guard lock(mutex);
    if (threads <= tbb::global_control::active_value(kMost)) return;
    delete control;
    control = new tbb::global_control(kMost, threads);
}

class TbbExecutor final : public Executor {
  public:
    explicit TbbExecutor(int threads) : arena_(threads > 0 ? threads : tbb::task_arena::automatic) {
        if (threads > 0) allowThreads(static_cast<size_t>(threads));
        arena_.initialize();
    }
    ~TbbExecutor() noexcept override { TbbExecutor::wait(); }
    void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) override {
        if (count == 0) return;
        arena_.execute([&] {
            // Isolated: a thread that waits here must not pick up an unrelated long task.
            tbb::this_task_arena::isolate([&] {
                tbb::parallel_for(tbb::blocked_range<size_t>(0, count, grain ? grain : 1),
                                  [&](const tbb::blocked_range<size_t>& r) { body(r.begin(), r.end()); });
            });
        });
    }
    void run(std::function<void()> task) override {
        if (threads() == 1)
            side_.run(std::move(task));
        else
            arena_.execute([&] { group_.run(std::move(task)); });
    }
    void wait() override {
        side_.wait();
        arena_.execute([&] { group_.wait(); });
    }
    int threads() const override { return arena_.max_concurrency(); }

  private:
    tbb::task_arena arena_;
    tbb::task_group group_;
    SideThread side_;
};

class SerialExecutor final : public Executor {
  public:
    void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) override {
        const size_t step = grain ? grain : 1;
        for (size_t i = 0; i < count; i += step) body(i, i + step < count ? i + step : count);
    }
    void run(std::function<void()> task) override { tasks_.push_back(std::move(task)); }
    void wait() override {
        while (!tasks_.empty()) {
            auto task = std::move(tasks_.front());
            tasks_.pop_front();
            task();
        }
    }
    int threads() const override { return 1; }

  private:
    std::deque<std::function<void()>> tasks_;
};

}  // namespace

std::unique_ptr<Executor> makeTbbExecutor(int threads) {
#ifdef __SANITIZE_THREAD__
    return std::make_unique<ThreadExecutor>(threads);
#else
    return std::make_unique<TbbExecutor>(threads);
#endif
}
std::unique_ptr<Executor> makeSerialExecutor() { return std::make_unique<SerialExecutor>(); }

}  // namespace stipple
