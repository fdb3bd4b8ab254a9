// Ribbons and tubes into the visibility buffer.
#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {

namespace {

void drawCurves(Frame& frame) {
    CompletionQueue<std::vector<FilledCurve>> found;
    frame.wide.clear();
    frame.executor.parallelFor(frame.curveBlocks.size(), 4, [&](size_t begin, size_t end) {
        std::vector<FilledCurve> mine;
        const WideSink sink{
            &mine, [](void* to, const FilledCurve& s) { static_cast<std::vector<FilledCurve>*>(to)->push_back(s); }};
        for (size_t b = begin; b < end; ++b) {
            const uint32_t left = frame.curveBlocks[b].node->count - frame.draws->curves().blocks[b].first;
            frame.k.drawSegments(frame.constants, frame.curveBlocks[b], std::min(left, shared::kSegmentsPerBlock),
                                 static_cast<uint32_t>(b * shared::kSegmentsPerBlock), sink, frame.visible());
        }
        if (!mine.empty()) found.push(std::move(mine));
    });
    for (const auto& some : found.takeAll()) frame.wide.insert(frame.wide.end(), some.begin(), some.end());
    if (!frame.wide.empty())
        frame.forBands([&](uint32_t first, uint32_t last) {
            frame.k.fillWide(frame.constants, frame.wide.data(), frame.wide.size(), first, last, frame.visible());
        });
}

void findBlocks(Frame& frame) {
    const render::DrawBatch& curves = frame.draws->curves();
    frame.curveBlocks.clear();
    for (const shared::DrawBlock& block : curves.blocks)
        frame.curveBlocks.push_back(
            {frame.chunks.at(curves.keys[block.node]).segments.data() + block.first, &curves.nodes[block.node]});
    frame.hasCurves = !frame.curveBlocks.empty();
}

}  // namespace

constinit const CpuKind curvesOnCpu{.prepare = findBlocks};
constinit const CpuPass curvesPass{.run = drawCurves};

}  // namespace stipple::cpu
