// Points into the visibility buffer: one pixel each, wide discs by rays.
#include <array>
#include <atomic>

#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {
namespace {

/// Does the cell of a node lie within the picture, so that none of its splats is beside it?
bool isWithin(const shared::FrameConstants& f, const shared::DrawNode& node) {
    for (uint32_t k = 0; k < 8; ++k) {
        const auto along = [&](uint32_t bit) { return (k & bit) != 0 ? 65536.0f : 0.0f; };
        const float x = node.base.x + node.axisX.x * along(1) + node.axisY.x * along(2) + node.axisZ.x * along(4),
                    y = node.base.y + node.axisX.y * along(1) + node.axisY.y * along(2) + node.axisZ.y * along(4),
                    z = node.base.z + node.axisX.z * along(1) + node.axisY.z * along(2) + node.axisZ.z * along(4);
        const float w = shared::lensDepth(shared::frameLens(f), z);
        const float px = x * f.focal / w + f.centre.x, py = y * f.focal / w + f.centre.y;
        if (!(z > f.nearPlane && px >= 0 && py >= 0 && px < static_cast<float>(f.width) &&
              py < static_cast<float>(f.height)))
            return false;
    }
    return true;
}

using WideDiscs = CompletionQueue<std::vector<shared::WideDisc>>;

/// `besideToo`: of each node.
void projectBlocks(Frame& frame, std::span<const uint32_t> blocks, const std::vector<uint8_t>& besideToo,
                   WideDiscs& found) {
    frame.executor.parallelFor(blocks.size(), 32, [&](size_t begin, size_t end) {
        alignas(64) std::array<uint32_t, shared::kRecordsPerBlock> pixel, depth;
        std::vector<shared::WideDisc> mine;
        // (At hand: after each atomic store they would be read again.)
        uint64_t* const keys = frame.visibility.data();
        uint8_t* const runs = frame.runs.data();
        for (size_t k = begin; k < end; ++k) {
            const uint32_t b = blocks[k];
            if (frame.isSmoothing && (frame.blocks[b].node->octantMask & shared::kNodeSmooth) == 0) continue;
            const uint32_t count =
                std::min(shared::kRecordsPerBlock, frame.blocks[b].node->count - frame.draws->points().blocks[b].first);
            frame.k.projectBlock(frame.constants, *frame.blocks[b].node, frame.blocks[b].records, count,
                                 besideToo[frame.draws->points().blocks[b].node] != 0, pixel.data(), depth.data());
            constexpr uint32_t kAhead = 48;  // the pixels are scattered over 16 MB: ask for them in time
            for (uint32_t i = 0; i < count; ++i) {
                if (i + kAhead < count && pixel[i + kAhead] < kWidePixel)
                    __builtin_prefetch(&keys[pixel[i + kAhead]], 1);
                if (pixel[i] >= kWidePixel) {
                    if (pixel[i] == ~0u) continue;
                    const uint32_t id = b * shared::kRecordsPerBlock + i;
                    const shared::WideDisc d =
                        shared::wideDisc(*frame.blocks[b].node, frame.blocks[b].records[i],
                                         frame.constants.supportScale, id, shared::frameLens(frame.constants));
                    if (shared::reachesPicture(d, frame.constants) > 0.5f) mine.push_back(d);
                    continue;
                }
                const uint64_t key = shared::visibilityKey(depth[i], shared::drawId(b, i));
                const std::atomic_ref<uint8_t> run(runs[pixel[i] >> Visibility::kRunBits]);
                if (run.load(std::memory_order_relaxed) == 0) run.store(1, std::memory_order_relaxed);
                const std::atomic_ref<uint64_t> entry(keys[pixel[i]]);
                uint64_t old = entry.load(std::memory_order_relaxed);
                while (key < old && !entry.compare_exchange_weak(old, key, std::memory_order_relaxed)) {
                }
            }
        }
        if (!mine.empty()) found.push(std::move(mine));
    });
}

void project(Frame& frame) {
    const std::vector<shared::DrawNode>& nodes = frame.draws->points().nodes;
    std::vector<uint8_t> besideToo(nodes.size());
    for (size_t n = 0; n < nodes.size(); ++n)
        besideToo[n] = frame.hasPyramid &&
                       ((nodes[n].octantMask & shared::kNodeWide) != 0 || !isWithin(frame.constants, nodes[n]));
    WideDiscs found;
    projectBlocks(frame, frame.hidden.begin(frame, frame.mayHideNodes && !frame.isSmoothing), besideToo, found);
    projectBlocks(frame, frame.hidden.rest(frame, false), besideToo, found);
    frame.discs.clear();
    for (const auto& some : found.takeAll()) frame.discs.insert(frame.discs.end(), some.begin(), some.end());
    // Sums are rounded: their order must not be that of the threads.
    std::sort(frame.discs.begin(), frame.discs.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
    frame.discBoxes.clear();
    for (const shared::WideDisc& d : frame.discs) frame.discBoxes.push_back(shared::discBox(d, frame.constants));
}

void fillDiscs(Frame& frame) {
    if (!frame.discs.empty())
        frame.forBands([&](uint32_t first, uint32_t last) {
            frame.k.fillDiscs(frame.constants, frame.discs.data(), frame.discBoxes.data(), frame.discs.size(), first,
                              last, frame.visible());
        });
}

void findBlocks(Frame& frame) {
    const render::DrawBatch& points = frame.draws->points();
    frame.blocks.resize(points.blocks.size());
    for (size_t b = 0; b < frame.blocks.size(); ++b) {
        const shared::DrawBlock& block = points.blocks[b];
        const lod::Chunk& chunk = frame.chunks.at(points.keys[block.node]);
        const shared::DrawNode& node = points.nodes[block.node];
        const bool hasOwn =
            node.materials > 0 && (node.material & shared::kOnlyMaterial) == 0 && !chunk.materials.empty();
        frame.blocks[b] = {chunk.records.data() + block.first, &node,
                           chunk.weights.empty() ? nullptr : chunk.weights.data() + block.first,
                           hasOwn ? chunk.materials.data() + block.first : nullptr};
    }
}

}  // namespace

constinit const CpuKind pointsOnCpu{.prepare = findBlocks};
constinit const CpuPass projectPass{.run = project};
constinit const CpuPass discsPass{.run = fillDiscs};

}  // namespace stipple::cpu
