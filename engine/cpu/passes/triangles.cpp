// Triangles into the visibility buffer.
#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {

namespace {

void rasterise(Frame& frame) {
    CompletionQueue<std::vector<LargeTriangle>> found;
    frame.meshBlocks.clear();
    frame.textureSets.clear();
    for (const render::MeshTextures& t : frame.draws->meshTextures) {
        if (t.tiles > 0) {  // tiles that never came are null
            if (frame.chunks.tiles.size() <= t.source) frame.chunks.tiles.resize(t.source + 1);
            if (frame.chunks.tiles[t.source].size() < t.firstChunk + t.tiles)
                frame.chunks.tiles[t.source].resize(t.firstChunk + t.tiles);
        }
        frame.textureSets.push_back(
            {t.infos.data(), t.tiles > 0 ? frame.chunks.tiles[t.source].data() + t.firstChunk : nullptr});
    }
    for (size_t r = 0; r < frame.draws->meshDraws.size(); ++r) {
        const render::MeshDraw& draw = frame.draws->meshDraws[r];
        const lod::Chunk& chunk = frame.chunks.at(frame.draws->triangles().keys[r]);
        for (uint32_t c = 0; c < draw.clusters; ++c) {
            const shared::MeshCluster& cluster = chunk.clusters[draw.firstCluster + c];
            frame.meshBlocks.push_back({chunk.vertices.data() + cluster.firstVertex,
                                        chunk.triangles.data() + cluster.firstTriangle, &frame.draws->meshes[draw.mesh],
                                        &frame.textureSets[draw.mesh], cluster.counts, draw.level, draw.errorPixels});
        }
    }
    frame.large.clear();
    frame.executor.parallelFor(frame.meshBlocks.size(), 8, [&](size_t begin, size_t end) {
        std::vector<LargeTriangle> mine;
        const LargeSink sink{&mine, [](void* to, const LargeTriangle& t) {
                                 static_cast<std::vector<LargeTriangle>*>(to)->push_back(t);
                             }};
        for (size_t b = begin; b < end; ++b)
            frame.k.rasterCluster(frame.constants, frame.draws->materials.data(), frame.meshBlocks[b],
                                  static_cast<uint32_t>(b * shared::kClusterTriangles), sink, frame.visible());
        if (!mine.empty()) found.push(std::move(mine));
    });
    for (const auto& some : found.takeAll()) frame.large.insert(frame.large.end(), some.begin(), some.end());
    if (frame.large.empty()) return;
    frame.forBands([&](uint32_t first, uint32_t last) {
        frame.k.rasterLarge(frame.constants, frame.large.data(), frame.large.size(), first, last, frame.visible());
    });
}

}  // namespace

constinit const CpuKind trianglesOnCpu{};
constinit const CpuPass rasterisePass{.run = rasterise};

}  // namespace stipple::cpu
