// The compute pipelines: one descriptor set layout, one push constant block (shaders/shared/bindings.h). Each is
// compiled when a frame first calls for it.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/gpu/device.h"
#include "engine/gpu/pipeline_cache.h"
#include "engine/gpu/shader_table.h"
#include "engine/render/effects/table.h"

namespace stipple::gpu {

/// Constants of effects are uniform buffers: of storage buffers many devices let a stage see 32 and no more
/// (maxPerStageDescriptorStorageBuffers).
constexpr bool isUniform(uint32_t binding) {
    return binding == shared::kEdlBinding || binding == shared::kFogBinding || binding == shared::kToneBinding ||
           binding == shared::kOcclusionBinding || binding == shared::kShadowBinding ||
           binding == shared::kBackgroundBinding || binding == shared::kReflectionBinding;
}
constexpr VkDescriptorType descriptorType(uint32_t binding) {
    return isUniform(binding) ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
}
constexpr uint32_t countUniform() {
    uint32_t count = 0;
    for (uint32_t b = 0; b < shared::kBindings; ++b) count += isUniform(b) ? 1 : 0;
    return count;
}

class Pipelines {
  public:
    /// `cacheFolder`: where what the driver compiles is kept; empty: nowhere.
    static Result<std::unique_ptr<Pipelines>> create(const Device& device, const std::string& cacheFolder);
    ~Pipelines();
    Pipelines(const Pipelines&) = delete;
    Pipelines& operator=(const Pipelines&) = delete;

    /// A set of descriptors, for one frame in flight. They live as long as the pipelines.
    Result<VkDescriptorSet> makeSet();
    void bind(VkCommandBuffer commands, VkDescriptorSet set) const;
    /// From here on `shader` is dispatched.
    Result<void> use(VkCommandBuffer commands, const Shader& shader);
    void push(VkCommandBuffer commands, const shared::Step& step) const;
    bool isCompiled(std::string_view shader) const { return pipelines_.find(shader) != pipelines_.end(); }
    /// How many there are of the shaders of an effect's passes: those that have a pass's name as a part (light_output).
    uint64_t compiledOf(const render::Effect& effect) const;
    /// A frame with these effects begins: pipelines of those that no frame has had for long go.
    void begin(render::EffectSet shown);

  private:
    explicit Pipelines(const Device& device) : device_(device) {}
    Result<void> add(const Shader& shader);
    const Device& device_;
    std::unique_ptr<PipelineCache> cache_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    std::map<std::string, VkPipeline, std::less<>> pipelines_;
    std::vector<uint32_t> idle_;  ///< of each effect: frames without it
};

/// Frames that may be in flight at once.
constexpr uint32_t kMostInFlight = 2;
static_assert(render::kEffectHold > kMostInFlight, "pipelines go that no frame in flight has");

}  // namespace stipple::gpu
