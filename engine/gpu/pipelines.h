// The compute pipelines of all passes: one descriptor set layout, one push constant block (see shaders/bindings.glsl).
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>

#include "engine/gpu/device.h"

namespace stipple::gpu {

/// Mirrors `Step` of shaders/bindings.glsl.
struct StepConstants {
    uint32_t fine, fineWidth, fineHeight, coarse, coarseWidth, coarseHeight, level, wantExtra, hasPyramid, hasTubes,
        count;
};
static_assert(sizeof(StepConstants) == 44);

class Pipelines {
  public:
    static constexpr size_t kBindings = 20;
    static Result<std::unique_ptr<Pipelines>> create(const Device& device);
    ~Pipelines();
    Pipelines(const Pipelines&) = delete;
    Pipelines& operator=(const Pipelines&) = delete;
    /// In the order of the bindings.
    void writeDescriptors(const std::array<const Buffer*, kBindings>& buffers);
    void bind(VkCommandBuffer commands) const;
    /// Pipelines that not every frame needs; they are compiled when one first calls for them.
    enum class Set : uint8_t { triangles, curves, wideDiscs, splats, plain, light };
    Result<void> call(Set set);
    /// How many were compiled for it.
    size_t countOf(Set set) const;
    void use(VkCommandBuffer commands, const std::string& pass) const;
    void push(VkCommandBuffer commands, const StepConstants& step) const;

  private:
    explicit Pipelines(const Device& device) : device_(device) {}
    Result<void> add(const std::string& pass, const uint32_t* code, size_t words);
    const Device& device_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    std::map<std::string, VkPipeline> pipelines_;
    std::map<Set, size_t> called_;
};

}  // namespace stipple::gpu
