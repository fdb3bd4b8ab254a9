// What the driver has compiled, kept from one run to the next: a file a device, driver and set of shaders, with a hash
// before the driver's own bytes. Whatever is wrong with it, pipelines are compiled anew.
#pragma once

#include <string>

#include "engine/gpu/device.h"

namespace stipple::gpu {

class PipelineCache {
  public:
    /// `folder`: of the file; empty: nothing is read or written.
    PipelineCache(const Device& device, const std::string& folder);
    /// Writes the file if there is something else than it had.
    ~PipelineCache();
    PipelineCache(const PipelineCache&) = delete;
    PipelineCache& operator=(const PipelineCache&) = delete;
    VkPipelineCache handle() const { return handle_; }  ///< null where the device makes none: pipelines do without

  private:
    std::vector<uint8_t> read() const;
    void write() const;
    const Device& device_;
    VkPipelineCache handle_ = VK_NULL_HANDLE;
    std::string path_;
    size_t bytesRead_ = 0;
};

}  // namespace stipple::gpu
