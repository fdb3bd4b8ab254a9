// Points into the visibility buffer: one pixel each, wide discs by rays.
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

/// Those of a block that are wide discs.
void findWide(const Frame& frame, uint32_t b, uint32_t count, const ProjectedBlock& block,
              std::vector<shared::WideDisc>& to) {
    for (uint32_t i = 0; i < count; ++i) {
        if (block.pixel[i] != kWidePixel) continue;
        const shared::WideDisc d =
            shared::wideDisc(*frame.blocks[b].node, frame.blocks[b].records[i], frame.constants.supportScale,
                             b * shared::kRecordsPerBlock + i, shared::frameLens(frame.constants));
        if (shared::reachesPicture(d, frame.constants) > 0.5f) to.push_back(d);
    }
}

/// The nearest of each pixel stays. Which is in front is as good as random, too: a branch that is guessed wrongly would
/// wait for the pixel. So stores are plain, and the pixels have to be this thread's own (PixelRegions).
void claimPixels(uint64_t firstId, const Claims& claims, const Visibility& to) {
    for (uint32_t k = 0; k < claims.count; ++k) {
        const uint32_t pixel = claims.pixel[k];
        __builtin_prefetch(&to.keys[claims.pixel[k + Claims::kAhead]], 1);
        const uint64_t key = shared::visibilityKey(claims.depth[k], firstId + claims.lane[k]), old = to.keys[pixel];
        to.keys[pixel] = key < old ? key : old;
        const std::atomic_ref<uint8_t> run(to.runs[pixel >> Visibility::kRunBits]);  // of several regions
        if (run.load(std::memory_order_relaxed) == 0) run.store(1, std::memory_order_relaxed);
    }
}

/// The processor looks ahead by itself, but not beyond a page, and a block is as large as one.
void askForRecords(const BlockSource& block, uint32_t count) {
    constexpr size_t kLine = 64;
    const auto* const first = reinterpret_cast<const char*>(block.records);
    for (size_t at = 0; at < count * sizeof(shared::PointRecord); at += kLine) __builtin_prefetch(first + at, 0, 2);
}
uint32_t countOf(const Frame& frame, uint32_t block) {
    return std::min(shared::kRecordsPerBlock,
                    frame.blocks[block].node->count - frame.draws->points().blocks[block].first);
}

/// `besideToo`: of each node.
void projectBlocks(Frame& frame, std::span<const uint32_t> blocks, const std::vector<uint8_t>& besideToo,
                   WideDiscs& found) {
    frame.executor.parallelFor(blocks.size(), 32, [&](size_t begin, size_t end) {
        ProjectedBlock block;
        Claims claims;
        std::vector<shared::WideDisc> mine;
        for (size_t k = begin; k < end; ++k) {
            const uint32_t b = blocks[k];
            const shared::DrawNode& node = *frame.blocks[b].node;
            if (frame.isSmoothing && (node.octantMask & shared::kNodeSmooth) == 0) continue;
            const uint32_t count = countOf(frame, b);
            frame.k.projectBlock(frame.constants, node, frame.blocks[b].records, count,
                                 besideToo[frame.draws->points().blocks[b].node] != 0, block);
            if ((node.octantMask & shared::kNodeWide) != 0) findWide(frame, b, count, block, mine);
            if (k + 1 < end) askForRecords(frame.blocks[blocks[k + 1]], countOf(frame, blocks[k + 1]));
            frame.k.findClaims(block, count, claims);
            if (claims.count == 0) continue;
            const PixelRegions::Held held(frame.regions, block.firstX, block.lastX, block.firstY, block.lastY);
            claimPixels(shared::drawId(b, 0), claims, frame.visible());
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
    const lod::Chunk* chunk = nullptr;  // blocks of a node lie side by side
    for (size_t b = 0; b < frame.blocks.size(); ++b) {
        const shared::DrawBlock& block = points.blocks[b];
        if (b == 0 || block.node != points.blocks[b - 1].node) chunk = &frame.chunks.at(points.keys[block.node]);
        const shared::DrawNode& node = points.nodes[block.node];
        const bool hasOwn =
            node.materials > 0 && (node.material & shared::kOnlyMaterial) == 0 && !chunk->materials.empty();
        frame.blocks[b] = {chunk->records.data() + block.first, &node,
                           chunk->weights.empty() ? nullptr : chunk->weights.data() + block.first,
                           hasOwn ? chunk->materials.data() + block.first : nullptr};
    }
}

}  // namespace

constinit const CpuKind pointsOnCpu{.prepare = findBlocks};
constinit const CpuPass projectPass{.run = project};
constinit const CpuPass discsPass{.run = fillDiscs};

}  // namespace stipple::cpu
