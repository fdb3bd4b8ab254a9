// Ambient occlusion (shaders/shared/occlusion.h) from the surface buffer into its materials.
#include <cmath>

#include "engine/cpu/passes/passes.h"
#include "shaders/shared/occlusion.h"

namespace stipple::cpu {
namespace {

using namespace shared;

AoPlanes planesOf(Frame& frame) {
    const FrameConstants& f = frame.constants;
    AoPlanes p{};
    p.edge = f.aoEdge;
    p.width = (f.width + p.edge - 1) / p.edge;
    p.height = (f.height + p.edge - 1) / p.edge;
    p.pitch = (p.width + 2 * AoPlanes::kBorder + 15) / 16 * 16;
    const size_t entries = size_t{p.pitch} * (p.height + 2 * AoPlanes::kBorder);
    if (frame.aoEntries != entries || frame.aoPitch != p.pitch) {
        for (HugeBuffer<float>* plane : {&frame.aoDepth, &frame.aoOpen, &frame.aoMean}) plane->assign(entries, 0.0f);
        frame.aoNormal.assign(entries, 0u);
        frame.aoEntries = entries;
        frame.aoPitch = p.pitch;
    }
    p.depth = frame.aoDepth.data();
    p.normal = frame.aoNormal.data();
    p.open = frame.aoOpen.data();
    p.mean = frame.aoMean.data();
    for (uint32_t k = 0; k < p.cosine.size(); ++k) {
        p.cosine.at(k) = std::cos(aoAngle(k));
        p.sine.at(k) = std::sin(aoAngle(k));
    }
    return p;
}

/// Rows of the planes, in runs of pixels of one tile.
template <typename Run>
void forRuns(Frame& frame, uint32_t width, uint32_t height, const Run& run) {
    constexpr size_t kRows = 8;
    frame.executor.parallelFor(height, kRows, [&](size_t begin, size_t end) {
        for (size_t y = begin; y < end; ++y)
            for (uint32_t x = 0; x < width; x += kTile) run(x, static_cast<uint32_t>(y), std::min(kTile, width - x));
    });
}

/// Pixels of a row apart, by where they lie between those that were asked.
struct SplitRow {
    alignas(64) std::array<float, kTile> depth;
    alignas(64) std::array<uint32_t, kTile> normal;
    alignas(64) std::array<float, kTile> open;
};

void spread(Frame& frame, const AoPlanes& p, uint32_t x0, uint32_t y, uint32_t n) {
    SurfaceWords* const row = frame.surfaceWords.data() + size_t{y} * frame.constants.width + x0;
    bool isAny = false;
    for (size_t i = 0; i < n; ++i) isAny = isAny || row[i].depth > 0;
    if (!isAny) return;
    thread_local SplitRow split;
    for (uint32_t k = 0; k < p.edge; ++k) {
        const uint32_t count = (n - k + p.edge - 1) / p.edge;
        const SurfaceWords* from = row + k;
        for (size_t i = 0; i < count; ++i, from += p.edge) {
            split.depth.at(i) = from->depth;
            split.normal.at(i) = from->normal;
        }
        frame.k.aoSpreadRow(frame.constants, p, split.depth.data(), split.normal.data(), x0 + k, y, count,
                            split.open.data());
        SurfaceWords* to = row + k;
        for (size_t i = 0; i < count; ++i, to += p.edge) to->material = aoMaterial(to->material, split.open.at(i));
    }
}

void run(Frame& frame) {
    const FrameConstants& f = frame.constants;
    const Kernels& k = frame.k;
    const AoPlanes p = planesOf(frame);
    SurfaceWords* const words = frame.surfaceWords.data();
    forRuns(frame, p.width, p.height, [&](uint32_t x0, uint32_t y, uint32_t n) {
        const SurfaceWords* from = words + size_t{y} * p.edge * f.width + size_t{x0} * p.edge;
        for (size_t i = 0; i < n; ++i, from += p.edge) {
            p.depth[p.at(x0, y) + i] = std::max(from->depth, 0.0f);
            p.normal[p.at(x0, y) + i] = from->normal;
        }
    });
    forRuns(frame, p.width, p.height, [&](uint32_t x0, uint32_t y, uint32_t n) { k.occludeRow(f, p, x0, y, n); });
    for (const bool isDown : {false, true})
        forRuns(frame, p.width, p.height,
                [&](uint32_t x0, uint32_t y, uint32_t n) { k.aoMeanRow(f, p, isDown, x0, y, n); });
    forRuns(frame, f.width, f.height, [&](uint32_t x0, uint32_t y, uint32_t n) { spread(frame, p, x0, y, n); });
}

}  // namespace

constinit const CpuPass occlusionPass{.run = run};

}  // namespace stipple::cpu
