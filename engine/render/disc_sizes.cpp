#include "engine/render/disc_sizes.h"

#include <algorithm>
#include <cmath>

#include "lod/primitives/patch_samples.h"
#include "lod/primitives/record_spacing.h"
#include "lod/store/overview_levels.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::render {
namespace {

/// Has the store the spacing of this payload, or is none asked for?
bool isSpacingTold(const lod::Hierarchy& h, uint32_t chunk) {
    const bool isTile = chunk >= h.nodes.size() && chunk < h.nodes.size() + h.tiles.size();
    return h.isStochastic || isTile || h.payload(chunk).spacingCode != 0;
}

/// Both ends of what the records have along each axis.
struct LatticeBox {
    std::array<uint16_t, 3> low, high;
};
LatticeBox boxOf(std::span<const shared::PointRecord> records) {
    uint32_t lowX = 65535, lowY = 65535, lowZ = 65535, highX = 0, highY = 0, highZ = 0;
    for (const shared::PointRecord& r : records) {
        lowX = std::min(lowX, shared::recordX(r));
        lowY = std::min(lowY, shared::recordY(r));
        lowZ = std::min(lowZ, shared::recordZ(r));
        highX = std::max(highX, shared::recordX(r));
        highY = std::max(highY, shared::recordY(r));
        highZ = std::max(highZ, shared::recordZ(r));
    }
    const auto three = [](uint32_t x, uint32_t y, uint32_t z) {
        return std::array{static_cast<uint16_t>(x), static_cast<uint16_t>(y), static_cast<uint16_t>(z)};
    };
    return {three(lowX, lowY, lowZ), three(highX, highY, highZ)};
}

}  // namespace

DiscSizes::Size DiscSizes::measured(std::span<const shared::PointRecord> records) {
    uint32_t code = 0;
    uint64_t sum = 0;
    for (const shared::PointRecord& r : records) {
        code = std::max(code, shared::recordRadiusCode(r) + 1);
        sum += shared::recordRadiusCode(r);
    }
    const uint64_t usual = records.empty() ? 0 : (2 * sum + records.size()) / (2 * records.size());
    const auto points = static_cast<float>(records.size());
    const bool isDense = code > 0 && shared::radiusFraction(code - 1) * std::sqrt(points) > kMostSpacings;
    const LatticeBox box = boxOf(records);
    return {static_cast<uint8_t>(std::min(code, 255u)), static_cast<uint8_t>(usual), isDense, 0, box.low, box.high};
}

void DiscSizes::measureOverview(uint32_t source, std::span<const shared::PointRecord> records) {
    if (overviews_.size() <= source) overviews_.resize(source + 1);
    std::vector<OfLevel>& levels = overviews_[source];
    levels.clear();
    lod::forEachOverviewLevel(records, [&](size_t begin, size_t end) {
        levels.push_back({static_cast<uint32_t>(end), measured(records.subspan(begin, end - begin))});
    });
}

Result<void> DiscSizes::upload(streaming::ChunkKey key, lod::Chunk chunk) {
    if (life_.expired()) return fail(ErrorKind::device, "what draws the scene is gone");
    auto records = lod::withoutEmpty(chunk.records);
    const lod::Hierarchy* const h = key.source < hierarchies_.size() ? hierarchies_[key.source] : nullptr;
    if (h != nullptr && key.chunk == 0 && !records.empty()) {
        const auto overview = std::min<size_t>(h->overviewOf(h->nodes[0]), records.size());
        measureOverview(key.source, records.first(overview));
        records = records.subspan(overview);
    }
    if (sizes_.size() <= key.source) sizes_.resize(key.source + 1);
    auto& of = sizes_[key.source];
    if (of.size() <= key.chunk) of.resize(key.chunk + 1);
    of[key.chunk] = measured(records);
    if (h == nullptr || !isSpacingTold(*h, key.chunk)) of[key.chunk].spacing = lod::recordSpacing(records);
    return backend_.upload(keyOfBackend(key), std::move(chunk));
}

void DiscSizes::evict(streaming::ChunkKey key) {
    if (!life_.expired()) backend_.evict(keyOfBackend(key));
}

streaming::ChunkKey DiscSizes::keyOfBackend(streaming::ChunkKey key) const {
    key.source += first_;
    return key;
}

DiscSizes::Size DiscSizes::sizeOf(streaming::ChunkKey key) const {
    key.source -= first_;
    return key.source >= sizes_.size() || key.chunk >= sizes_[key.source].size() ? Size{}
                                                                                 : sizes_[key.source][key.chunk];
}

float DiscSizes::spacingOf(streaming::ChunkKey key) const { return sizeOf(key).spacing; }

DiscSizes::Share DiscSizes::shareOf(streaming::ChunkKey key, uint32_t end) const {
    const uint32_t source = key.source - first_;
    Size size = sizeOf(key);
    if (key.chunk == 0 && source < overviews_.size()) {
        const auto& levels = overviews_[source];
        const auto of = std::find_if(levels.begin(), levels.end(), [&](const OfLevel& l) { return end <= l.end; });
        if (of != levels.end()) size = of->size;
    }
    return {size.code == 0     ? 0
            : size.code == 255 ? 1
                               : shared::radiusFraction(size.code - 1u),
            size.isDense, size.code == 0 ? 0 : shared::radiusFraction(size.usual), size.low, size.high};
}

void markDiscSizes(const DiscSizes& sizes, DrawList& draws) {
    const shared::FrameConstants& f = draws.frame;
    const double perFocal = double{shared::wideRadius(f.width, f.height)} / double{f.focal};
    draws.hasWideDiscs = draws.hasSmoothDiscs = false;
    draws.pointBounds.clear();
    // Colours that stand for a node's level or error are not mixed with those of others.
    const bool maySmooth = f.debugView != shared::kDebugLevel && f.debugView != shared::kDebugError;
    DrawBatch& points = draws.of(lod::Kind::points);
    for (size_t i = 0; i < points.nodes.size(); ++i) {
        shared::DrawNode& d = points.nodes[i];
        if (d.spacing < 0) d.spacing *= -sizes.spacingOf(points.keys[i]);
        const auto least = [](float step) { return 65536 * std::min(0.0, double{step}); };
        const double nearest = double{d.base.z} + least(d.axisX.z) + least(d.axisY.z) + least(d.axisZ.z);
        const DiscSizes::Share share = sizes.shareOf(points.keys[i], d.count);
        draws.pointBounds.push_back({share.low, share.high, d.edge * share.ofEdge});
        // Leaves and the like, which are no surface, have no spacing.
        const double usual = double{d.edge} * double{f.supportScale * share.usual} * double{f.focal};
        const double middle = double{d.base.z} + 32768 * (double{d.axisX.z} + double{d.axisY.z} + double{d.axisZ.z});
        if (maySmooth && d.spacing > 0 && usual > kSmoothPixels * (f.orthographic != 0 ? 1 : middle)) {
            d.octantMask |= shared::kNodeSmooth;
            draws.hasSmoothDiscs = true;
        }
        const double radius = 1.01 * double{d.edge} * double{f.supportScale * share.ofEdge};  // (fp32)
        if (share.isDense) {
            // Those around the eye (perspective), and what no texel can hold (orthographic).
            const bool isWide = f.orthographic != 0 ? radius * double{f.focal} > kMostTexelPixels : nearest < 0;
            if (!isWide) continue;
        } else if (!(radius > perFocal * (f.orthographic != 0 ? 1 : nearest))) {
            continue;
        }
        d.octantMask |= shared::kNodeWide;
        draws.hasWideDiscs = true;
    }
}

}  // namespace stipple::render
