// What the driver has compiled, kept from one run to the next: a file a device and driver, with a hash before the
// driver's own bytes. Whatever is wrong with it, pipelines are compiled anew.
#pragma once

#include <memory>
#include <string>

#include "engine/gpu/device.h"

namespace stipple::gpu {

class PipelineCache {
  public:
    /// `folder`: of the file; empty: nothing is read or written.
    static Result<std::unique_ptr<PipelineCache>> create(const Device& device, const std::string& folder);
    /// Writes the file if there is more than it had.
    ~PipelineCache();
    PipelineCache(const PipelineCache&) = delete;
    PipelineCache& operator=(const PipelineCache&) = delete;
    VkPipelineCache handle() const { return handle_; }

  private:
    explicit PipelineCache(const Device& device) : device_(device) {}
    void write() const;
    const Device& device_;
    VkPipelineCache handle_ = VK_NULL_HANDLE;
    std::string path_;
    size_t bytesRead_ = 0;
};

}  // namespace stipple::gpu
