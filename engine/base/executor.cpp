#include "engine/base/executor.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <deque>
#include <utility>

namespace stipple {
namespace {

class TbbExecutor final : public Executor {
  public:
    explicit TbbExecutor(int threads) : arena_(threads > 0 ? threads : tbb::task_arena::automatic) {
        // More threads than cores were asked for: TBB's market must be told so, or the arena never gets them.
        if (threads > 0)
            limit_ = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                           static_cast<size_t>(threads));
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
        arena_.execute([&] { group_.run(std::move(task)); });
    }
    void wait() override {
        arena_.execute([&] { group_.wait(); });
    }
    int threads() const override { return arena_.max_concurrency(); }

  private:
    std::unique_ptr<tbb::global_control> limit_;
    tbb::task_arena arena_;
    tbb::task_group group_;
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

std::unique_ptr<Executor> makeTbbExecutor(int threads) { return std::make_unique<TbbExecutor>(threads); }
std::unique_ptr<Executor> makeSerialExecutor() { return std::make_unique<SerialExecutor>(); }

}  // namespace stipple
