#include "engine/gpu/gpu_backend.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/gpu/frame_slot.h"
#include "engine/gpu/needs.h"
#include "engine/gpu/pages.h"
#include "engine/gpu/staging.h"
#include "engine/render/chunk_table.h"

namespace stipple::gpu {
namespace {

/// What the host keeps of a chunk that is in the device's memory.
struct Resident {
    PageStore::Place place;
    MeshChunk mesh;
    std::vector<lod::PatchPlane> planes;  ///< of each patch
};

class GpuBackend final : public render::Backend {
  public:
    static Result<std::unique_ptr<render::Backend>> create(std::shared_ptr<Device> device,
                                                           const std::string& cacheFolder) {
        STIPPLE_TRY(checkDevice(device->physical, device->deviceName));  // (a window asks less of one)
        std::unique_ptr<GpuBackend> b(new GpuBackend(std::move(device)));
        STIPPLE_ASSIGN(b->pipelines_, Pipelines::create(*b->device_, cacheFolder));
        STIPPLE_ASSIGN(b->copies_, Copies::create(*b->device_));
        STIPPLE_TRY(b->addSlot());
        return b;
    }
    ~GpuBackend() override { vkDeviceWaitIdle(device_->device); }

    std::string name() const override { return "gpu"; }
    std::string device() const override { return device_->deviceName; }
    const std::vector<render::PassTime>& passTimes() const override { return times_; }
    std::vector<std::string> messages() const { return device_->messages(); }

    render::BackendResources resources() const override {
        using namespace shared;
        render::BackendResources r;
        const auto compiled = [&](std::initializer_list<const char*> names) {
            return static_cast<uint64_t>(
                std::count_if(names.begin(), names.end(), [&](const char* n) { return pipelines_->isCompiled(n); }));
        };
        r.curvePipelines = compiled({"curves", "curves_wide", "curve_texels"});
        r.meshPipelines = compiled({"rasterise", "rasterise_large", "triangle_texels"});
        r.lightPipelines = compiled({"light_output"});
        for (const auto& slot : slots_) {
            const FrameBuffers& b = slot->buffers();
            r.curveBytes += b.bytesOf({kWideBinding});
            for (const render::Effect* effect : render::effects()) r.effectBytes += b.bytesOf(*effect);
            r.meshBytes += b.bytesOf({kMeshesBinding, kClustersBinding, kMaterialsBinding, kTexturesBinding,
                                      kTilesBinding, kTriangleWordsBinding, kLargeBinding});
        }
        for (const render::Effect* effect : render::effects()) {
            render::EffectResources& held = r.effects.emplace_back();
            held.pipelines = pipelines_->compiledOf(*effect);
            for (const auto& slot : slots_) held.bytes += slot->buffers().bytesOf(*effect);
        }
        r.textureTiles = slots_.front()->buffers().residentTiles();
        return r;
    }

    Result<void> upload(streaming::ChunkKey key, lod::Chunk chunk) override {
        if (pages_.hasReleased()) pages_.reclaim(lastDone());
        STIPPLE_ASSIGN(const PageStore::Place place, allocate(chunk.sizeBytes()));
        if (const auto added = uploads_.add(chunk, pages_.buffer(place), place.offset); !added) {
            pages_.free(place);
            return added;
        }
        Resident& resident = residents_.add(key);
        resident.place = place;
        const VkDeviceAddress address = pages_.address(place);
        resident.mesh = {address, address + chunk.vertices.size() * sizeof(shared::MeshVertex),
                         std::move(chunk.clusters)};
        lod::planesOfPatches(chunk.patchBlocks, chunk.patchPlanes, resident.planes);
        return {};
    }
    Result<DevicePlace> reserve(streaming::ChunkKey key, uint64_t bytes) {
        STIPPLE_ASSIGN(const PageStore::Place place, allocate(bytes));
        residents_.add(key).place = place;
        return DevicePlace{device_.get(), pages_.address(place)};
    }
    void evict(streaming::ChunkKey key) override {
        residents_.drop(key, [&](const Resident& resident) {
            if (uploads_.drop(pages_.buffer(resident.place), resident.place.offset))
                pages_.free(resident.place);  // no frame has seen it
            else
                pages_.release(resident.place, submitted_);
        });
    }

    Result<render::Ticket> submit(const render::RenderRequest& request) override {
        STIPPLE_ASSIGN(FrameSlot* const slot, freeSlot());
        if (!request.isOfCasters) pipelines_->begin(request.draws->effects);
        const Residents residents{
            [&](streaming::ChunkKey key) { return pages_.address(residents_.at(key).place); },
            [&](streaming::ChunkKey key) -> const MeshChunk& { return residents_.at(key).mesh; },
            [&](streaming::ChunkKey key) -> const std::vector<lod::PatchPlane>& { return residents_.at(key).planes; },
            [&](uint32_t source, uint32_t chunk) -> VkDeviceAddress {
                const Resident* const found = residents_.find({source, chunk});
                return found == nullptr ? 0 : pages_.address(found->place);
            }};
        STIPPLE_TRY(slot->submit(request, residents, uploads_, submitted_ + 1));
        return render::Ticket{++submitted_};
    }
    bool isDone(render::Ticket ticket) const override {
        const FrameSlot* const slot = slotOf(ticket);
        return slot == nullptr || slot->isDone();
    }
    Result<void> read(render::Ticket ticket, render::Image& image) override {
        FrameSlot* const slot = slotOf(ticket);
        if (slot == nullptr || !slot->hasPicture() || slot->staysOnDevice()) return render::noSuchPicture(ticket);
        return slot->read(image, times_);
    }
    Result<void> finish(render::Ticket ticket) override {
        FrameSlot* const slot = slotOf(ticket);
        return slot == nullptr ? Result<void>() : slot->finish(times_);
    }
    std::optional<DeviceCounts> counts(render::Ticket ticket, uint32_t binding) const {
        const FrameSlot* const slot = slotOf(ticket);
        if (slot == nullptr || !slot->hasPicture() || !slot->staysOnDevice()) return {};
        return DeviceCounts{device_.get(), slot->buffers().at(binding).handle()};
    }
    std::optional<DevicePicture> picture(render::Ticket ticket) const {
        const FrameSlot* const slot = slotOf(ticket);
        if (slot == nullptr || !slot->hasPicture() || !slot->staysOnDevice()) return {};
        const Level& size = slot->buffers().levels()[0];
        return DevicePicture{device_.get(), slot->buffers().at(shared::kImageBinding).handle(), size.width,
                             size.height};
    }

  private:
    explicit GpuBackend(std::shared_ptr<Device> device)
        : device_(std::move(device)), pages_(*device_), uploads_(*device_) {}

    /// Where there is no more memory, that of chunks which are gone, once no frame reads them any more.
    Result<PageStore::Place> allocate(uint64_t bytes) {
        auto place = pages_.allocate(bytes);
        if (place || !pages_.hasReleased()) return place;
        for (const auto& slot : slots_) STIPPLE_TRY(slot->wait());
        pages_.reclaim(submitted_);
        return pages_.allocate(bytes);
    }
    /// The last frame of those that are done with all before them.
    uint64_t lastDone() const {
        uint64_t last = submitted_;
        for (const auto& slot : slots_)
            if (!slot->isDone()) last = std::min(last, slot->number() - 1);
        return last;
    }
    Result<FrameSlot*> addSlot() {
        STIPPLE_ASSIGN(auto slot, FrameSlot::create(*device_, *pipelines_, *copies_));
        slots_.push_back(std::move(slot));
        return slots_.back().get();
    }
    /// One whose picture was read; else another one; else the oldest, once it is drawn, whose picture is given up.
    Result<FrameSlot*> freeSlot() {
        for (const auto& slot : slots_)
            if (!slot->isInFlight() && !slot->hasPicture()) return slot.get();
        if (slots_.size() < kMostInFlight) return addSlot();
        const auto oldest = std::min_element(slots_.begin(), slots_.end(),
                                             [](const auto& a, const auto& b) { return a->number() < b->number(); });
        STIPPLE_TRY((*oldest)->finish(times_));
        return oldest->get();
    }
    FrameSlot* slotOf(render::Ticket ticket) const {
        for (const auto& slot : slots_)
            if (slot->number() == ticket.number && ticket.number != 0) return slot.get();
        return nullptr;
    }

    std::shared_ptr<Device> device_;  // first: everything below is destroyed before it
    std::unique_ptr<Pipelines> pipelines_;
    PageStore pages_;
    render::ChunkTable<Resident> residents_;
    Staging uploads_;  ///< since the last frame
    std::unique_ptr<Copies> copies_;
    std::vector<std::unique_ptr<FrameSlot>> slots_;
    std::vector<render::PassTime> times_;
    uint64_t submitted_ = 0;
};

}  // namespace

Result<std::unique_ptr<render::Backend>> makeGpuBackend(const GpuSettings& settings) {
    STIPPLE_ASSIGN(std::shared_ptr<Device> device, Device::create({settings.deviceName, settings.validation, {}, {}}));
    return GpuBackend::create(std::move(device), settings.cacheFolder);
}

Result<std::unique_ptr<render::Backend>> makeGpuBackendOn(std::shared_ptr<Device> device,
                                                          const std::string& cacheFolder) {
    return GpuBackend::create(std::move(device), cacheFolder);
}

std::optional<DevicePicture> pictureOf(const render::Backend& backend, render::Ticket ticket) {
    const auto* gpu = dynamic_cast<const GpuBackend*>(&backend);
    return gpu ? gpu->picture(ticket) : std::nullopt;
}

std::optional<DeviceCounts> secondGroupsOf(const render::Backend& backend, render::Ticket ticket) {
    const auto* gpu = dynamic_cast<const GpuBackend*>(&backend);
    return gpu ? gpu->counts(ticket, shared::kSecondGroupsBinding) : std::nullopt;
}

std::optional<DeviceCounts> levelGroupsOf(const render::Backend& backend, render::Ticket ticket) {
    const auto* gpu = dynamic_cast<const GpuBackend*>(&backend);
    return gpu ? gpu->counts(ticket, shared::kStatsBinding) : std::nullopt;
}

Result<DevicePlace> reserve(render::Backend& backend, streaming::ChunkKey key, uint64_t bytes) {
    auto* const gpu = dynamic_cast<GpuBackend*>(&backend);
    if (gpu == nullptr) return fail(ErrorKind::device, "has no memory of its own for chunks", backend.name());
    return gpu->reserve(key, bytes);
}

std::vector<std::string> validationMessages(const render::Backend& backend) {
    const auto* gpu = dynamic_cast<const GpuBackend*>(&backend);
    return gpu ? gpu->messages() : std::vector<std::string>{};
}

}  // namespace stipple::gpu
