// The buffers of a frame in flight. They grow to what frames call for: what no frame has called for has no bytes.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "engine/gpu/device.h"
#include "engine/gpu/mesh_frame.h"
#include "engine/gpu/shader_table.h"
#include "engine/gpu/shadow_buffers.h"
#include "engine/render/backend.h"
#include "engine/render/patch_planes.h"

namespace stipple::gpu {

/// A level of the pyramid; `offset` in words.
struct Level {
    uint32_t width, height, offset;
};

/// What a frame leaves of a pixel beside its picture (shared/bindings.h): nothing, a depth, or all.
uint64_t extraFloatsOf(const render::RenderRequest& request);

/// Where on the device resident chunks are.
struct Residents {
    std::function<VkDeviceAddress(streaming::ChunkKey key)> addressOf;
    std::function<const MeshChunk&(streaming::ChunkKey key)> meshOf;
    std::function<const std::vector<lod::PatchPlane>&(streaming::ChunkKey key)> patchesOf;
    std::function<VkDeviceAddress(uint32_t source, uint32_t chunk)> tileOf;  ///< 0: not resident
};

class FrameBuffers {
  public:
    FrameBuffers(const Device& device, VkDescriptorSet set) : device_(device), set_(set) {}

    /// All that the frame's passes read from the host, and room for what they write; not while the device uses them.
    Result<void> prepare(const render::RenderRequest& request, const Residents& residents);

    const Buffer& at(uint32_t binding) const { return bound_.at(binding); }
    /// What a shader finds there: where no frame has called for it, a few bytes that nobody asks for.
    const Buffer& bound(uint32_t binding) const { return at(binding).bytes() > 0 ? at(binding) : nothing_; }
    const Buffer& readback() const { return readback_; }
    const std::vector<Level>& levels() const { return levels_; }
    /// Offset in words, in frames with Pass::smooth: that of what pixels show, while the levels are of smooth discs.
    uint32_t texelsOfPixels() const { return texelsOfPixels_; }
    uint32_t clusters() const { return static_cast<uint32_t>(meshFrame_.clusters.size()); }
    uint64_t residentTiles() const;
    /// Of some bindings.
    uint64_t bytesOf(std::initializer_list<uint32_t> bindings) const;
    /// Of the tables and planes of an effect.
    uint64_t bytesOf(const render::Effect& effect) const;

  private:
    Result<void> ensure(Buffer& buffer, uint64_t bytes, VkBufferUsageFlags usage, Memory memory, const char* name);
    Result<void> preparePlanes(const render::RenderRequest& request);
    Result<void> prepareLists(const render::RenderRequest& request);
    Result<void> prepareMeshes(const render::DrawList& draws, const Residents& residents);
    Result<void> prepareEnvironment(const std::shared_ptr<const render::Environment>& environment);
    Result<void> prepareBackdrop(const std::shared_ptr<const render::Backdrop>& backdrop);
    Result<void> prepareShadows(const render::DrawList& draws);
    Result<void> prepareLayer(const render::LayerTables& layer);
    Result<void> prepareEffects(const render::DrawList& draws);
    void releaseIdle(const render::DrawList& draws);
    void fillDraws(const render::DrawList& draws, const Residents& residents);
    template <typename T>
    Result<void> fill(uint32_t binding, const T* data, size_t count, const char* name);
    void writeDescriptors();

    const Device& device_;
    VkDescriptorSet set_;
    std::array<Buffer, shared::kBindings> bound_;
    std::shared_ptr<const render::Environment> environment_;  ///< that is in its buffer
    std::shared_ptr<const render::Backdrop> backdrop_;        ///< likewise
    Buffer readback_, nothing_;
    std::vector<Level> levels_;
    uint32_t texelsOfPixels_ = 0;
    MeshFrame meshFrame_;
    ShadowBuffers shadows_;
    std::vector<shared::DrawMesh> meshes_, patches_;  ///< of both; of patches
    std::vector<uint32_t> firstPatch_;                ///< of each of their nodes
    std::vector<uint32_t> idle_;                      ///< of each effect: frames without it
    bool descriptorsChanged_ = true;
};

}  // namespace stipple::gpu
