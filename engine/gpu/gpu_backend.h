// The gpu backend: the passes as Vulkan compute.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/gpu/device.h"
#include "engine/render/backend.h"

namespace stipple::gpu {

struct GpuSettings {
    std::string deviceName;   ///< part of a name; empty: the first device
    bool validation = false;  ///< core and synchronization validation; messages are kept
    std::string cacheFolder;  ///< where what the driver compiles is kept for the next run; empty: nowhere
};

Result<std::unique_ptr<render::Backend>> makeGpuBackend(const GpuSettings& settings);
/// On a device that others use as well: a window that shows what it draws.
Result<std::unique_ptr<render::Backend>> makeGpuBackendOn(std::shared_ptr<Device> device,
                                                          const std::string& cacheFolder = {});

/// A frame that stays on its device (RenderRequest::staysOnDevice): rows of pixels as in render::Image, written by
/// compute shaders. Valid until the second frame after it is handed in.
struct DevicePicture {
    const Device* device = nullptr;
    VkBuffer pixels = VK_NULL_HANDLE;
    uint32_t width = 0, height = 0;
};
/// None where the ticket is of another backend or too old.
std::optional<DevicePicture> pictureOf(const render::Backend& backend, render::Ticket ticket);

/// Groups that a frame in mode ewa counts for second surfaces: kGroupShapes x shared::GroupCounts, written by compute
/// shaders. Valid until the second frame after it is handed in; none where `pictureOf` has none.
struct DeviceCounts {
    const Device* device = nullptr;
    VkBuffer counts = VK_NULL_HANDLE;
};
std::optional<DeviceCounts> secondGroupsOf(const render::Backend& backend, render::Ticket ticket);
/// Likewise of levels of the pyramid: StatsBlock in shaders/bindings.glsl.
std::optional<DeviceCounts> levelGroupsOf(const render::Backend& backend, render::Ticket ticket);

/// Room for a chunk that commands of the caller fill before the next frame is handed in, instead of Backend::upload.
struct DevicePlace {
    const Device* device = nullptr;
    VkDeviceAddress address = 0;
};
Result<DevicePlace> reserve(render::Backend& backend, streaming::ChunkKey key, uint64_t bytes);

/// What the validation layers have said to a backend made by makeGpuBackend.
std::vector<std::string> validationMessages(const render::Backend& backend);

}  // namespace stipple::gpu
