#include "engine/base/executor.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "engine/base/isolated.h"

namespace stipple {
namespace {

/// What a task threw, until somebody asks.
class Caught {
  public:
    void run(const std::function<void()>& task) noexcept {
        try {
            task();
        } catch (...) {
            thrown_ = std::current_exception();
        }
    }
    void rethrow() {
        if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    }

  private:
    std::exception_ptr thrown_;
};

class DoneAlready final : public Executor::Beside {
  public:
    explicit DoneAlready(const std::function<void()>& task) { caught_.run(task); }
    void wait() override { caught_.rethrow(); }

  private:
    Caught caught_;
};

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
    std::unique_ptr<Beside> beside(const std::function<void()>& task) override {
        class Thread final : public Beside {
          public:
            explicit Thread(const std::function<void()>& task) : thread_([this, task] { caught_.run(task); }) {}
            ~Thread() override {
                if (thread_.joinable()) thread_.join();
            }
            void wait() override {
                thread_.join();
                caught_.rethrow();
            }

          private:
            Caught caught_;
            std::thread thread_;
        };
        if (threads_ == 1) return Executor::beside(task);
        return std::make_unique<Thread>(task);
    }
    void wait() override {
        for (std::thread& task : std::exchange(tasks_, {})) task.join();
    }
    int threads() const override { return threads_; }

  private:
    int threads_;
    std::vector<std::thread> tasks_;
};
#endif

/// First in, first out, in memory that is kept: whoever starts tasks frame by frame allocates nothing.
class Tasks {
  public:
    Tasks() { tasks_.reserve(kAtOnce); }
    bool isEmpty() const { return next_ == tasks_.size(); }
    size_t size() const { return tasks_.size() - next_; }
    void push(std::function<void()> task) {
        if (next_ > tasks_.size() / 2 && tasks_.size() == tasks_.capacity()) {  // each is moved once at most
            tasks_.erase(tasks_.begin(), tasks_.begin() + static_cast<std::ptrdiff_t>(next_));
            next_ = 0;
        }
        tasks_.push_back(std::move(task));
    }
    std::function<void()> take() {
        std::function<void()> task = std::exchange(tasks_[next_++], nullptr);
        if (isEmpty()) {
            tasks_.clear();
            next_ = 0;
        }
        return task;
    }

  private:
    static constexpr size_t kAtOnce = 128;  // so many may wait before more memory is needed
    std::vector<std::function<void()>> tasks_;
    size_t next_ = 0;  ///< those before it were taken
};

/// Takes tasks that the threads of an arena should not: those of read(), and those of run() where the arena has one
/// thread, which may be waiting for what they give. The `most` threads come with the first task: were they made one by
/// one, as many tasks wait at once, a frame could have to make one long after the first.
class SideThreads {
  public:
    explicit SideThreads(size_t most) : most_(most) {}
    ~SideThreads() {
        {
            const std::lock_guard lock(mutex_);
            isOver_ = true;
        }
        changed_.notify_all();
        for (std::thread& t : threads_) t.join();
    }
    void run(std::function<void()> task) {
        {
            const std::lock_guard lock(mutex_);
            tasks_.push(std::move(task));
            if (threads_.size() < most_) try {
                    threads_.reserve(most_);
                    while (threads_.size() < most_) threads_.emplace_back([this] { work(); });
                } catch (const std::system_error&) {  // none more are to be had
                }
            if (!threads_.empty()) {
                changed_.notify_all();
                return;
            }
            task = tasks_.take();
        }
        task();  // here and now, then
    }
    void wait() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return tasks_.isEmpty() && busy_ == 0; });
    }

  private:
    void work() {
        std::unique_lock lock(mutex_);
        for (;;) {
            changed_.wait(lock, [&] { return isOver_ || !tasks_.isEmpty(); });
            if (tasks_.isEmpty()) return;
            std::function<void()> task = tasks_.take();
            ++busy_;
            lock.unlock();
            task();
            task = nullptr;  // and what it holds
            lock.lock();
            --busy_;
            changed_.notify_all();
        }
    }
    const size_t most_;
    std::mutex mutex_;
    std::condition_variable changed_;
    Tasks tasks_;
    size_t busy_ = 0;
    bool isOver_ = false;
    std::vector<std::thread> threads_;
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

class TbbBeside final : public Executor::Beside {
  public:
    TbbBeside(tbb::task_arena& arena, const std::function<void()>& task) : arena_(arena) {
        try {
            arena_.execute([&] { group_->run(task); });
        } catch (...) {
            // (No memory: TBB has counted a task that it could not make, for which its group would wait forever.)
            (void)group_.release();
            throw;
        }
    }
    ~TbbBeside() noexcept override {
        if (!isOver_) try {
                TbbBeside::wait();
            } catch (...) {  // its caller has given up already
            }
    }
    void wait() override {
        isOver_ = true;
        arena_.execute([&] { group_->wait(); });
    }

  private:
    tbb::task_arena& arena_;
    std::unique_ptr<tbb::task_group> group_ = std::make_unique<tbb::task_group>();
    bool isOver_ = false;
};

class TbbExecutor final : public Executor {
  public:
    explicit TbbExecutor(int threads) : arena_(threads > 0 ? threads : tbb::task_arena::automatic) {
        if (threads > 0) allowThreads(static_cast<size_t>(threads));
        arena_.initialize();
    }
    ~TbbExecutor() noexcept override { TbbExecutor::wait(); }
    void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) override {
        if (count == 0) return;
        // Isolated: a thread that waits here must not pick up an unrelated long task.
        arena_.execute([&] { tbb::this_task_arena::isolate([&] { loop(count, grain ? grain : 1, body); }); });
    }
    void parallelForHelping(size_t count, const std::function<void(size_t, size_t)>& body) override {
        if (count > 0) arena_.execute([&] { loop(count, 1, body); });
    }
    void run(std::function<void()> task) override {
        if (threads() == 1)
            side_.run(std::move(task));
        else
            arena_.execute([&] { group_.run(std::move(task)); });
    }
    void read(std::function<void()> task) override { readers_.run(std::move(task)); }
    std::unique_ptr<Beside> beside(const std::function<void()>& task) override {
        if (threads() == 1) return Executor::beside(task);
        return std::make_unique<TbbBeside>(arena_, task);
    }
    void wait() override {
        readers_.wait();  // what they start is waited for next
        side_.wait();
        arena_.execute([&] { group_.wait(); });
    }
    int threads() const override { return arena_.max_concurrency(); }

  private:
    static void loop(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) {
        tbb::parallel_for(tbb::blocked_range<size_t>(0, count, grain),
                          [&](const tbb::blocked_range<size_t>& r) { body(r.begin(), r.end()); });
    }
    static constexpr size_t kReaders = 4;  // as many requests as a disk or a connection has use for
    tbb::task_arena arena_;
    tbb::task_group group_;
    SideThreads side_{1}, readers_{kReaders};
};

class SerialExecutor final : public Executor {
  public:
    void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) override {
        const size_t step = grain ? grain : 1;
        for (size_t i = 0; i < count; i += step) body(i, i + step < count ? i + step : count);
    }
    void run(std::function<void()> task) override { tasks_.push(std::move(task)); }
    void wait() override {
        while (!tasks_.isEmpty()) tasks_.take()();
    }
    int threads() const override { return 1; }

  private:
    Tasks tasks_;
};

}  // namespace

void isolated(const std::function<void()>& work) { tbb::this_task_arena::isolate(work); }

std::unique_ptr<Executor::Beside> Executor::beside(const std::function<void()>& task) {
    return std::make_unique<DoneAlready>(task);
}

std::unique_ptr<Executor> makeTbbExecutor(int threads) {
#ifdef __SANITIZE_THREAD__
    return std::make_unique<ThreadExecutor>(threads);
#else
    return std::make_unique<TbbExecutor>(threads);
#endif
}
std::unique_ptr<Executor> makeSerialExecutor() { return std::make_unique<SerialExecutor>(); }

}  // namespace stipple
