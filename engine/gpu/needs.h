// What pictures ask of a device: its limits, as the compiled shaders, the layout of their buffers and the tables have
// them, and its features.
#pragma once

#include <vulkan/vulkan.h>

#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::gpu {

struct LimitNeeded {
    std::string name;  ///< as the specification calls it
    uint64_t needed;
    uint64_t (*of)(const VkPhysicalDeviceLimits& limits);
};
std::vector<LimitNeeded> limitsNeeded();

/// An error that says the first limit which is too small, how large it is, and how large it would have to be.
Result<void> checkLimits(const VkPhysicalDeviceLimits& limits, const std::string& deviceName);
/// ... which operations within subgroups there are not.
Result<void> checkSubgroups(const VkPhysicalDeviceSubgroupProperties& subgroups, const std::string& deviceName);

/// Both of a device.
Result<void> checkDevice(VkPhysicalDevice device, const std::string& deviceName);

}  // namespace stipple::gpu
