#include "engine/gpu/device.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <filesystem>

#include "engine/gpu/needs.h"

namespace stipple::gpu {
namespace {

VKAPI_ATTR VkBool32 VKAPI_CALL onMessage(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                         const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
    auto* messages = static_cast<Messages*>(user);
    const std::lock_guard lock(messages->mutex);
    messages->texts.emplace_back(data->pMessage);
    return VK_FALSE;
}

bool hasLayer(const char* name) {
    uint32_t count = 0;
    vkEnumerateInstanceLayerProperties(&count, nullptr);
    std::vector<VkLayerProperties> layers(count);
    vkEnumerateInstanceLayerProperties(&count, layers.data());
    return std::any_of(layers.begin(), layers.end(),
                       [&](const VkLayerProperties& l) { return std::strcmp(l.layerName, name) == 0; });
}

Result<VkInstance> createInstance(const DeviceSettings& settings, Messages* messages) {
    VkApplicationInfo app{VK_STRUCTURE_TYPE_APPLICATION_INFO};
    app.pApplicationName = "stipple";
    app.apiVersion = VK_API_VERSION_1_3;
    std::vector<const char*> extensions = settings.instanceExtensions;
    VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    info.pApplicationInfo = &app;
    static const char* const layer = "VK_LAYER_KHRONOS_validation";
    const VkValidationFeatureEnableEXT sync = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
    VkValidationFeaturesEXT features{VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT};
    VkDebugUtilsMessengerCreateInfoEXT debug{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    if (settings.validation) {
        if (!hasLayer(layer))
            return fail(ErrorKind::device, "the Vulkan validation layer is not installed", "validation",
                        "apt-get install vulkan-validationlayers");
        extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
        features.enabledValidationFeatureCount = 1;
        features.pEnabledValidationFeatures = &sync;
        debug.messageSeverity =
            VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
        debug.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
        debug.pfnUserCallback = onMessage;
        debug.pUserData = messages;
        features.pNext = &debug;
        info.pNext = &features;
        info.enabledLayerCount = 1;
        info.ppEnabledLayerNames = &layer;
    }
    info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    VkInstance instance = VK_NULL_HANDLE;
    if (const VkResult r = vkCreateInstance(&info, nullptr, &instance); r != VK_SUCCESS)
        return vulkanError(r, "no Vulkan instance");
    return instance;
}

/// All but the first. With the last instance the loader takes drivers out of memory, and loads them again for the next;
/// but the place of their thread-local variables glibc does not always give back (static TLS), so that a process which
/// makes device after device finds none some day (VK_ERROR_INCOMPATIBLE_DRIVER). One instance keeps them where they
/// are.
void destroyInstance(VkInstance instance) {
    static std::atomic<VkInstance> kept{VK_NULL_HANDLE};
    VkInstance none = VK_NULL_HANDLE;
    if (!kept.compare_exchange_strong(none, instance)) vkDestroyInstance(instance, nullptr);
}

std::vector<VkPhysicalDevice> physicalDevices(VkInstance instance) {
    uint32_t count = 0;
    vkEnumeratePhysicalDevices(instance, &count, nullptr);
    std::vector<VkPhysicalDevice> devices(count);
    vkEnumeratePhysicalDevices(instance, &count, devices.data());
    return devices;
}

VkPhysicalDeviceProperties propertiesOf(VkPhysicalDevice device) {
    VkPhysicalDeviceProperties properties{};
    vkGetPhysicalDeviceProperties(device, &properties);
    return properties;
}

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

}  // namespace

tl::unexpected<Error> vulkanError(VkResult result, const std::string& what) {
    const ErrorKind kind = result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY
                               ? ErrorKind::budget
                               : ErrorKind::device;
    return fail(kind, fmt::format("{} (VkResult {})", what, static_cast<int>(result)), "Vulkan", "try --device cpu");
}

namespace {

/// What `create` makes of `info`, or "no WHAT".
template <typename Handle, typename Info>
Result<Handle> make(VkResult (*create)(VkDevice, const Info*, const VkAllocationCallbacks*, Handle*),
                    const Device& device, const Info& info, const char* what) {
    Handle handle = VK_NULL_HANDLE;
    if (const VkResult r = create(device.device, &info, nullptr, &handle); r != VK_SUCCESS)
        return vulkanError(r, fmt::format("no {}", what));
    return handle;
}

}  // namespace

Result<VkCommandPool> makeCommandPool(const Device& device, uint32_t family) {
    VkCommandPoolCreateInfo info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
    info.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    info.queueFamilyIndex = family;
    return make(vkCreateCommandPool, device, info, "command pool");
}

Result<VkCommandBuffer> makeCommands(const Device& device, VkCommandPool pool) {
    VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    info.commandPool = pool;
    info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    info.commandBufferCount = 1;
    VkCommandBuffer commands = VK_NULL_HANDLE;
    if (const VkResult r = vkAllocateCommandBuffers(device.device, &info, &commands); r != VK_SUCCESS)
        return vulkanError(r, "no command buffer");
    return commands;
}

Result<VkFence> makeFence(const Device& device) {
    return make(vkCreateFence, device, VkFenceCreateInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO}, "fence");
}

Result<VkQueryPool> makeTimestamps(const Device& device, uint32_t count) {
    VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
    info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    info.queryCount = count;
    return make(vkCreateQueryPool, device, info, "query pool");
}

Result<void> submitCommands(VkQueue queue, VkCommandBuffer commands, SemaphoreValue after, SemaphoreValue then,
                            VkFence fence) {
    const auto infoOf = [](SemaphoreValue at, VkPipelineStageFlags2 stage) {
        VkSemaphoreSubmitInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO};
        info.semaphore = at.semaphore;
        info.value = at.value;
        info.stageMask = stage;
        return info;
    };
    const VkSemaphoreSubmitInfo waits = infoOf(after, after.stages),
                                signals = infoOf(then, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT);
    VkCommandBufferSubmitInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
    buffer.commandBuffer = commands;
    VkSubmitInfo2 info{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
    info.commandBufferInfoCount = 1;
    info.pCommandBufferInfos = &buffer;
    info.waitSemaphoreInfoCount = after.semaphore != VK_NULL_HANDLE ? 1 : 0;
    info.pWaitSemaphoreInfos = &waits;
    info.signalSemaphoreInfoCount = then.semaphore != VK_NULL_HANDLE ? 1 : 0;
    info.pSignalSemaphoreInfos = &signals;
    if (const VkResult r = vkQueueSubmit2(queue, 1, &info, fence); r != VK_SUCCESS)
        return vulkanError(r, "cannot submit");
    return {};
}

Result<void> submitCommands(const Device& device, VkCommandBuffer commands, VkFence fence) {
    return submitCommands(device.queue, commands, {}, {}, fence);
}

VkBufferMemoryBarrier2 bufferBarrier(VkBuffer buffer, BufferTouch before, BufferTouch after) {
    VkBufferMemoryBarrier2 b{VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2};
    b.srcStageMask = before.stage;
    b.srcAccessMask = before.access;
    b.dstStageMask = after.stage;
    b.dstAccessMask = after.access;
    b.srcQueueFamilyIndex = b.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    b.buffer = buffer;
    b.size = VK_WHOLE_SIZE;
    return b;
}

void recordBarriers(VkCommandBuffer commands, std::span<const VkBufferMemoryBarrier2> buffers,
                    const VkMemoryBarrier2* memory) {
    if (buffers.empty() && memory == nullptr) return;
    VkDependencyInfo info{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    info.memoryBarrierCount = memory != nullptr ? 1 : 0;
    info.pMemoryBarriers = memory;
    info.bufferMemoryBarrierCount = static_cast<uint32_t>(buffers.size());
    info.pBufferMemoryBarriers = buffers.data();
    vkCmdPipelineBarrier2(commands, &info);
}

Result<uint64_t> roomFor(const DeviceLimits& limits, uint64_t bytes, VkBufferUsageFlags usage, const std::string& name,
                         const std::string& deviceName) {
    const bool isBound = (usage & VK_BUFFER_USAGE_STORAGE_BUFFER_BIT) != 0;
    const uint64_t most = isBound ? std::min(limits.storageRange, limits.buffer) : limits.buffer;
    if (bytes <= most) return bytes + std::min(bytes / 4, most - bytes);
    return fail(
        ErrorKind::device,
        fmt::format("{} for this picture would take {} MB, but the device {} at most {} MB at once ({})", name,
                    bytes >> 20, isBound ? "binds" : "holds", most >> 20,
                    isBound && limits.storageRange <= limits.buffer ? "maxStorageBufferRange" : "maxBufferSize"),
        deviceName, "a smaller --size, or --device cpu");
}

std::optional<uint32_t> pickQueueFamily(std::span<const VkQueueFamilyProperties> families, bool forWindow) {
    const VkQueueFlags wanted = VK_QUEUE_COMPUTE_BIT | (forWindow ? VkQueueFlags{VK_QUEUE_GRAPHICS_BIT} : 0);
    std::optional<uint32_t> found;
    for (uint32_t i = 0; i < families.size(); ++i) {
        if ((families[i].queueFlags & wanted) != wanted || families[i].queueCount == 0) continue;
        if (!found || (families[*found].timestampValidBits == 0 && families[i].timestampValidBits > 0)) found = i;
    }
    return found;
}

uint32_t pickCopyFamily(std::span<const VkQueueFamilyProperties> families, uint32_t passes) {
    // (What else an engine for copies may say of itself. Others of videos or of optical flow copy, too.)
    constexpr VkQueueFlags kBeside = VK_QUEUE_SPARSE_BINDING_BIT | VK_QUEUE_PROTECTED_BIT;
    for (uint32_t i = 0; i < families.size(); ++i)
        if ((families[i].queueFlags & ~kBeside) == VK_QUEUE_TRANSFER_BIT && families[i].queueCount > 0) return i;
    return passes;
}

namespace {

/// The logical device, with the features that the passes need.
Result<VkDevice> createLogicalDevice(const Device& d, const std::vector<const char*>& extensions) {
    const float priority = 1;
    std::array<VkDeviceQueueCreateInfo, 2> queueInfos{};
    for (VkDeviceQueueCreateInfo& queueInfo : queueInfos) {
        queueInfo.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
        queueInfo.queueCount = 1;
        queueInfo.pQueuePriorities = &priority;
    }
    queueInfos[0].queueFamilyIndex = d.queueFamily;
    queueInfos[1].queueFamilyIndex = d.copyFamily;
    VkPhysicalDeviceVulkan13Features v13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
    v13.synchronization2 = VK_TRUE;
    v13.maintenance4 = VK_TRUE;  // glslc writes LocalSizeId
    VkPhysicalDeviceVulkan12Features v12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
    v12.pNext = &v13;
    v12.bufferDeviceAddress = VK_TRUE;
    v12.scalarBlockLayout = VK_TRUE;
    v12.shaderBufferInt64Atomics = VK_TRUE;
    v12.hostQueryReset = VK_TRUE;
    v12.timelineSemaphore = VK_TRUE;
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2};
    features.pNext = &v12;
    features.features.shaderInt64 = VK_TRUE;
    VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
    info.pNext = &features;
    info.queueCreateInfoCount = d.copyFamily != d.queueFamily ? 2 : 1;
    info.pQueueCreateInfos = queueInfos.data();
    info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    VkDevice device = VK_NULL_HANDLE;
    if (const VkResult r = vkCreateDevice(d.physical, &info, nullptr, &device); r != VK_SUCCESS)
        return vulkanError(r, d.deviceName + " lacks a feature that Stipple needs (64-bit atomics, device addresses)");
    return device;
}

}  // namespace

Result<std::unique_ptr<Device>> Device::create(const DeviceSettings& settings) {
    std::unique_ptr<Device> d(new Device);
    STIPPLE_ASSIGN(d->instance, createInstance(settings, d->messages_.get()));
    if (settings.validation) {
        const auto make = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
            vkGetInstanceProcAddr(d->instance, "vkCreateDebugUtilsMessengerEXT"));
        VkDebugUtilsMessengerCreateInfoEXT debug{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
        debug.messageSeverity =
            VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
        debug.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
        debug.pfnUserCallback = onMessage;
        debug.pUserData = d->messages_.get();
        if (make) make(d->instance, &debug, nullptr, &d->messenger_);
        d->setName_ = reinterpret_cast<PFN_vkSetDebugUtilsObjectNameEXT>(
            vkGetInstanceProcAddr(d->instance, "vkSetDebugUtilsObjectNameEXT"));
    }
    std::vector<VkPhysicalDevice> devices = physicalDevices(d->instance);
    std::stable_sort(devices.begin(), devices.end(), [](VkPhysicalDevice a, VkPhysicalDevice b) {
        return (propertiesOf(a).deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU) <
               (propertiesOf(b).deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU);
    });
    std::string seen;
    for (VkPhysicalDevice candidate : devices) {
        const VkPhysicalDeviceProperties p = propertiesOf(candidate);
        seen += (seen.empty() ? "" : ", ") + std::string(p.deviceName);
        if (d->physical != VK_NULL_HANDLE || lower(p.deviceName).find(lower(settings.name)) == std::string::npos)
            continue;
        if (p.apiVersion < VK_API_VERSION_1_3) continue;
        d->physical = candidate;
        d->deviceName = p.deviceName;
        d->timestampPeriodNs = p.limits.timestampPeriod;
        d->isSoftware = p.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
    }
    if (d->physical == VK_NULL_HANDLE)
        return fail(ErrorKind::device,
                    fmt::format("no Vulkan 1.3 device is called '{}'; there are: {}", settings.name,
                                seen.empty() ? "none" : seen),
                    "--device", "stipple --version lists them");

    VkPhysicalDeviceMaintenance4Properties sizes{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_PROPERTIES};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2};
    properties.pNext = &sizes;
    vkGetPhysicalDeviceProperties2(d->physical, &properties);
    d->limits = {properties.properties.limits.maxStorageBufferRange, sizes.maxBufferSize};

    uint32_t families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(d->physical, &families, nullptr);
    std::vector<VkQueueFamilyProperties> family(families);
    vkGetPhysicalDeviceQueueFamilyProperties(d->physical, &families, family.data());
    const bool forWindow = !settings.deviceExtensions.empty();
    const std::optional<uint32_t> usable = pickQueueFamily(family, forWindow);
    if (!usable)
        return fail(ErrorKind::device, forWindow ? "has no queue for graphics and compute" : "has no queue for compute",
                    d->deviceName, "try --device cpu");
    d->queueFamily = *usable;
    d->hasTimestamps = family[*usable].timestampValidBits > 0;
    d->copyFamily = pickCopyFamily(family, *usable);
    d->copiesTellTimes = family[d->copyFamily].timestampValidBits > 0;

    STIPPLE_ASSIGN(d->device, createLogicalDevice(*d, settings.deviceExtensions));
    vkGetDeviceQueue(d->device, d->queueFamily, 0, &d->queue);
    vkGetDeviceQueue(d->device, d->copyFamily, 0, &d->copyQueue);
    return d;
}

Device::~Device() {
    if (device != VK_NULL_HANDLE) vkDestroyDevice(device, nullptr);
    if (messenger_ != VK_NULL_HANDLE) {
        const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
            vkGetInstanceProcAddr(instance, "vkDestroyDebugUtilsMessengerEXT"));
        destroy(instance, messenger_, nullptr);
    }
    if (instance != VK_NULL_HANDLE) destroyInstance(instance);
}

std::vector<std::string> Device::messages() const {
    const std::lock_guard lock(messages_->mutex);
    return messages_->texts;
}

std::optional<uint32_t> Device::memoryType(uint32_t bits, VkMemoryPropertyFlags wanted) const {
    VkPhysicalDeviceMemoryProperties memory{};
    vkGetPhysicalDeviceMemoryProperties(physical, &memory);
    for (uint32_t i = 0; i < memory.memoryTypeCount; ++i)
        if ((bits >> i & 1u) != 0 && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
    return {};
}

void Device::setName(VkObjectType type, uint64_t handle, const std::string& name) const {
    if (!setName_) return;
    VkDebugUtilsObjectNameInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT};
    info.objectType = type;
    info.objectHandle = handle;
    info.pObjectName = name.c_str();
    setName_(device, &info);
}

namespace {

/// What to ask of memory, the best first.
std::span<const VkMemoryPropertyFlags> wishesFor(Memory memory) {
    constexpr VkMemoryPropertyFlags kDevice = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT,
                                    kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT,
                                    kCached = kHost | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
    static constexpr std::array kOfDevice{kDevice, VkMemoryPropertyFlags{0}}, kOfTables{kHost | kDevice, kHost},
        kOfHost{kCached, kHost};
    return memory == Memory::device ? kOfDevice : memory == Memory::table ? kOfTables : kOfHost;
}

}  // namespace

Result<VkDeviceMemory> allocateMemory(const Device& d, const VkMemoryRequirements& needs, Memory memory,
                                      bool isAddressed, const std::string& name) {
    VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    info.pNext = isAddressed ? &flags : nullptr;
    info.allocationSize = needs.size;
    VkResult last = VK_ERROR_FEATURE_NOT_PRESENT;
    const auto isFull = [&] { return last == VK_ERROR_OUT_OF_DEVICE_MEMORY || last == VK_ERROR_OUT_OF_HOST_MEMORY; };
    for (const VkMemoryPropertyFlags wish : wishesFor(memory)) {
        const std::optional<uint32_t> type = d.memoryType(needs.memoryTypeBits, wish);
        if (!type) continue;
        info.memoryTypeIndex = *type;
        VkDeviceMemory made = VK_NULL_HANDLE;
        last = vkAllocateMemory(d.device, &info, nullptr, &made);
        if (last == VK_SUCCESS) return made;
        if (memory != Memory::table || !isFull()) break;
    }
    return vulkanError(last, fmt::format("no memory for {} ({} bytes)", name, needs.size));
}

Result<Buffer> Buffer::create(const Device& d, uint64_t bytes, VkBufferUsageFlags usage, Memory memory,
                              const std::string& name, Queues queues) {
    Buffer b;
    b.device_ = d.device;
    b.bytes_ = bytes;
    VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    info.size = bytes;
    info.usage = usage;
    const std::array families{d.queueFamily, d.copyFamily};
    if (queues == Queues::passesAndCopies && families[0] != families[1]) {
        info.sharingMode = VK_SHARING_MODE_CONCURRENT;
        info.queueFamilyIndexCount = static_cast<uint32_t>(families.size());
        info.pQueueFamilyIndices = families.data();
    }
    if (const VkResult r = vkCreateBuffer(d.device, &info, nullptr, &b.buffer_); r != VK_SUCCESS)
        return vulkanError(r, "no buffer " + name);
    VkMemoryRequirements needs{};
    vkGetBufferMemoryRequirements(d.device, b.buffer_, &needs);
    const bool isAddressed = (usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
    STIPPLE_ASSIGN(b.memory_, allocateMemory(d, needs, memory, isAddressed, name));
    if (const VkResult r = vkBindBufferMemory(d.device, b.buffer_, b.memory_, 0); r != VK_SUCCESS)
        return vulkanError(r, "cannot bind " + name);
    if (memory != Memory::device && vkMapMemory(d.device, b.memory_, 0, VK_WHOLE_SIZE, 0, &b.mapped_) != VK_SUCCESS)
        return fail(ErrorKind::device, "cannot map " + name, d.deviceName);
    if (isAddressed) {
        VkBufferDeviceAddressInfo address{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO};
        address.buffer = b.buffer_;
        b.address_ = vkGetBufferDeviceAddress(d.device, &address);
    }
    d.setName(VK_OBJECT_TYPE_BUFFER, reinterpret_cast<uint64_t>(b.buffer_), name);
    return b;
}

Buffer::~Buffer() {
    if (buffer_ != VK_NULL_HANDLE) vkDestroyBuffer(device_, buffer_, nullptr);
    if (memory_ != VK_NULL_HANDLE) vkFreeMemory(device_, memory_, nullptr);
}

std::vector<std::string> deviceNames() {
    std::vector<std::string> names;
    const auto instance = createInstance({}, nullptr);
    if (!instance) return names;
    for (VkPhysicalDevice d : physicalDevices(*instance)) names.emplace_back(propertiesOf(d).deviceName);
    destroyInstance(*instance);
    return names;
}

bool hasHardwareDevice() {
    std::error_code ignored;
    if (!std::filesystem::exists("/dev/dri", ignored) && !std::filesystem::exists("/dev/nvidia0", ignored))
        return false;
    const auto instance = createInstance({}, nullptr);
    if (!instance) return false;
    bool found = false;
    for (VkPhysicalDevice d : physicalDevices(*instance))
        found = found || propertiesOf(d).deviceType != VK_PHYSICAL_DEVICE_TYPE_CPU;
    destroyInstance(*instance);
    return found;
}

}  // namespace stipple::gpu
