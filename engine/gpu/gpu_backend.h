// The gpu backend: the passes as Vulkan compute.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/gpu/device.h"
#include "engine/render/backend.h"

namespace stipple::gpu {

struct GpuSettings {
    std::string deviceName;   ///< part of a name; empty: the first device
    bool validation = false;  ///< core and synchronization validation; messages are kept
};

Result<std::unique_ptr<render::Backend>> makeGpuBackend(const GpuSettings& settings);
/// What the validation layers have said to a backend made by makeGpuBackend.
std::vector<std::string> validationMessages(const render::Backend& backend);

}  // namespace stipple::gpu
