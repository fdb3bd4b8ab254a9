// Elevation patches into the visibility buffer.
#include "engine/cpu/passes/passes.h"
#include "engine/render/patch_planes.h"
#include "shaders/shared/patch_map.h"

namespace stipple::cpu {
namespace {

void findBlocks(Frame& frame) {
    const render::DrawBatch& batch = frame.draws->patches();
    std::vector<lod::PatchPlane> planes;
    std::vector<uint32_t> first;  // of the placed patches, by node
    const auto planesOf = [&](streaming::ChunkKey key) -> const std::vector<lod::PatchPlane>& {
        const lod::Chunk& chunk = frame.chunks.at(key);
        lod::planesOfPatches(chunk.patchBlocks, chunk.patchPlanes, planes);
        return planes;
    };
    render::placePatches(*frame.draws, planesOf, frame.patches, first);
    frame.patchBlocks.resize(batch.blocks.size());
    frame.hasLitPatches = false;
    for (size_t b = 0; b < batch.blocks.size(); ++b) {
        const auto [node, place] = batch.blocks[b];
        const lod::Chunk& chunk = frame.chunks.at(batch.keys[node]);
        const shared::PatchBlock& block = chunk.patchBlocks[place];
        const shared::DrawNode& of = batch.nodes[node];
        const bool isOnly = (of.material & shared::kOnlyMaterial) != 0, hasOwn = of.materials != 0 && !isOnly;
        const bool hasLight = (block.map & shared::kMapLight) != 0 && !isOnly;
        frame.hasLitPatches = frame.hasLitPatches || hasLight;
        frame.patchBlocks[b] = {
            &block,
            &frame.patches[first[node] + block.number],
            of.level,
            of.errorPixels,
            hasLight,
            of.material & ~shared::kOnlyMaterial,
            hasOwn ? chunk.materials.data() + size_t{place} * shared::kPatchSamples : nullptr,
            block.map != 0 ? chunk.patchMaps.data() + (block.map >> shared::kMapFirstShift) : nullptr};
    }
}

/// Calls drawBlock(block number, sink) for all blocks; what the sinks are given, in any order.
template <typename Large, typename Sink, typename DrawBlock>
std::vector<Large> drawBlocks(Frame& frame, const DrawBlock& drawBlock) {
    CompletionQueue<std::vector<Large>> found;
    frame.executor.parallelFor(frame.patchBlocks.size(), 8, [&](size_t begin, size_t end) {
        std::vector<Large> mine;
        const Sink sink{&mine, [](void* to, const Large& t) { static_cast<std::vector<Large>*>(to)->push_back(t); }};
        for (size_t b = begin; b < end; ++b) drawBlock(b, sink);
        if (!mine.empty()) found.push(std::move(mine));
    });
    std::vector<Large> all;
    for (const auto& some : found.takeAll()) all.insert(all.end(), some.begin(), some.end());
    return all;
}

void drawStrips(Frame& frame) {
    frame.large = drawBlocks<LargeTriangle, LargeSink>(frame, [&](size_t b, const LargeSink& sink) {
        frame.k.rasterPatch(frame.constants, frame.patchBlocks[b], static_cast<uint32_t>(b * shared::kBlockLanes), sink,
                            frame.visible());
    });
    if (frame.large.empty()) return;
    frame.forBands([&](uint32_t first, uint32_t last) {
        frame.k.rasterLarge(frame.constants, frame.large.data(), frame.large.size(), first, last, frame.visible());
    });
}

void drawSplats(Frame& frame) {
    const auto large = drawBlocks<LargeSplat, LargeSplatSink>(frame, [&](size_t b, const LargeSplatSink& sink) {
        frame.k.splatPatch(frame.constants, frame.patchBlocks[b], static_cast<uint32_t>(b * shared::kBlockLanes), sink,
                           frame.visible());
    });
    if (large.empty()) return;
    frame.forBands([&](uint32_t first, uint32_t last) {
        frame.k.splatLarge(frame.constants, large.data(), large.size(), first, last, frame.visible());
    });
}

void draw(Frame& frame) {
    if (frame.constants.patchAs == shared::kPatchStrips)
        drawStrips(frame);
    else
        drawSplats(frame);
}

}  // namespace

constinit const CpuKind patchesOnCpu{.prepare = findBlocks};
constinit const CpuPass patchesPass{.run = draw};

}  // namespace stipple::cpu
