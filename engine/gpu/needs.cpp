#include "engine/gpu/needs.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/gpu/pipelines.h"

namespace stipple::gpu {
namespace {

/// The most of any shader.
template <typename Of>
uint64_t mostOfShaders(Of of) {
    uint64_t most = 0;
    for (const Shader& s : shaders()) most = std::max<uint64_t>(most, of(s));
    return most;
}
uint64_t largestTable() {
    uint64_t most = 0;
    for (const Shader& s : shaders())
        for (const BindingUse& u : s.uses)
            if (isUniform(u.binding)) most = std::max<uint64_t>(most, u.stride);
    return most;
}

}  // namespace

std::vector<LimitNeeded> limitsNeeded() {
    using Limits = VkPhysicalDeviceLimits;
    constexpr uint32_t kStorage = shared::kBindings - countUniform();
#define STIPPLE_LIMIT(name, needed)                                       \
    {                                                                     \
#name, needed, [](const Limits& l) -> uint64_t { return l.name; } \
    }
#define STIPPLE_LIMIT_AT(name, axis, needed)                                                  \
    {                                                                                         \
#name "[" #axis "]", needed, [](const Limits& l) -> uint64_t { return l.name[axis]; } \
    }
    return {
        STIPPLE_LIMIT(maxComputeWorkGroupInvocations,
                      mostOfShaders([](const Shader& s) { return s.group[0] * s.group[1] * s.group[2]; })),
        STIPPLE_LIMIT_AT(maxComputeWorkGroupSize, 0, mostOfShaders([](const Shader& s) { return s.group[0]; })),
        STIPPLE_LIMIT_AT(maxComputeWorkGroupSize, 1, mostOfShaders([](const Shader& s) { return s.group[1]; })),
        STIPPLE_LIMIT_AT(maxComputeWorkGroupSize, 2, mostOfShaders([](const Shader& s) { return s.group[2]; })),
        STIPPLE_LIMIT_AT(maxComputeWorkGroupCount, 0, shared::kGroupsPerDimension),
        STIPPLE_LIMIT(maxComputeSharedMemorySize, mostOfShaders([](const Shader& s) { return s.sharedBytes; })),
        STIPPLE_LIMIT(maxPushConstantsSize, sizeof(shared::Step)),
        STIPPLE_LIMIT(maxPerStageDescriptorStorageBuffers, kStorage),
        STIPPLE_LIMIT(maxDescriptorSetStorageBuffers, kStorage),
        STIPPLE_LIMIT(maxPerStageDescriptorUniformBuffers, countUniform()),
        STIPPLE_LIMIT(maxDescriptorSetUniformBuffers, countUniform()),
        STIPPLE_LIMIT(maxPerStageResources, shared::kBindings),
        STIPPLE_LIMIT(maxUniformBufferRange, largestTable()),
    };
#undef STIPPLE_LIMIT
#undef STIPPLE_LIMIT_AT
}

Result<void> checkLimits(const VkPhysicalDeviceLimits& limits, const std::string& deviceName) {
    for (const LimitNeeded& limit : limitsNeeded())
        if (const uint64_t has = limit.of(limits); has < limit.needed)
            return fail(
                ErrorKind::device,
                fmt::format("has too little for Stipple: {} is {}, and {} is needed", limit.name, has, limit.needed),
                deviceName, "try --device cpu");
    return {};
}

Result<void> checkSubgroups(const VkPhysicalDeviceSubgroupProperties& subgroups, const std::string& deviceName) {
    const bool isOfCompute = (subgroups.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) != 0;
    const auto lacks = [&](VkSubgroupFeatureFlagBits wanted) {
        return !isOfCompute || (subgroups.supportedOperations & wanted) == 0;
    };
    const char* const missing = lacks(VK_SUBGROUP_FEATURE_BASIC_BIT)        ? "operations of subgroups"
                                : lacks(VK_SUBGROUP_FEATURE_ARITHMETIC_BIT) ? "arithmetic of subgroups"
                                : lacks(VK_SUBGROUP_FEATURE_BALLOT_BIT)     ? "ballots of subgroups"
                                                                            : nullptr;
    if (missing == nullptr) return {};
    return fail(ErrorKind::device, fmt::format("lacks a feature that Stipple needs ({})", missing), deviceName,
                "try --device cpu");
}

Result<void> checkDevice(VkPhysicalDevice device, const std::string& deviceName) {
    VkPhysicalDeviceSubgroupProperties subgroups{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2};
    properties.pNext = &subgroups;
    vkGetPhysicalDeviceProperties2(device, &properties);
    STIPPLE_TRY(checkLimits(properties.properties.limits, deviceName));
    return checkSubgroups(subgroups, deviceName);
}

}  // namespace stipple::gpu
