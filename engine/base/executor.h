// Executor: where parallel work goes. Tests use the serial one, so that a run can be stepped by hand.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace stipple {

class Executor {
  public:
    virtual ~Executor() = default;
    /// Calls body(begin, end) over [0, count) in pieces of at least `grain`; returns when all are done.
    virtual void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) = 0;
    /// The same one piece each, but whoever has none left helps with the loops inside of others' pieces while it waits,
    /// and with whatever else the executor has to do, however long that takes: for the outermost loop of a long job.
    virtual void parallelForHelping(size_t count, const std::function<void(size_t, size_t)>& body) {
        parallelFor(count, 1, body);
    }
    /// Starts `task` and returns. It must not throw.
    virtual void run(std::function<void()> task) = 0;
    /// Starts a task that waits for a disk or a network, where no thread of parallelFor has to wait for it. It may call
    /// run() of this executor. It must not throw.
    virtual void read(std::function<void()> task) { run(std::move(task)); }
    /// A task that goes on beside its caller.
    class Beside {
      public:
        virtual ~Beside() = default;  ///< waits, too
        /// Once; throws what the task threw. Helps with it or with any other task: hold no lock that one may want.
        virtual void wait() = 0;
    };
    /// Starts `task`. With one thread it is done before this returns.
    virtual std::unique_ptr<Beside> beside(const std::function<void()>& task);
    /// Waits for everything that run() and read() started.
    virtual void wait() = 0;
    virtual int threads() const = 0;
    /// Ends with the executor: whoever may outlive it asks before going on.
    std::weak_ptr<const void> life() const { return life_; }

  private:
    std::shared_ptr<const int> life_ = std::make_shared<const int>(0);
};

/// oneTBB arena of `threads` threads (0: all cores).
std::unique_ptr<Executor> makeTbbExecutor(int threads);
/// Everything at once on the calling thread, in order; run() defers to wait() so that tests decide when work happens.
std::unique_ptr<Executor> makeSerialExecutor();

}  // namespace stipple
