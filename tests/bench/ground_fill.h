// Chunks of made-up records in a device's memory, filled there (shaders/ground).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/gpu/device.h"
#include "shaders/shared/ground.h"

namespace stipple::gpu {

struct GroundTile {
    uint32_t number = 0;
    VkDeviceAddress address = 0;  ///< of its records
};

class GroundFill {
  public:
    static Result<std::unique_ptr<GroundFill>> create(const Device& device);
    ~GroundFill();
    GroundFill(const GroundFill&) = delete;
    GroundFill& operator=(const GroundFill&) = delete;

    /// `count` records each. They are there when it returns.
    Result<void> fill(std::span<const GroundTile> tiles, uint32_t count, uint32_t radiusCode);
    /// `samples` records of each tile, spread over its `count`, read back and compared with what the host makes of the
    /// same formula: how many differ.
    Result<uint64_t> differing(std::span<const GroundTile> tiles, uint32_t count, uint32_t radiusCode,
                               uint32_t samples);

  private:
    explicit GroundFill(const Device& device) : device_(device) {}
    Result<void> run(std::span<const shared::GroundStep> steps);
    const Device& device_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkFence fence_ = VK_NULL_HANDLE;
};

}  // namespace stipple::gpu
