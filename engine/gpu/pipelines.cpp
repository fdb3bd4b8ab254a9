#include "engine/gpu/pipelines.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "engine/base/check.h"

namespace stipple::gpu {

Result<std::unique_ptr<Pipelines>> Pipelines::create(const Device& device, const std::string& cacheFolder) {
    std::unique_ptr<Pipelines> p(new Pipelines(device));
    p->cache_ = std::make_unique<PipelineCache>(device, cacheFolder);
    std::array<VkDescriptorSetLayoutBinding, shared::kBindings> bindings{};
    for (uint32_t i = 0; i < shared::kBindings; ++i)
        bindings.at(i) = {i, descriptorType(i), 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
    setInfo.bindingCount = shared::kBindings;
    setInfo.pBindings = bindings.data();
    if (const VkResult r = vkCreateDescriptorSetLayout(device.device, &setInfo, nullptr, &p->setLayout_);
        r != VK_SUCCESS)
        return vulkanError(r, "no descriptor layout");
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(shared::Step)};
    VkPipelineLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    layoutInfo.setLayoutCount = 1;
    layoutInfo.pSetLayouts = &p->setLayout_;
    layoutInfo.pushConstantRangeCount = 1;
    layoutInfo.pPushConstantRanges = &range;
    if (const VkResult r = vkCreatePipelineLayout(device.device, &layoutInfo, nullptr, &p->layout_); r != VK_SUCCESS)
        return vulkanError(r, "no pipeline layout");
    const std::array<VkDescriptorPoolSize, 2> sizes{
        {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, (shared::kBindings - countUniform()) * kMostInFlight},
         {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, countUniform() * kMostInFlight}}};
    VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
    poolInfo.maxSets = kMostInFlight;
    poolInfo.poolSizeCount = static_cast<uint32_t>(sizes.size());
    poolInfo.pPoolSizes = sizes.data();
    if (const VkResult r = vkCreateDescriptorPool(device.device, &poolInfo, nullptr, &p->pool_); r != VK_SUCCESS)
        return vulkanError(r, "no descriptor pool");
    return p;
}

Result<VkDescriptorSet> Pipelines::makeSet() {
    VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
    allocate.descriptorPool = pool_;
    allocate.descriptorSetCount = 1;
    allocate.pSetLayouts = &setLayout_;
    VkDescriptorSet set = VK_NULL_HANDLE;
    if (const VkResult r = vkAllocateDescriptorSets(device_.device, &allocate, &set); r != VK_SUCCESS)
        return vulkanError(r, "no descriptor set");
    return set;
}

Result<void> Pipelines::add(const Shader& shader) {
    VkShaderModuleCreateInfo moduleInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    moduleInfo.codeSize = shader.code.size_bytes();
    moduleInfo.pCode = shader.code.data();
    const std::string name = shader.name;
    VkShaderModule module = VK_NULL_HANDLE;
    if (const VkResult r = vkCreateShaderModule(device_.device, &moduleInfo, nullptr, &module); r != VK_SUCCESS)
        return vulkanError(r, "no shader " + name);
    VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.layout = layout_;
    VkPipeline pipeline = VK_NULL_HANDLE;
    const VkResult r = vkCreateComputePipelines(device_.device, cache_->handle(), 1, &info, nullptr, &pipeline);
    vkDestroyShaderModule(device_.device, module, nullptr);
    if (r != VK_SUCCESS) return vulkanError(r, "no pipeline " + name);
    device_.setName(VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(pipeline), name);
    pipelines_[name] = pipeline;
    return {};
}

Pipelines::~Pipelines() {
    for (const auto& [name, pipeline] : pipelines_) vkDestroyPipeline(device_.device, pipeline, nullptr);
    vkDestroyDescriptorPool(device_.device, pool_, nullptr);
    vkDestroyPipelineLayout(device_.device, layout_, nullptr);
    vkDestroyDescriptorSetLayout(device_.device, setLayout_, nullptr);
}

void Pipelines::bind(VkCommandBuffer commands, VkDescriptorSet set) const {
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set, 0, nullptr);
}
Result<void> Pipelines::use(VkCommandBuffer commands, const Shader& shader) {
    if (!isCompiled(shader.name)) STIPPLE_TRY(add(shader));
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines_.find(shader.name)->second);
    return {};
}
namespace {

/// Is one of an effect's passes a part of the name? light_fog_output is of three.
bool isOf(std::string_view shader, const render::Effect& effect) {
    const auto hasOne = [&](std::span<const render::Pass> passes, std::string_view part) {
        return std::any_of(passes.begin(), passes.end(), [&](render::Pass p) { return part == render::passName(p); });
    };
    for (std::string_view rest = shader; !rest.empty();) {
        const std::string_view part = rest.substr(0, rest.find('_'));
        if (hasOne(effect.passes, part) || (effect.before != nullptr && hasOne(effect.before->passes, part)))
            return true;
        rest.remove_prefix(std::min(part.size() + 1, rest.size()));
    }
    return false;
}

}  // namespace

uint64_t Pipelines::compiledOf(const render::Effect& effect) const {
    return static_cast<uint64_t>(std::count_if(pipelines_.begin(), pipelines_.end(),
                                               [&](const auto& entry) { return isOf(entry.first, effect); }));
}
void Pipelines::begin(render::EffectSet shown) {
    idle_.resize(render::effects().size());
    for (size_t e = 0; e < idle_.size(); ++e) {
        idle_[e] = shown.has(e) ? 0 : idle_[e] + 1;
        if (idle_[e] != render::kEffectHold) continue;
        std::erase_if(pipelines_, [&](const auto& entry) {
            const bool goes = isOf(entry.first, *render::effects()[e]);
            if (goes) vkDestroyPipeline(device_.device, entry.second, nullptr);
            return goes;
        });
    }
}
void Pipelines::push(VkCommandBuffer commands, const shared::Step& step) const {
    vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(step), &step);
}

}  // namespace stipple::gpu
