// The copies of a frame's new chunks: sent to the queue for copies, which a card does beside the frames before; the
// frame that they are for waits for them on the device.
#pragma once

#include <memory>

#include "engine/gpu/device.h"
#include "engine/gpu/staging.h"

namespace stipple::gpu {

class Upload {
  public:
    static Result<std::unique_ptr<Upload>> create(const Device& device);
    ~Upload();
    Upload(const Upload&) = delete;
    Upload& operator=(const Upload&) = delete;

    /// Takes `staging` and leaves an empty one. Not before the frame of the last call is done; where they are copied to
    /// nothing reads or writes any more. Nothing to copy: nothing is sent.
    Result<void> submit(Staging& staging);
    /// What a frame has to wait for to see all that was sent so far.
    SemaphoreValue sent() const { return {semaphore_, sent_}; }
    /// Of the last call, once its frame is done; none where it sent nothing or the queue tells no times.
    std::optional<double> milliseconds() const;

  private:
    explicit Upload(const Device& device) : device_(device), staging_(device) {}
    Result<void> record();

    const Device& device_;
    Staging staging_;  ///< that is being copied
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkSemaphore semaphore_ = VK_NULL_HANDLE;  ///< counts what has been copied
    VkQueryPool queries_ = VK_NULL_HANDLE;
    uint64_t sent_ = 0;
    bool isOfLastCall_ = false;
};

}  // namespace stipple::gpu
