// The copies of a frame's new chunks: sent to the queue for copies, which a card does beside the frames before; the
// frame that they are for waits for them on the device.
#pragma once

#include <memory>
#include <optional>

#include "engine/gpu/device.h"
#include "engine/gpu/staging.h"

namespace stipple::gpu {

/// Counts what was sent to the queue for copies, in the order in which it is done.
class Copies {
  public:
    static Result<std::unique_ptr<Copies>> create(const Device& device);
    ~Copies();
    Copies(const Copies&) = delete;
    Copies& operator=(const Copies&) = delete;

    /// What to wait for to see all that was sent so far.
    SemaphoreValue sent() const { return {semaphore_, sent_}; }
    SemaphoreValue next() const { return {semaphore_, sent_ + 1}; }
    /// `next` will come.
    void count() { ++sent_; }
    /// On the host.
    Result<void> waitFor(uint64_t value) const;

  private:
    explicit Copies(const Device& device) : device_(device) {}
    const Device& device_;
    VkSemaphore semaphore_ = VK_NULL_HANDLE;
    uint64_t sent_ = 0;
};

/// Those of one frame in flight.
class Upload {
  public:
    static Result<std::unique_ptr<Upload>> create(const Device& device, Copies& copies);
    ~Upload();
    Upload(const Upload&) = delete;
    Upload& operator=(const Upload&) = delete;

    /// Takes `staging` and leaves an empty one; where that fails `staging` is as it was. Where it is copied to nothing
    /// reads or writes any more. Nothing to copy: nothing is sent.
    Result<void> submit(Staging& staging);
    /// Of the last call, once that is done; none where it sent nothing or the queue tells no times.
    std::optional<double> milliseconds() const;

  private:
    Upload(const Device& device, Copies& copies) : device_(device), copies_(copies), staging_(device) {}
    Result<void> record(const Staging& staging);

    const Device& device_;
    Copies& copies_;
    Staging staging_;    ///< that is being copied
    uint64_t last_ = 0;  ///< of copies_
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkQueryPool queries_ = VK_NULL_HANDLE;
    bool isOfLastCall_ = false;
};

}  // namespace stipple::gpu
