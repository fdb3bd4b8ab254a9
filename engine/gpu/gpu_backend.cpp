#include "engine/gpu/gpu_backend.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <unordered_map>

#include "engine/gpu/mesh_frame.h"
#include "engine/gpu/pages.h"
#include "engine/gpu/record.h"
#include "shaders/shared/surface.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::gpu {
namespace {

constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;

uint64_t chunkId(streaming::ChunkKey key) { return uint64_t{key.source} << 32 | key.chunk; }

class GpuBackend final : public render::Backend {
  public:
    static Result<std::unique_ptr<render::Backend>> create(const GpuSettings& settings) {
        STIPPLE_ASSIGN(std::unique_ptr<Device> device,
                       Device::create({settings.deviceName, settings.validation, {}, {}}));
        std::unique_ptr<GpuBackend> b(new GpuBackend(std::move(device), settings));
        STIPPLE_ASSIGN(b->pipelines_, Pipelines::create(*b->device_));
        STIPPLE_TRY(b->createCommandObjects());
        return b;
    }

    ~GpuBackend() override {
        vkDeviceWaitIdle(device_->device);
        vkDestroyQueryPool(device_->device, queries_, nullptr);
        vkDestroyFence(device_->device, fence_, nullptr);
        vkDestroyCommandPool(device_->device, commandPool_, nullptr);
    }

    std::string name() const override { return "gpu"; }
    std::string device() const override { return device_->deviceName; }
    const std::vector<render::PassTime>& passTimes() const override { return times_; }
    std::vector<std::string> messages() const { return device_->messages(); }

    render::BackendResources resources() const override {
        render::BackendResources r;
        r.strandPipelines = pipelines_->countOf(Pipelines::Set::curves);
        r.lightPipelines = pipelines_->countOf(Pipelines::Set::light);
        r.strandBytes = buffers_.wide.bytes();
        r.effectBytes = buffers_.lights.bytes() + buffers_.environment.bytes();
        r.meshPipelines = pipelines_->countOf(Pipelines::Set::triangles);
        for (const Buffer* b : {&buffers_.meshes, &buffers_.clusters, &buffers_.materials, &buffers_.textures,
                                &buffers_.tiles, &buffers_.triangleWords, &buffers_.large})
            r.meshBytes += b->bytes();
        for (const auto& t : meshFrame_.tiles) r.textureTiles += t.low != 0 || t.high != 0;
        return r;
    }

    Result<void> upload(streaming::ChunkKey key, const lod::Chunk& chunk) override {
        STIPPLE_ASSIGN(const PageStore::Place place, pages_.allocate(chunk.sizeBytes()));
        places_[chunkId(key)] = place;
        pending_.push_back({place, bytesOf(chunk)});
        if (!chunk.clusters.empty()) {
            const VkDeviceAddress address = pages_.address(place);
            meshChunks_[chunkId(key)] = {address, address + chunk.vertices.size() * sizeof(shared::MeshVertex),
                                         chunk.clusters};
        }
        return {};
    }
    void evict(streaming::ChunkKey key) override {
        const auto found = places_.find(chunkId(key));
        std::erase_if(pending_, [&](const PendingUpload& p) {
            return p.place.page == found->second.page && p.place.offset == found->second.offset;
        });
        pages_.release(found->second);
        places_.erase(found);
        meshChunks_.erase(chunkId(key));
    }

    Result<void> render(const render::RenderRequest& request, render::Image& image) override {
        const render::DrawList& draws = *request.draws;
        const render::Reconstruction& mode = render::reconstructionOf(request.mode);
        const auto has = [&](render::Pass pass) {
            return std::find(request.passes.begin(), request.passes.end(), pass) != request.passes.end();
        };
        const bool isLit = has(render::Pass::light);
        STIPPLE_TRY(prepare(draws, mode, isLit, request.wantDepthAndNormal));
        STIPPLE_TRY(begin());
        PassList list(*device_, commands_, queries_, omitBarriersBefore_);
        if (!pending_.empty()) STIPPLE_TRY(recordUploads(list));
        const Recording recording{list,
                                  *pipelines_,
                                  commands_,
                                  buffers_,
                                  levels_,
                                  draws,
                                  mode,
                                  draws.triangles().isEmpty() ? 0 : static_cast<uint32_t>(meshFrame_.clusters.size()),
                                  request.wantDepthAndNormal,
                                  isLit,
                                  has(render::Pass::push)};
        for (const render::Pass pass : request.passes) recordPass(recording, pass);
        recordReadback(list, request.wantDepthAndNormal);
        STIPPLE_TRY(submit());
        takeTimes(list);
        takeImage(draws, request.wantDepthAndNormal, image);
        return {};
    }

  private:
    static std::vector<uint8_t> bytesOf(const lod::Chunk& chunk) {
        std::vector<uint8_t> bytes;
        const auto append = [&](const auto& values) {
            const auto* from = reinterpret_cast<const uint8_t*>(values.data());
            bytes.insert(bytes.end(), from, from + values.size() * sizeof(values[0]));
        };
        append(chunk.records);
        append(chunk.segments);
        append(chunk.vertices);
        append(chunk.triangles);
        append(chunk.texels);
        return bytes;
    }

    GpuBackend(std::unique_ptr<Device> device, const GpuSettings& settings)
        : device_(std::move(device)), pages_(*device_), omitBarriersBefore_(settings.omitBarriersBefore) {}

    Result<void> createCommandObjects() {
        VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
        pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
        pool.queueFamilyIndex = device_->queueFamily;
        if (const VkResult r = vkCreateCommandPool(device_->device, &pool, nullptr, &commandPool_); r != VK_SUCCESS)
            return vulkanError(r, "no command pool");
        VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
        allocate.commandPool = commandPool_;
        allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
        allocate.commandBufferCount = 1;
        if (const VkResult r = vkAllocateCommandBuffers(device_->device, &allocate, &commands_); r != VK_SUCCESS)
            return vulkanError(r, "no command buffer");
        VkFenceCreateInfo fence{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
        if (const VkResult r = vkCreateFence(device_->device, &fence, nullptr, &fence_); r != VK_SUCCESS)
            return vulkanError(r, "no fence");
        VkQueryPoolCreateInfo query{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
        query.queryType = VK_QUERY_TYPE_TIMESTAMP;
        query.queryCount = PassList::kMaxPasses * 2;
        if (const VkResult r = vkCreateQueryPool(device_->device, &query, nullptr, &queries_); r != VK_SUCCESS)
            return vulkanError(r, "no query pool");
        return {};
    }

    /// Grows `buffer` to at least `bytes`; true if it changed (descriptors must be written again).
    Result<void> ensure(Buffer& buffer, uint64_t bytes, VkBufferUsageFlags usage, bool hostVisible, const char* name) {
        bytes = std::max<uint64_t>(bytes, 256);
        if (buffer.bytes() >= bytes) return {};
        STIPPLE_ASSIGN(const uint64_t room, roomFor(device_->limits, bytes, usage, name, device_->deviceName));
        STIPPLE_ASSIGN(buffer, Buffer::create(*device_, room, usage, hostVisible, name));
        descriptorsChanged_ = true;
        return {};
    }

    Result<void> prepare(const render::DrawList& draws, const render::Reconstruction& mode, bool isLit, bool wantAll) {
        const uint64_t pixels = uint64_t{draws.frame.width} * draws.frame.height;
        STIPPLE_TRY(preparePlanes(draws, wantAll));
        fillDraws(draws);
        if (!draws.curves().isEmpty()) {
            STIPPLE_TRY(pipelines_->call(Pipelines::Set::curves));
            STIPPLE_TRY(ensure(buffers_.wide, 4 + uint64_t{kWideCapacity} * 120,
                               kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, false, "wide strands"));
        }
        const bool hasDiscs = mode.hasPyramid && draws.hasWideDiscs;
        const bool hasSplats = mode.fillsSplats && !draws.points().isEmpty();
        if (hasDiscs) STIPPLE_TRY(pipelines_->call(Pipelines::Set::wideDiscs));
        if (hasSplats) STIPPLE_TRY(pipelines_->call(Pipelines::Set::splats));
        if (hasDiscs || hasSplats) {
            STIPPLE_TRY(ensure(buffers_.discs, 4 + uint64_t{shared::kDiscCapacity} * sizeof(shared::WideDisc),
                               kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, false, "wide discs"));
        }
        if (!draws.triangles().isEmpty()) STIPPLE_TRY(prepareMeshes(draws, pixels));
        STIPPLE_TRY(pipelines_->call(isLit ? Pipelines::Set::light : Pipelines::Set::plain));
        if (isLit) STIPPLE_TRY(prepareLights(draws));
        if (descriptorsChanged_) writeDescriptors();
        return {};
    }

    /// Levels of the pyramid, and buffers that every frame needs.
    Result<void> preparePlanes(const render::DrawList& draws, bool wantAll) {
        const uint32_t w = draws.frame.width, h = draws.frame.height;
        levels_.clear();
        uint64_t words = 0;
        for (uint32_t lw = w, lh = h;; lw = (lw + 1) / 2, lh = (lh + 1) / 2) {
            levels_.push_back({lw, lh, static_cast<uint32_t>(words)});
            words += uint64_t{5} * lw * lh;
            if (lw == 1 && lh == 1) break;
        }
        const uint64_t pixels = uint64_t{w} * h;
        STIPPLE_TRY(ensure(buffers_.frame, sizeof(shared::FrameConstants), kStorage, true, "frame constants"));
        // Nodes and blocks of points, then those of strands.
        STIPPLE_TRY(ensure(buffers_.nodes,
                           (draws.points().nodes.size() + draws.curves().nodes.size()) * sizeof(shared::DrawNode),
                           kStorage, true, "draw nodes"));
        STIPPLE_TRY(ensure(buffers_.blocks,
                           (draws.points().blocks.size() + draws.curves().blocks.size()) * sizeof(shared::DrawBlock),
                           kStorage, true, "draw blocks"));
        STIPPLE_TRY(
            ensure(buffers_.visibility, pixels * 8, kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, false, "visibility"));
        STIPPLE_TRY(ensure(buffers_.texels, words * 4, kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, false, "texels"));
        STIPPLE_TRY(ensure(buffers_.stats, 256, kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, false, "stats"));
        STIPPLE_TRY(ensure(buffers_.surface, pixels * sizeof(shared::SurfaceWords), kStorage, false, "surface buffer"));
        STIPPLE_TRY(ensure(buffers_.image, pixels * 4, kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, false, "image"));
        STIPPLE_TRY(ensure(buffers_.extra, wantAll ? pixels * 28 : 256, kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                           false, "depth and normals"));
        STIPPLE_TRY(ensure(buffers_.readback, pixels * 4 + (wantAll ? pixels * 28 : 0),
                           VK_BUFFER_USAGE_TRANSFER_DST_BIT, true, "readback"));
        return {};
    }

    /// Frame constants, nodes and blocks of points, then those of curves.
    void fillDraws(const render::DrawList& draws) {
        std::memcpy(buffers_.frame.mapped(), &draws.frame, sizeof(draws.frame));
        auto* nodes = static_cast<shared::DrawNode*>(buffers_.nodes.mapped());
        const auto placeNode = [&](shared::DrawNode node, streaming::ChunkKey key) {
            const VkDeviceAddress address = pages_.address(places_.at(chunkId(key)));
            node.addressLow = static_cast<uint32_t>(address);
            node.addressHigh = static_cast<uint32_t>(address >> 32);
            std::memcpy(nodes++, &node, sizeof(node));
        };
        for (size_t i = 0; i < draws.points().nodes.size(); ++i)
            placeNode(draws.points().nodes[i], draws.points().keys[i]);
        for (size_t i = 0; i < draws.curves().nodes.size(); ++i)
            placeNode(draws.curves().nodes[i], draws.curves().keys[i]);
        auto* blocks = static_cast<shared::DrawBlock*>(buffers_.blocks.mapped());
        if (!draws.points().blocks.empty())
            std::memcpy(blocks, draws.points().blocks.data(), draws.points().blocks.size() * sizeof(shared::DrawBlock));
        for (size_t i = 0; i < draws.curves().blocks.size(); ++i) {
            shared::DrawBlock block = draws.curves().blocks[i];
            block.node += static_cast<uint32_t>(draws.points().nodes.size());
            std::memcpy(blocks + draws.points().blocks.size() + i, &block, sizeof(block));
        }
    }

    void writeDescriptors() {
        const auto bound = [&](const Buffer& b) { return b.bytes() > 0 ? &b : &buffers_.stats; };  // unused: anything
        pipelines_->writeDescriptors({&buffers_.frame,
                                      &buffers_.nodes,
                                      &buffers_.blocks,
                                      &buffers_.visibility,
                                      &buffers_.texels,
                                      &buffers_.stats,
                                      &buffers_.image,
                                      &buffers_.extra,
                                      bound(buffers_.meshes),
                                      bound(buffers_.clusters),
                                      bound(buffers_.materials),
                                      bound(buffers_.textures),
                                      bound(buffers_.tiles),
                                      bound(buffers_.lights),
                                      bound(buffers_.triangleWords),
                                      bound(buffers_.large),
                                      bound(buffers_.environment),
                                      bound(buffers_.wide),
                                      bound(buffers_.discs),
                                      &buffers_.surface});
        descriptorsChanged_ = false;
    }

    template <typename T>
    Result<void> fillBuffer(Buffer& buffer, const T* data, size_t count, const char* name) {
        STIPPLE_TRY(ensure(buffer, count * sizeof(T), kStorage, true, name));
        if (count > 0) std::memcpy(buffer.mapped(), data, count * sizeof(T));
        return {};
    }

    Result<void> prepareLights(const render::DrawList& draws) {
        if (draws.lights.empty() && !draws.environment) return {};
        STIPPLE_TRY(fillBuffer(buffers_.lights, draws.lights.data(), draws.lights.size(), "lights"));
        if (!draws.environment) return {};
        return fillBuffer(buffers_.environment, draws.environment->table.data(), draws.environment->table.size(),
                          "environment");
    }

    /// Buffers and pipelines that only triangles need.
    Result<void> prepareMeshes(const render::DrawList& draws, uint64_t pixels) {
        STIPPLE_TRY(pipelines_->call(Pipelines::Set::triangles));
        meshFrame_.fill(
            draws, [&](streaming::ChunkKey key) -> const MeshChunk& { return meshChunks_.at(chunkId(key)); },
            [&](uint32_t source, uint32_t chunk) -> VkDeviceAddress {
                const auto found = places_.find(chunkId({source, chunk}));
                return found == places_.end() ? 0 : pages_.address(found->second);
            });
        STIPPLE_TRY(fillBuffer(buffers_.meshes, draws.meshes.data(), draws.meshes.size(), "draw meshes"));
        STIPPLE_TRY(
            fillBuffer(buffers_.clusters, meshFrame_.clusters.data(), meshFrame_.clusters.size(), "draw clusters"));
        STIPPLE_TRY(fillBuffer(buffers_.materials, draws.materials.data(), draws.materials.size(), "materials"));
        STIPPLE_TRY(fillBuffer(buffers_.textures, meshFrame_.textures.data(), meshFrame_.textures.size(), "textures"));
        STIPPLE_TRY(fillBuffer(buffers_.tiles, meshFrame_.tiles.data(), meshFrame_.tiles.size(), "texture tiles"));
        STIPPLE_TRY(ensure(buffers_.triangleWords, pixels * 8, kStorage, false, "triangle pixels"));
        return ensure(buffers_.large, 4 + uint64_t{kLargeCapacity} * 40, kStorage | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                      false, "large triangles");
    }

    Result<void> begin() {
        VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
        info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
        if (const VkResult r = vkBeginCommandBuffer(commands_, &info); r != VK_SUCCESS)
            return vulkanError(r, "cannot record");
        vkResetQueryPool(device_->device, queries_, 0, PassList::kMaxPasses * 2);
        pipelines_->bind(commands_);
        return {};
    }

    Result<void> recordUploads(PassList& list) {
        uint64_t bytes = 0;
        for (const PendingUpload& p : pending_) bytes += p.bytes.size();
        STIPPLE_TRY(ensure(buffers_.staging, bytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true, "staging"));
        list.begin("upload", {}, true);
        uint64_t at = 0;
        for (const PendingUpload& p : pending_) {
            const uint64_t size = p.bytes.size();
            std::memcpy(static_cast<char*>(buffers_.staging.mapped()) + at, p.bytes.data(), size);
            const VkBufferCopy region{at, p.place.offset, size};
            vkCmdCopyBuffer(commands_, buffers_.staging.handle(), pages_.buffer(p.place), 1, &region);
            at += size;
        }
        list.end();
        pending_.clear();
        return {};
    }

    void recordReadback(PassList& list, bool wantAll) {
        const uint64_t pixels = uint64_t{levels_[0].width} * levels_[0].height;
        list.begin(
            "readback",
            {{buffers_.image.handle(), false}, {buffers_.extra.handle(), false}, {buffers_.readback.handle(), true}},
            true);
        VkBufferCopy region{0, 0, pixels * 4};
        vkCmdCopyBuffer(commands_, buffers_.image.handle(), buffers_.readback.handle(), 1, &region);
        if (wantAll) {
            region = {0, pixels * 4, pixels * 28};
            vkCmdCopyBuffer(commands_, buffers_.extra.handle(), buffers_.readback.handle(), 1, &region);
        }
        list.end();
        list.toHost(buffers_.readback.handle());
    }

    Result<void> submit() {
        if (const VkResult r = vkEndCommandBuffer(commands_); r != VK_SUCCESS)
            return vulkanError(r, "cannot end recording");
        VkCommandBufferSubmitInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
        buffer.commandBuffer = commands_;
        VkSubmitInfo2 info{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
        info.commandBufferInfoCount = 1;
        info.pCommandBufferInfos = &buffer;
        if (const VkResult r = vkQueueSubmit2(device_->queue, 1, &info, fence_); r != VK_SUCCESS)
            return vulkanError(r, "cannot submit");
        if (const VkResult r = vkWaitForFences(device_->device, 1, &fence_, VK_TRUE, ~uint64_t{0}); r != VK_SUCCESS)
            return vulkanError(r, "the device was lost");
        vkResetFences(device_->device, 1, &fence_);
        return {};
    }

    void takeTimes(const PassList& list) {
        std::vector<uint64_t> stamps(list.names().size() * 2);
        times_.clear();
        if (stamps.empty() ||
            vkGetQueryPoolResults(device_->device, queries_, 0, static_cast<uint32_t>(stamps.size()), stamps.size() * 8,
                                  stamps.data(), 8, VK_QUERY_RESULT_64_BIT) != VK_SUCCESS)
            return;
        for (size_t i = 0; i < list.names().size(); ++i) {
            const double ms = static_cast<double>(stamps[2 * i + 1] - stamps[2 * i]) *
                              static_cast<double>(device_->timestampPeriodNs) * 1e-6;
            if (!times_.empty() && times_.back().name == list.names()[i])
                times_.back().ms += ms;  // the levels of pull and push
            else
                times_.push_back({list.names()[i], ms});
        }
    }

    void takeImage(const render::DrawList& draws, bool wantAll, render::Image& image) {
        image.width = draws.frame.width;
        image.height = draws.frame.height;
        const size_t pixels = size_t{image.width} * image.height;
        image.rgba.resize(pixels);
        std::memcpy(image.rgba.data(), buffers_.readback.mapped(), pixels * 4);
        image.depth.resize(wantAll ? pixels : 0);
        image.normal.resize(wantAll ? pixels * 3 : 0);
        image.linear.resize(wantAll ? pixels * 3 : 0);
        const auto* extra =
            reinterpret_cast<const float*>(static_cast<const char*>(buffers_.readback.mapped()) + pixels * 4);
        for (size_t i = 0; wantAll && i < pixels; ++i) {
            image.depth[i] = extra[7 * i];
            std::copy_n(extra + 7 * i + 1, 3, image.normal.begin() + static_cast<std::ptrdiff_t>(3 * i));
            std::copy_n(extra + 7 * i + 4, 3, image.linear.begin() + static_cast<std::ptrdiff_t>(3 * i));
        }
    }

    struct PendingUpload {
        PageStore::Place place;
        std::vector<uint8_t> bytes;
    };

    std::unique_ptr<Device> device_;  // first: everything below is destroyed before it
    std::unique_ptr<Pipelines> pipelines_;
    PageStore pages_;
    std::unordered_map<uint64_t, PageStore::Place> places_;
    std::vector<PendingUpload> pending_;
    FrameBuffers buffers_;
    std::unordered_map<uint64_t, MeshChunk> meshChunks_;
    MeshFrame meshFrame_;
    VkCommandPool commandPool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkFence fence_ = VK_NULL_HANDLE;
    VkQueryPool queries_ = VK_NULL_HANDLE;
    std::vector<Level> levels_;
    std::vector<render::PassTime> times_;
    std::string omitBarriersBefore_;
    bool descriptorsChanged_ = true;
};

}  // namespace

Result<std::unique_ptr<render::Backend>> makeGpuBackend(const GpuSettings& settings) {
    return GpuBackend::create(settings);
}

std::vector<std::string> validationMessages(const render::Backend& backend) {
    const auto* gpu = dynamic_cast<const GpuBackend*>(&backend);
    return gpu ? gpu->messages() : std::vector<std::string>{};
}

}  // namespace stipple::gpu
