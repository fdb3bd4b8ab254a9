// Elevation patches into the visibility buffer.
#include "engine/cpu/passes/passes.h"
#include "engine/render/patch_planes.h"

namespace stipple::cpu {
namespace {

void findBlocks(Frame& frame) {
    const render::DrawBatch& batch = frame.draws->patches();
    std::vector<lod::PatchPlane> planes;
    std::vector<uint32_t> first;  // of the placed patches, by node
    const auto planesOf = [&](streaming::ChunkKey key) -> const std::vector<lod::PatchPlane>& {
        const lod::Chunk& chunk = frame.chunks.at(key);
        return planes = lod::planesOfPatches(chunk.patchBlocks, chunk.patchPlanes);
    };
    render::placePatches(*frame.draws, planesOf, frame.patches, first);
    frame.patchBlocks.resize(batch.blocks.size());
    for (size_t b = 0; b < batch.blocks.size(); ++b) {
        const auto [node, place] = batch.blocks[b];
        const shared::PatchBlock& block = frame.chunks.at(batch.keys[node]).patchBlocks[place];
        frame.patchBlocks[b] = {&block, &frame.patches[first[node] + block.number], batch.nodes[node].level,
                                batch.nodes[node].errorPixels};
    }
}

void draw(Frame& frame) {
    CompletionQueue<std::vector<LargeTriangle>> found;
    frame.large.clear();
    frame.executor.parallelFor(frame.patchBlocks.size(), 8, [&](size_t begin, size_t end) {
        std::vector<LargeTriangle> mine;
        const LargeSink sink{&mine, [](void* to, const LargeTriangle& t) {
                                 static_cast<std::vector<LargeTriangle>*>(to)->push_back(t);
                             }};
        for (size_t b = begin; b < end; ++b)
            frame.k.rasterPatch(frame.constants, frame.patchBlocks[b], static_cast<uint32_t>(b * shared::kBlockLanes),
                                sink, frame.visible());
        if (!mine.empty()) found.push(std::move(mine));
    });
    for (const auto& some : found.takeAll()) frame.large.insert(frame.large.end(), some.begin(), some.end());
    if (frame.large.empty()) return;
    frame.forBands([&](uint32_t first, uint32_t last) {
        frame.k.rasterLarge(frame.constants, frame.large.data(), frame.large.size(), first, last, frame.visible());
    });
}

}  // namespace

constinit const CpuKind patchesOnCpu{.prepare = findBlocks};
constinit const CpuPass patchesPass{.run = draw};

}  // namespace stipple::cpu
