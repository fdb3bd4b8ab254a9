// Triangles of meshes once more, in fp64.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/reference/decode.h"
#include "engine/reference/restate_triangles.h"
#include "lod/store/mesh_place.h"

namespace stipple::reference {
namespace {

class MeshProjector {
  public:
    MeshProjector(const render::DrawList& draws, const Chunks& chunks, Level& level)
        : draws_(draws), chunks_(chunks), view_(draws.view), projector_(draws, level) {}

    void run() {
        for (size_t i = 0; i < draws_.meshCut.size(); ++i) {
            const lod::CutMeshDraw& cut = draws_.meshCut[i];
            const lod::Instance& instance = draws_.instances[cut.instance];
            const lod::Hierarchy& h = *draws_.hierarchies[instance.hierarchy];
            const lod::Chunk& chunk = chunks_.at(uint64_t{draws_.firstSource + instance.source} << 32 | cut.chunk);
            const TextureReader textures{draws_.meshTextures[draws_.meshDraws[i].mesh], chunks_};
            const uint32_t firstMaterial = draws_.firstMaterial[instance.hierarchy];
            for (uint32_t c = cut.firstCluster; c < cut.firstCluster + cut.clusters; ++c) {
                const shared::MeshCluster& cluster = chunk.clusters.at(c);
                for (uint32_t t = 0; t < cluster.counts >> 16; ++t) {
                    const uint32_t word = chunk.triangles.at(cluster.firstTriangle + t);
                    Corners corners;
                    const auto vertex = [&](uint32_t k) -> const shared::MeshVertex& {
                        return chunk.vertices.at(cluster.firstVertex + (word >> (8 * k)) % 256);
                    };
                    for (uint32_t k = 0; k < 3; ++k)
                        corners.at(k) = cornerOf(
                            h, instance, vertex(k),
                            lod::vertexPlace(lod::meshNode(h, cut.node), chunk, cluster, (word >> (8 * k)) % 256),
                            view_);
                    const uint32_t surface = vertex(0).surface;
                    projector_.triangle(corners, surface, draws_.materials[firstMaterial + surface % 65536], textures,
                                        {cut.errorPixels, h.nodes[cut.node].level});
                }
            }
        }
    }

  private:
    const render::DrawList& draws_;
    const Chunks& chunks_;
    const lod::View& view_;
    TriangleProjector projector_;
};

}  // namespace

void projectMeshes(const render::DrawList& draws, const Chunks& chunks, Level& level) {
    MeshProjector(draws, chunks, level).run();
}

}  // namespace stipple::reference
