#include "engine/gpu/frame_buffers.h"

#include <algorithm>
#include <cstring>

#include "engine/base/check.h"
#include "engine/gpu/pipelines.h"
#include "engine/render/layers.h"
#include "shaders/shared/pyramid_tail.h"
#include "shaders/shared/surface.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::gpu {
namespace {

using namespace shared;

constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                             kFilled = kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                             kCopied = kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                             kConstants = kStorage | VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT;

bool has(const render::RenderRequest& request, render::Pass pass) {
    return std::find(request.passes.begin(), request.passes.end(), pass) != request.passes.end();
}
/// Does any pass make a list of wide discs? (Projection does only where their own pass follows.)
bool listsDiscs(const render::RenderRequest& request) {
    return std::any_of(request.passes.begin(), request.passes.end(), [](render::Pass pass) {
        const bool isOther = pass != render::Pass::clear && pass != render::Pass::project;
        return isOther && render::passInfo(pass).writes.has(render::Plane::discList);
    });
}

}  // namespace

uint64_t extraFloatsOf(const render::RenderRequest& request) {
    return !request.wantDepthAndNormal ? 0 : request.isOfCasters ? 1 : kExtraFloats;
}

/// Grows `buffer` to at least `bytes`; descriptors are written again where it changes.
Result<void> FrameBuffers::ensure(Buffer& buffer, uint64_t bytes, VkBufferUsageFlags usage, Memory memory,
                                  const char* name) {
    bytes = std::max<uint64_t>(bytes, 256);
    if (buffer.bytes() >= bytes) return {};
    STIPPLE_ASSIGN(const uint64_t room, roomFor(device_.limits, bytes, usage, name, device_.deviceName));
    if (buffer.bytes() > 0) vkDeviceWaitIdle(device_.device);  // a window may still copy from it
    STIPPLE_ASSIGN(buffer, Buffer::create(device_, room, usage, memory, name));
    descriptorsChanged_ = true;
    return {};
}

Result<void> FrameBuffers::prepare(const render::RenderRequest& request, const Residents& residents) {
    const render::DrawList& draws = *request.draws;
    if (!request.isOfCasters) releaseIdle(draws);
    STIPPLE_TRY(preparePlanes(request));
    render::placePatches(draws, residents.patchesOf, patches_, firstPatch_);
    fillDraws(draws, residents);
    STIPPLE_TRY(prepareLists(request));
    if (draws.hasSurfaces()) STIPPLE_TRY(prepareMeshes(draws, residents));
    if (!draws.lights.empty()) STIPPLE_TRY(fill(kLightsBinding, draws.lights.data(), draws.lights.size(), "lights"));
    STIPPLE_TRY(prepareEnvironment(draws.environment));
    STIPPLE_TRY(prepareBackdrop(draws.backdrop));
    STIPPLE_TRY(prepareShadows(draws));
    if (draws.glass) STIPPLE_TRY(prepareLayer(*draws.glass));
    STIPPLE_TRY(prepareEffects(draws));
    if (descriptorsChanged_) writeDescriptors();
    return {};
}

/// Levels of the pyramid, and buffers that every frame needs.
Result<void> FrameBuffers::preparePlanes(const render::RenderRequest& request) {
    const render::DrawList& draws = *request.draws;
    const uint32_t w = draws.frame.width, h = draws.frame.height;
    levels_.clear();
    uint64_t words = 0;
    for (uint32_t lw = w, lh = h;; lw = (lw + 1) / 2, lh = (lh + 1) / 2) {
        levels_.push_back({lw, lh, static_cast<uint32_t>(words)});
        words += (uint64_t{kTexelWords} + (draws.frame.hasMaterials != 0 ? 1 : 0)) * lw * lh;
        if (lw == 1 && lh == 1) break;
    }
    STIPPLE_CHECK(levels_.size() <= kPyramidLevels, "a picture has more levels than are counted");
    texelsOfPixels_ = static_cast<uint32_t>(words);
    if (has(request, render::Pass::smooth))
        words += (uint64_t{kTexelWords} + (draws.frame.hasMaterials != 0 ? 1 : 0)) * w * h;
    const uint64_t pixels = uint64_t{w} * h, extra = pixels * extraFloatsOf(request);
    uint64_t nodes = 0;
    for (const render::DrawBatch& batch : draws.batches) nodes += batch.nodes.size();
    const uint64_t blocks = draws.frame.firstBlock.of[kKindDiscs];
    STIPPLE_TRY(ensure(nothing_, 0, kConstants, Memory::device, "nothing"));
    STIPPLE_TRY(ensure(bound_[kFrameBinding], sizeof(FrameConstants), kStorage, Memory::table, "frame constants"));
    STIPPLE_TRY(
        ensure(bound_[kNodesBinding], gpu::bytesOf(kNodesBinding, nodes), kStorage, Memory::table, "draw nodes"));
    STIPPLE_TRY(
        ensure(bound_[kBlocksBinding], gpu::bytesOf(kBlocksBinding, blocks), kStorage, Memory::table, "draw blocks"));
    STIPPLE_TRY(ensure(bound_[kVisibilityBinding], gpu::bytesOf(kVisibilityBinding, pixels), kFilled, Memory::device,
                       "visibility"));
    STIPPLE_TRY(ensure(bound_[kTexelsBinding], gpu::bytesOf(kTexelsBinding, words), kFilled, Memory::device, "texels"));
    STIPPLE_TRY(ensure(bound_[kStatsBinding], gpu::bytesOf(kStatsBinding, 2 * kPyramidLevels),
                       kFilled | kCopied | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, Memory::device, "stats"));
    STIPPLE_TRY(ensure(bound_[kSurfaceBinding], gpu::bytesOf(kSurfaceBinding, pixels), kStorage, Memory::device,
                       "surface buffer"));
    STIPPLE_TRY(ensure(bound_[kImageBinding], gpu::bytesOf(kImageBinding, pixels), kCopied, Memory::device, "image"));
    STIPPLE_TRY(ensure(bound_[kExtraBinding], gpu::bytesOf(kExtraBinding, extra), kCopied, Memory::device,
                       "depth and normals"));
    return ensure(readback_, gpu::bytesOf(kImageBinding, pixels) + gpu::bytesOf(kExtraBinding, extra),
                  VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::host, "readback");
}

/// Of what covers many pixels.
Result<void> FrameBuffers::prepareLists(const render::RenderRequest& request) {
    if (has(request, render::Pass::curves))
        STIPPLE_TRY(ensure(bound_[kWideBinding], gpu::bytesOf(kWideBinding, kWideCapacity), kFilled, Memory::device,
                           "filled curves"));
    if (listsDiscs(request))
        STIPPLE_TRY(ensure(bound_[kDiscsBinding], gpu::bytesOf(kDiscsBinding, kDiscCapacity), kFilled, Memory::device,
                           "wide discs"));
    if (has(request, render::Pass::ewa)) {
        const uint64_t pixels = uint64_t{request.draws->frame.width} * request.draws->frame.height;
        STIPPLE_TRY(
            ensure(bound_[kFrontsBinding], gpu::bytesOf(kFrontsBinding, pixels), kFilled, Memory::device, "fronts"));
        STIPPLE_TRY(ensure(bound_[kSumsBinding], gpu::bytesOf(kSumsBinding, pixels), kStorage, Memory::device, "sums"));
        STIPPLE_TRY(ensure(bound_[kFilteredBinding], gpu::bytesOf(kFilteredBinding, pixels), kStorage, Memory::device,
                           "blended discs"));
        STIPPLE_TRY(ensure(bound_[kCoverageBinding], gpu::bytesOf(kCoverageBinding, pixels), kStorage, Memory::device,
                           "coverage"));
        STIPPLE_TRY(ensure(bound_[kSecondGroupsBinding], gpu::bytesOf(kSecondGroupsBinding, kGroupShapes),
                           kFilled | kCopied | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, Memory::device,
                           "groups of second surfaces"));
        if (request.draws->frame.hasMaterials != 0)
            STIPPLE_TRY(ensure(bound_[kMaterialSumsBinding], gpu::bytesOf(kMaterialSumsBinding, pixels), kStorage,
                               Memory::device, "material sums"));
    }
    return {};
}

/// Frame constants; nodes of all kinds, one after another; blocks at their places in the frame (visibility.h). Kinds
/// without nodes have tables of their own.
void FrameBuffers::fillDraws(const render::DrawList& draws, const Residents& residents) {
    std::memcpy(bound_[kFrameBinding].mapped(), &draws.frame, sizeof(draws.frame));
    auto* nodes = static_cast<DrawNode*>(bound_[kNodesBinding].mapped());
    auto* const blocks = static_cast<DrawBlock*>(bound_[kBlocksBinding].mapped());
    uint32_t firstNode = 0;
    for (const render::DrawBatch& batch : draws.batches) {
        for (size_t i = 0; i < batch.nodes.size(); ++i) {
            DrawNode node = batch.nodes[i];
            const VkDeviceAddress address = residents.addressOf(batch.keys[i]);
            node.addressLow = static_cast<uint32_t>(address);
            node.addressHigh = static_cast<uint32_t>(address >> 32);
            if (batch.kind == lod::Kind::patches)
                node.weights = static_cast<uint32_t>(draws.meshes.size()) + firstPatch_[i];
            std::memcpy(nodes++, &node, sizeof(node));
        }
        const uint32_t firstBlock = draws.frame.firstBlock.of[static_cast<size_t>(batch.kind)];
        for (size_t i = 0; i < batch.blocks.size() && !batch.nodes.empty(); ++i) {
            DrawBlock block = batch.blocks[i];
            block.node += firstNode;
            std::memcpy(blocks + firstBlock + i, &block, sizeof(block));
        }
        firstNode += static_cast<uint32_t>(batch.nodes.size());
    }
}

template <typename T>
Result<void> FrameBuffers::fill(uint32_t binding, const T* data, size_t count, const char* name) {
    Buffer& buffer = bound_.at(binding);
    STIPPLE_TRY(ensure(buffer, gpu::bytesOf(binding, count), kStorage, Memory::table, name));
    if (count > 0) std::memcpy(buffer.mapped(), data, count * sizeof(T));
    return {};
}

/// Copied where it is another one than that of the last frame.
Result<void> FrameBuffers::prepareEnvironment(const std::shared_ptr<const render::Environment>& environment) {
    if (!environment || environment == environment_) return {};
    const std::vector<float>& table = environment->table;
    STIPPLE_TRY(fill(kEnvironmentBinding, table.data(), table.size(), "environment"));
    environment_ = environment;
    return {};
}

/// The same of a picture behind everything.
Result<void> FrameBuffers::prepareBackdrop(const std::shared_ptr<const render::Backdrop>& backdrop) {
    if (!backdrop || backdrop == backdrop_) return {};
    STIPPLE_TRY(fill(kBackdropBinding, backdrop->texels.data(), backdrop->texels.size(), "backdrop"));
    backdrop_ = backdrop;
    return {};
}

/// Maps of lights that cast shadows, and the table of where they are.
Result<void> FrameBuffers::prepareShadows(const render::DrawList& draws) {
    if (!draws.isShadowed) return {};
    STIPPLE_ASSIGN(const ShadowTable table, shadows_.prepare(device_, draws));
    STIPPLE_TRY(ensure(bound_[kShadowBinding], sizeof(table), kConstants, Memory::table, "shadow maps"));
    std::memcpy(bound_[kShadowBinding].mapped(), &table, sizeof(table));
    return {};
}

/// What only layers of glass need.
Result<void> FrameBuffers::prepareLayer(const render::LayerTables& layer) {
    STIPPLE_TRY(fill(kLayerBinding, &layer.constants, 1, "layer"));
    STIPPLE_TRY(fill(kOpticsBinding, layer.optics.data(), layer.optics.size(), "optics"));
    STIPPLE_TRY(fill(kBehindBinding, layer.behind.data(), layer.behind.size(), "behind the layer"));
    return fill(kBackBinding, layer.back.data(), layer.back.size(), "back of the layer");
}

/// Tables that effects have filled, and room for planes that their passes fill.
Result<void> FrameBuffers::prepareEffects(const render::DrawList& draws) {
    for (const render::EffectTable& table : draws.tables) {
        Buffer& buffer = bound_.at(table.binding);
        STIPPLE_TRY(ensure(buffer, table.bytes.size(), isUniform(table.binding) ? kConstants : kStorage, Memory::table,
                           "table of an effect"));
        std::memcpy(buffer.mapped(), table.bytes.data(), table.bytes.size());
    }
    for (size_t e = 0; e < render::effects().size(); ++e) {
        if (!draws.effects.has(e)) continue;
        const render::Effect& effect = *render::effects()[e];
        for (const render::EffectPlane& plane : effect.planes)
            STIPPLE_TRY(ensure(bound_.at(plane.binding), gpu::bytesOf(plane.binding, plane.elements(draws)), kFilled,
                               Memory::device, effect.name));
    }
    return {};
}

/// What effects have that no frame has shown for long.
void FrameBuffers::releaseIdle(const render::DrawList& draws) {
    idle_.resize(render::effects().size());
    const auto release = [&](uint32_t binding) {
        // Glass fills those of light and of the environment, too.
        const bool isFilled = (binding == kEnvironmentBinding && draws.environment != nullptr) ||
                              (binding == kLightsBinding && !draws.lights.empty());
        if (isFilled || bound_.at(binding).bytes() == 0) return;
        bound_.at(binding) = Buffer();
        descriptorsChanged_ = true;
        if (binding == kEnvironmentBinding) environment_.reset();
        if (binding == kBackdropBinding) backdrop_.reset();
        if (binding == kShadowBinding) shadows_.clear();
    };
    for (size_t e = 0; e < idle_.size(); ++e) {
        idle_[e] = draws.effects.has(e) ? 0 : idle_[e] + 1;
        if (idle_[e] < render::kEffectHold) continue;
        for (const uint32_t binding : render::effects()[e]->tables) release(binding);
        for (const render::EffectPlane& plane : render::effects()[e]->planes) release(plane.binding);
    }
}

/// What only triangles and patches need.
Result<void> FrameBuffers::prepareMeshes(const render::DrawList& draws, const Residents& residents) {
    meshFrame_.fill(draws, residents.meshOf, residents.tileOf);
    meshes_.assign(draws.meshes.begin(), draws.meshes.end());
    meshes_.insert(meshes_.end(), patches_.begin(), patches_.end());
    STIPPLE_TRY(fill(kMeshesBinding, meshes_.data(), meshes_.size(), "draw meshes"));
    STIPPLE_TRY(fill(kClustersBinding, meshFrame_.clusters.data(), meshFrame_.clusters.size(), "draw clusters"));
    STIPPLE_TRY(fill(kMaterialsBinding, draws.materials.data(), draws.materials.size(), "materials"));
    STIPPLE_TRY(fill(kTexturesBinding, meshFrame_.textures.data(), meshFrame_.textures.size(), "textures"));
    STIPPLE_TRY(fill(kTilesBinding, meshFrame_.tiles.data(), meshFrame_.tiles.size(), "texture tiles"));
    const uint64_t pixels = uint64_t{draws.frame.width} * draws.frame.height;
    STIPPLE_TRY(ensure(bound_[kTriangleWordsBinding], gpu::bytesOf(kTriangleWordsBinding, pixels * kTriangleWords),
                       kStorage, Memory::device, "triangle pixels"));
    return ensure(bound_[kLargeBinding], gpu::bytesOf(kLargeBinding, kLargeCapacity), kFilled, Memory::device,
                  "large triangles");
}

void FrameBuffers::writeDescriptors() {
    std::array<VkDescriptorBufferInfo, kBindings> infos{};
    std::array<VkWriteDescriptorSet, kBindings> writes{};
    for (uint32_t i = 0; i < kBindings; ++i) {
        infos.at(i) = {bound(i).handle(), 0, VK_WHOLE_SIZE};
        VkWriteDescriptorSet& write = writes.at(i);
        write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
        write.dstSet = set_;
        write.dstBinding = i;
        write.descriptorCount = 1;
        write.descriptorType = descriptorType(i);
        write.pBufferInfo = &infos.at(i);
    }
    vkUpdateDescriptorSets(device_.device, kBindings, writes.data(), 0, nullptr);
    descriptorsChanged_ = false;
}

uint64_t FrameBuffers::residentTiles() const {
    return static_cast<uint64_t>(std::count_if(meshFrame_.tiles.begin(), meshFrame_.tiles.end(),
                                               [](const TileAddress& t) { return t.low != 0 || t.high != 0; }));
}

uint64_t FrameBuffers::bytesOf(std::initializer_list<uint32_t> bindings) const {
    uint64_t sum = 0;
    for (const uint32_t b : bindings) sum += bound_.at(b).bytes();
    return sum;
}

uint64_t FrameBuffers::bytesOf(const render::Effect& effect) const {
    uint64_t sum = 0;
    for (const uint32_t b : effect.tables) sum += bound_.at(b).bytes() + (b == kShadowBinding ? shadows_.bytes() : 0);
    for (const render::EffectPlane& plane : effect.planes) sum += bound_.at(plane.binding).bytes();
    return sum;
}

}  // namespace stipple::gpu
