// A Vulkan 1.3 device and the objects made from it: move-only owners, each with a debug name. With validation on, every
// message of the layers is kept, so that tests can ask for none (or, with a deliberate hazard, for one).
#pragma once

#include <vulkan/vulkan.h>

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/result.h"

namespace stipple::gpu {

/// What the validation layers said. The layer may call from any thread.
struct Messages {
    std::mutex mutex;
    std::vector<std::string> texts;
};

/// What a device can hold and bind, bytes.
struct DeviceLimits {
    uint64_t storageRange = 0;  ///< of a buffer that is bound by descriptor (maxStorageBufferRange)
    uint64_t buffer = 0;        ///< of any buffer (maxBufferSize)
};

/// How large to make a buffer that must hold `bytes`: a quarter more, so that the next frame need not make it again, as
/// far as the limits go. An error that names the limit where even `bytes` are beyond it.
Result<uint64_t> roomFor(const DeviceLimits& limits, uint64_t bytes, VkBufferUsageFlags usage, const std::string& name,
                         const std::string& deviceName);

/// The queue family that passes are sent to: compute is all that they need (which can copy, says the specification), a
/// window also wants graphics. Among those that will do, one that can tell times, then the first.
std::optional<uint32_t> pickQueueFamily(std::span<const VkQueueFamilyProperties> families, bool forWindow);
/// The one that chunks are copied with: that of an engine which does nothing but copy, beside what the others do; where
/// there is none, `passes`, the family of the passes.
uint32_t pickCopyFamily(std::span<const VkQueueFamilyProperties> families, uint32_t passes);

struct DeviceSettings {
    std::string name;         ///< part of the device's name; empty: the first, real GPUs before software
    bool validation = false;  ///< core and synchronization validation
    std::vector<const char*> instanceExtensions;  ///< for a window
    std::vector<const char*> deviceExtensions;
};

class Device {
  public:
    static Result<std::unique_ptr<Device>> create(const DeviceSettings& settings);
    ~Device();
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    VkInstance instance = VK_NULL_HANDLE;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    VkDevice device = VK_NULL_HANDLE;
    VkQueue queue = VK_NULL_HANDLE, copyQueue = VK_NULL_HANDLE;  ///< may be the same one
    uint32_t queueFamily = 0, copyFamily = 0;
    std::string deviceName;
    DeviceLimits limits;
    float timestampPeriodNs = 1;
    bool hasTimestamps = true;    ///< of the queue
    bool copiesTellTimes = true;  ///< of the queue for copies
    bool isSoftware = false;

    std::vector<std::string> messages() const;
    /// Index of the first memory type with these properties among `bits`.
    std::optional<uint32_t> memoryType(uint32_t bits, VkMemoryPropertyFlags wanted) const;
    void setName(VkObjectType type, uint64_t handle, const std::string& name) const;

  private:
    Device() = default;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    PFN_vkSetDebugUtilsObjectNameEXT setName_ = nullptr;  ///< of this instance; null without validation
    std::shared_ptr<Messages> messages_ = std::make_shared<Messages>();
};

/// "what: VK_ERROR_..." as a device error.
tl::unexpected<Error> vulkanError(VkResult result, const std::string& what);

/// Of commands that are recorded again and again, for the queues of one family. What these four make is the caller's
/// to destroy; commands go with their pool.
Result<VkCommandPool> makeCommandPool(const Device& device, uint32_t family);
Result<VkCommandBuffer> makeCommands(const Device& device, VkCommandPool pool);
/// Not signalled.
Result<VkFence> makeFence(const Device& device);
/// A pool of `count` timestamps.
Result<VkQueryPool> makeTimestamps(const Device& device, uint32_t count);

/// A value that a timeline semaphore is to have. None: nothing is waited for or told.
struct SemaphoreValue {
    VkSemaphore semaphore = VK_NULL_HANDLE;
    uint64_t value = 0;
    VkPipelineStageFlags2 stages = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;  ///< that wait for it
};
/// Hands recorded commands to a queue: they wait for `after`; when all has run `then` is set, and `fence`
/// signalled.
Result<void> submitCommands(VkQueue queue, VkCommandBuffer commands, SemaphoreValue after, SemaphoreValue then,
                            VkFence fence);
/// To the device's queue for passes, at once.
Result<void> submitCommands(const Device& device, VkCommandBuffer commands, VkFence fence);

/// When a buffer was last used, or is used next.
struct BufferTouch {
    VkPipelineStageFlags2 stage;
    VkAccessFlags2 access;
};
/// Of the whole buffer, within one queue family.
VkBufferMemoryBarrier2 bufferBarrier(VkBuffer buffer, BufferTouch before, BufferTouch after);
/// Any mix of barriers of buffers, and one of all memory (null: none).
void recordBarriers(VkCommandBuffer commands, std::span<const VkBufferMemoryBarrier2> buffers,
                    const VkMemoryBarrier2* memory = nullptr);

/// Where a buffer lies.
enum class Memory : uint8_t {
    device,  ///< the host never looks
    table,   ///< the host writes it front to back, the device reads it often: in the device's own memory if the host
             ///< reaches that, else in the host's
    host,    ///< copies to and from it; quick to read for the host
};

/// Of the best kind that there is; tables of the next one where there is no room in that: what the host reaches of the
/// device's memory may be little. isAddressed: of a buffer whose device address is asked for.
Result<VkDeviceMemory> allocateMemory(const Device& device, const VkMemoryRequirements& needs, Memory memory,
                                      bool isAddressed, const std::string& name);

/// Which queues use a buffer.
enum class Queues : uint8_t { one, passesAndCopies };

class Buffer {
  public:
    Buffer() = default;
    /// Unless it is Memory::device it is mapped for the buffer's life.
    static Result<Buffer> create(const Device& device, uint64_t bytes, VkBufferUsageFlags usage, Memory memory,
                                 const std::string& name, Queues queues = Queues::one);
    Buffer(Buffer&& o) noexcept { swap(o); }
    Buffer& operator=(Buffer&& o) noexcept {
        swap(o);
        return *this;
    }
    ~Buffer();
    VkBuffer handle() const { return buffer_; }
    uint64_t bytes() const { return bytes_; }
    void* mapped() const { return mapped_; }
    VkDeviceAddress address() const { return address_; }

  private:
    void swap(Buffer& o) noexcept {
        std::swap(device_, o.device_);
        std::swap(buffer_, o.buffer_);
        std::swap(memory_, o.memory_);
        std::swap(bytes_, o.bytes_);
        std::swap(mapped_, o.mapped_);
        std::swap(address_, o.address_);
    }
    VkDevice device_ = VK_NULL_HANDLE;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    uint64_t bytes_ = 0;
    void* mapped_ = nullptr;
    VkDeviceAddress address_ = 0;
};

/// Names of all Vulkan devices; empty where there is no Vulkan.
std::vector<std::string> deviceNames();
/// Is there a GPU that is not software? Looks at the device nodes first: where there are none, no driver is loaded.
bool hasHardwareDevice();

}  // namespace stipple::gpu
