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
    static constexpr size_t kBindings = 19, kPointPasses = 5;
    static Result<std::unique_ptr<Pipelines>> create(const Device& device);
    ~Pipelines();
    Pipelines(const Pipelines&) = delete;
    Pipelines& operator=(const Pipelines&) = delete;
    /// In the order of the bindings.
    void writeDescriptors(const std::array<const Buffer*, kBindings>& buffers);
    void bind(VkCommandBuffer commands) const;
    /// The passes that only triangles need; created at the first call.
    Result<void> addMeshPasses();
    /// The passes that only ribbons and tubes need.
    Result<void> addStrandPasses();
    /// The passes that wide discs need.
    Result<void> addDiscPasses();
    /// The pass that lights need, of triangles and of points under lights of the scene's own.
    Result<void> addLightPass();
    size_t count() const { return pipelines_.size(); }
    size_t strandCount() const { return pipelines_.count("strand_texels") > 0 ? 3 : 0; }
    size_t discCount() const { return pipelines_.count("disc_texels") > 0 ? 3 : 0; }
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
};

}  // namespace stipple::gpu
