// Ambient occlusion (shaders/shared/occlusion.h) from the surface buffer into its materials.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/cpu/passes/passes.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/occlusion.h"

namespace stipple::cpu {
namespace {

using namespace shared;

AoPlanes planesOf(Frame& frame) {
    const FrameConstants& f = frame.constants;
    const auto& c = *frame.draws->tableAt<OcclusionConstants>(kOcclusionBinding);
    AoPlanes p{};
    p.edge = c.edge;
    p.radius = c.radius;
    p.width = (f.width + p.edge - 1) / p.edge;
    p.height = (f.height + p.edge - 1) / p.edge;
    p.pitch = (p.width + 2 * AoPlanes::kBorder + 15) / 16 * 16;
    const size_t entries = size_t{p.pitch} * (p.height + 2 * AoPlanes::kBorder);
    p.depth = frame.room<float>(0, entries);
    p.normal = frame.room<uint32_t>(1, entries);
    p.open = frame.room<float>(2, entries);
    p.mean = frame.room<float>(3, entries);
    for (uint32_t k = 0; k < p.cosine.size(); ++k) {
        p.cosine.at(k) = std::cos(aoAngle(k));
        p.sine.at(k) = std::sin(aoAngle(k));
    }
    return p;
}

/// Every pixel that is asked, from the surface buffer; about them nothing.
void gather(Frame& frame, const AoPlanes& p) {
    KeptSurface& kept = frame.kept;
    const size_t last = size_t{p.height} + 2 * AoPlanes::kBorder;
    frame.executor.parallelFor(last, 16, [&](size_t begin, size_t end) {
        for (size_t line = begin; line < end; ++line) {
            float* const depth = p.depth + line * p.pitch;
            const bool isBorder = line < AoPlanes::kBorder || line >= p.height + AoPlanes::kBorder;
            std::fill_n(depth, isBorder ? p.pitch : AoPlanes::kBorder, 0.0f);
            if (isBorder) continue;
            std::fill(depth + AoPlanes::kBorder + p.width, depth + p.pitch, 0.0f);
            uint32_t* const normal = p.normal + line * p.pitch + AoPlanes::kBorder;
            size_t from = (line - AoPlanes::kBorder) * p.edge * frame.constants.width;
            for (uint32_t x = 0; x < p.width; ++x, from += p.edge) {
                depth[AoPlanes::kBorder + x] = std::max(kept.depth[from], 0.0f);
                normal[x] = kept.normal[from];
            }
        }
    });
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
    const size_t first = size_t{y} * frame.constants.width + x0;
    const float* const depth = frame.kept.depth.data() + first;
    const uint32_t* const normal = frame.kept.normal.data() + first;
    uint32_t* const material = frame.kept.material.data() + first;
    if (std::none_of(depth, depth + n, [](float z) { return z > 0; })) return;
    thread_local SplitRow split;
    for (uint32_t k = 0; k < p.edge; ++k) {
        const uint32_t count = (n - k + p.edge - 1) / p.edge;
        for (size_t i = 0, from = k; i < count; ++i, from += p.edge) {
            split.depth.at(i) = depth[from];
            split.normal.at(i) = normal[from];
        }
        frame.k.aoSpreadRow(frame.constants, p, split.depth.data(), split.normal.data(), x0 + k, y, count,
                            split.open.data());
        for (size_t i = 0, to = k; i < count; ++i, to += p.edge)
            if (depth[to] > 0) material[to] = aoMaterial(material[to], split.open.at(i));
    }
}

void run(Frame& frame) {
    const FrameConstants& f = frame.constants;
    const Kernels& k = frame.k;
    const AoPlanes p = planesOf(frame);
    gather(frame, p);
    forRuns(frame, p.width, p.height, [&](uint32_t x0, uint32_t y, uint32_t n) { k.occludeRow(f, p, x0, y, n); });
    for (const bool isDown : {false, true})
        forRuns(frame, p.width, p.height,
                [&](uint32_t x0, uint32_t y, uint32_t n) { k.aoMeanRow(f, p, isDown, x0, y, n); });
    forRuns(frame, f.width, f.height, [&](uint32_t x0, uint32_t y, uint32_t n) { spread(frame, p, x0, y, n); });
}

}  // namespace

constinit const CpuPass occlusionPass{.run = run};

}  // namespace stipple::cpu
