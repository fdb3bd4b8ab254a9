#include "engine/gpu/pipelines.h"

#include <span>
#include <vector>

namespace stipple::gpu {
namespace {

constexpr uint32_t kProject[] = {
#include "project.inc"
};
constexpr uint32_t kResolve[] = {
#include "resolve.inc"
};
constexpr uint32_t kPull[] = {
#include "pull.inc"
};
constexpr uint32_t kPush[] = {
#include "push.inc"
};
constexpr uint32_t kSurface[] = {
#include "surface.inc"
};
constexpr uint32_t kOutput[] = {
#include "output.inc"
};
constexpr uint32_t kOutputLit[] = {
#include "output_lit.inc"
};
constexpr uint32_t kSplat[] = {
#include "splat.inc"
};

constexpr uint32_t kRasterise[] = {
#include "rasterise.inc"
};
constexpr uint32_t kRasteriseLarge[] = {
#include "rasterise_large.inc"
};
constexpr uint32_t kTriangleTexels[] = {
#include "triangle_texels.inc"
};
constexpr uint32_t kStrands[] = {
#include "strands.inc"
};
constexpr uint32_t kStrandsWide[] = {
#include "strands_wide.inc"
};
constexpr uint32_t kStrandTexels[] = {
#include "strand_texels.inc"
};
constexpr uint32_t kDiscs[] = {
#include "discs.inc"
};
constexpr uint32_t kDiscOrder[] = {
#include "disc_order.inc"
};
constexpr uint32_t kDiscTexels[] = {
#include "disc_texels.inc"
};

}  // namespace

Result<std::unique_ptr<Pipelines>> Pipelines::create(const Device& device) {
    std::unique_ptr<Pipelines> p(new Pipelines(device));
    std::array<VkDescriptorSetLayoutBinding, kBindings> bindings{};
    for (uint32_t i = 0; i < kBindings; ++i)
        bindings.at(i) = {i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
    setInfo.bindingCount = kBindings;
    setInfo.pBindings = bindings.data();
    if (const VkResult r = vkCreateDescriptorSetLayout(device.device, &setInfo, nullptr, &p->setLayout_);
        r != VK_SUCCESS)
        return vulkanError(r, "no descriptor layout");
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(StepConstants)};
    VkPipelineLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    layoutInfo.setLayoutCount = 1;
    layoutInfo.pSetLayouts = &p->setLayout_;
    layoutInfo.pushConstantRangeCount = 1;
    layoutInfo.pPushConstantRanges = &range;
    if (const VkResult r = vkCreatePipelineLayout(device.device, &layoutInfo, nullptr, &p->layout_); r != VK_SUCCESS)
        return vulkanError(r, "no pipeline layout");
    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, kBindings};
    VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
    poolInfo.maxSets = 1;
    poolInfo.poolSizeCount = 1;
    poolInfo.pPoolSizes = &size;
    if (const VkResult r = vkCreateDescriptorPool(device.device, &poolInfo, nullptr, &p->pool_); r != VK_SUCCESS)
        return vulkanError(r, "no descriptor pool");
    VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    allocate.descriptorPool = p->pool_;
    allocate.descriptorSetCount = 1;
    allocate.pSetLayouts = &p->setLayout_;
    if (const VkResult r = vkAllocateDescriptorSets(device.device, &allocate, &p->set_); r != VK_SUCCESS)
        return vulkanError(r, "no descriptor set");
    STIPPLE_TRY(p->add("project", kProject, std::size(kProject)));
    STIPPLE_TRY(p->add("resolve", kResolve, std::size(kResolve)));
    STIPPLE_TRY(p->add("pull", kPull, std::size(kPull)));
    STIPPLE_TRY(p->add("push", kPush, std::size(kPush)));
    STIPPLE_TRY(p->add("surface", kSurface, std::size(kSurface)));
    return p;
}

Result<void> Pipelines::call(Set set) {
    struct Shader {
        const char* name;
        std::span<const uint32_t> code;
    };
    static const std::map<Set, std::vector<Shader>> kSets{
        {Set::triangles,
         {{"rasterise", kRasterise}, {"rasterise_large", kRasteriseLarge}, {"triangle_texels", kTriangleTexels}}},
        {Set::curves, {{"strands", kStrands}, {"strands_wide", kStrandsWide}, {"strand_texels", kStrandTexels}}},
        {Set::wideDiscs, {{"disc_order", kDiscOrder}, {"discs", kDiscs}, {"disc_texels", kDiscTexels}}},
        {Set::splats, {{"splat", kSplat}, {"discs", kDiscs}}},
        {Set::plain, {{"output", kOutput}}},
        {Set::light, {{"output_lit", kOutputLit}}},
    };
    for (const Shader& s : kSets.at(set))
        if (pipelines_.count(s.name) == 0) STIPPLE_TRY(add(s.name, s.code.data(), s.code.size()));
    called_[set] = kSets.at(set).size();
    return {};
}

size_t Pipelines::countOf(Set set) const {
    const auto found = called_.find(set);
    return found == called_.end() ? 0 : found->second;
}

Result<void> Pipelines::add(const std::string& pass, const uint32_t* code, size_t words) {
    VkShaderModuleCreateInfo moduleInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    moduleInfo.codeSize = words * 4;
    moduleInfo.pCode = code;
    VkShaderModule module = VK_NULL_HANDLE;
    if (const VkResult r = vkCreateShaderModule(device_.device, &moduleInfo, nullptr, &module); r != VK_SUCCESS)
        return vulkanError(r, "no shader " + pass);
    VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.layout = layout_;
    VkPipeline pipeline = VK_NULL_HANDLE;
    const VkResult r = vkCreateComputePipelines(device_.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
    vkDestroyShaderModule(device_.device, module, nullptr);
    if (r != VK_SUCCESS) return vulkanError(r, "no pipeline " + pass);
    device_.setName(VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(pipeline), pass);
    pipelines_[pass] = pipeline;
    return {};
}

Pipelines::~Pipelines() {
    for (const auto& [name, pipeline] : pipelines_) vkDestroyPipeline(device_.device, pipeline, nullptr);
    vkDestroyDescriptorPool(device_.device, pool_, nullptr);
    vkDestroyPipelineLayout(device_.device, layout_, nullptr);
    vkDestroyDescriptorSetLayout(device_.device, setLayout_, nullptr);
}

void Pipelines::writeDescriptors(const std::array<const Buffer*, kBindings>& buffers) {
    std::array<VkDescriptorBufferInfo, kBindings> infos{};
    std::array<VkWriteDescriptorSet, kBindings> writes{};
    for (uint32_t i = 0; i < kBindings; ++i) {
        infos.at(i) = {buffers.at(i)->handle(), 0, VK_WHOLE_SIZE};
        writes.at(i) = {VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set_,         i,      0, 1,
                        VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,      nullptr, &infos.at(i), nullptr};
    }
    vkUpdateDescriptorSets(device_.device, kBindings, writes.data(), 0, nullptr);
}

void Pipelines::bind(VkCommandBuffer commands) const {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set_, 0, nullptr);
}
void Pipelines::use(VkCommandBuffer commands, const std::string& pass) const {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines_.at(pass));
}
void Pipelines::push(VkCommandBuffer commands, const StepConstants& step) const {
    vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(step), &step);
}

}  // namespace stipple::gpu
