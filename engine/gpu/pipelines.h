// The compute pipelines: one descriptor set layout, one push constant block (shaders/shared/bindings.h). Each is
// compiled when a frame first calls for it.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "engine/gpu/device.h"
#include "engine/gpu/shader_table.h"

namespace stipple::gpu {

class Pipelines {
  public:
    static Result<std::unique_ptr<Pipelines>> create(const Device& device);
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

  private:
    explicit Pipelines(const Device& device) : device_(device) {}
    Result<void> add(const Shader& shader);
    const Device& device_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    std::map<std::string, VkPipeline, std::less<>> pipelines_;
};

/// Frames that may be in flight at once.
constexpr uint32_t kMostInFlight = 2;

}  // namespace stipple::gpu
