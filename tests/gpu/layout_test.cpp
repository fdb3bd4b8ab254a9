// The structs that CPU and GPU share have one layout: every field is written here, read by a shader field by field, and
// must come back in the order and with the bits of C++.
#include <gtest/gtest.h>

#include <array>
#include <cstring>

#include "engine/gpu/device.h"
#include "engine/gpu/shader_table.h"
#include "shaders/shared/curve.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/material.h"
#include "shaders/shared/mesh.h"
#include "shaders/shared/patch.h"
#include "shaders/shared/record.h"
#include "shaders/shared/texture.h"
#include "tests/gpu/one_time_commands.h"

namespace stipple::gpu {
namespace {

#include "test_shaders.inc"
constexpr const auto& kEcho = kCode_echo;

struct Shared {
    shared::FrameConstants frame;
    shared::DrawNode node;
    shared::DrawBlock block;
    shared::PointRecord record;
    shared::LightSource light;
    shared::MeshVertex vertex;
    shared::MeshCluster cluster;
    shared::DrawMesh mesh;
    shared::DrawCluster drawCluster;
    shared::SurfaceMaterial material;
    shared::CurveSegment segment;
    shared::TextureInfo textureInfo;
    shared::PatchBlock patchBlock;
};
// Words of four bytes throughout: no padding, in whatever order.
static_assert(sizeof(Shared) == sizeof(shared::FrameConstants) + sizeof(shared::DrawNode) + sizeof(shared::DrawBlock) +
                                    sizeof(shared::PointRecord) + sizeof(shared::LightSource) +
                                    sizeof(shared::MeshVertex) + sizeof(shared::MeshCluster) +
                                    sizeof(shared::DrawMesh) + sizeof(shared::DrawCluster) +
                                    sizeof(shared::SurfaceMaterial) + sizeof(shared::CurveSegment) +
                                    sizeof(shared::TextureInfo) + sizeof(shared::PatchBlock));

/// One dispatch of the echo shader.
class Echo {
  public:
    Echo(const Device& of, const Buffer& in, const Buffer& out) : device(of) { createPipeline(in, out); }
    ~Echo() {
        vkDestroyDescriptorPool(device.device, pool, nullptr);
        vkDestroyPipeline(device.device, pipeline, nullptr);
        vkDestroyShaderModule(device.device, module, nullptr);
        vkDestroyPipelineLayout(device.device, layout, nullptr);
        vkDestroyDescriptorSetLayout(device.device, setLayout, nullptr);
    }
    Echo(const Echo&) = delete;
    Echo& operator=(const Echo&) = delete;
    void run() {
        OneTimeCommands commands(device);
        vkCmdBindPipeline(commands.handle(), VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
        vkCmdBindDescriptorSets(commands.handle(), VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0, nullptr);
        vkCmdDispatch(commands.handle(), 1, 1, 1);
        commands.run();
    }

  private:
    void createPipeline(const Buffer& in, const Buffer& out) {
        std::array<VkDescriptorSetLayoutBinding, 2> bindings{};
        for (uint32_t i = 0; i < 2; ++i)
            bindings.at(i) = {i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
        VkDescriptorSetLayoutCreateInfo setInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO};
        setInfo.bindingCount = 2;
        setInfo.pBindings = bindings.data();
        ASSERT_EQ(vkCreateDescriptorSetLayout(device.device, &setInfo, nullptr, &setLayout), VK_SUCCESS);
        VkPipelineLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
        layoutInfo.setLayoutCount = 1;
        layoutInfo.pSetLayouts = &setLayout;
        ASSERT_EQ(vkCreatePipelineLayout(device.device, &layoutInfo, nullptr, &layout), VK_SUCCESS);
        VkShaderModuleCreateInfo moduleInfo{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
        moduleInfo.codeSize = sizeof(kEcho);
        moduleInfo.pCode = kEcho;
        ASSERT_EQ(vkCreateShaderModule(device.device, &moduleInfo, nullptr, &module), VK_SUCCESS);
        VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
        info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
        info.stage.module = module;
        info.stage.pName = "main";
        info.layout = layout;
        ASSERT_EQ(vkCreateComputePipelines(device.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), VK_SUCCESS);
        const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2};
        VkDescriptorPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
        poolInfo.maxSets = 1;
        poolInfo.poolSizeCount = 1;
        poolInfo.pPoolSizes = &size;
        ASSERT_EQ(vkCreateDescriptorPool(device.device, &poolInfo, nullptr, &pool), VK_SUCCESS);
        VkDescriptorSetAllocateInfo setAllocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
        setAllocate.descriptorPool = pool;
        setAllocate.descriptorSetCount = 1;
        setAllocate.pSetLayouts = &setLayout;
        ASSERT_EQ(vkAllocateDescriptorSets(device.device, &setAllocate, &set), VK_SUCCESS);
        for (uint32_t i = 0; i < 2; ++i) {
            const VkDescriptorBufferInfo buffer{(i == 0 ? in : out).handle(), 0, VK_WHOLE_SIZE};
            const VkWriteDescriptorSet write{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set,     i,      0, 1,
                                             VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,      nullptr, &buffer, nullptr};
            vkUpdateDescriptorSets(device.device, 1, &write, 0, nullptr);
        }
    }

    const Device& device;
    VkDescriptorSetLayout setLayout{};
    VkPipelineLayout layout{};
    VkShaderModule module{};
    VkPipeline pipeline{};
    VkDescriptorPool pool{};
    VkDescriptorSet set{};
};

TEST(SharedStructs, EveryFieldComesBackFromTheGpu) {
    auto made = Device::create({"", true, {}, {}});
    ASSERT_TRUE(made) << made.error().line();
    const Device& device = **made;
    const size_t words = sizeof(Shared) / 4;
    auto in = Buffer::create(device, sizeof(Shared), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, Memory::host, "in");
    auto out = Buffer::create(device, 4096, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, Memory::host, "out");
    ASSERT_TRUE(in && out);
    for (uint32_t i = 0; i < words; ++i) {
        const uint32_t value = 0x3f000000u + 257 * i;  // a normal float, different for every field
        std::memcpy(static_cast<char*>(in->mapped()) + 4 * i, &value, 4);
    }
    std::memset(out->mapped(), 0, 4096);

    Echo(device, *in, *out).run();
    const auto* got = static_cast<const uint32_t*>(out->mapped());
    const auto* expected = static_cast<const uint32_t*>(in->mapped());
    for (size_t i = 0; i < words; ++i) EXPECT_EQ(got[i], expected[i]) << "word " << i;
    EXPECT_EQ(got[words], 0u) << "the shader knows a field that C++ does not";
    for (const std::string& message : device.messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace stipple::gpu
