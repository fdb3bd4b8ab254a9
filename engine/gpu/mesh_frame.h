// What one frame's triangles are on the device: clusters, materials, textures and tiles as flat arrays.
#pragma once

#include <unordered_map>
#include <vector>

#include "engine/render/draw_list.h"
#include "lod/store/chunk.h"
#include "shaders/shared/mesh.h"

namespace stipple::gpu {

/// A resident chunk of a mesh: where its parts lie in the device's memory, and its clusters.
struct MeshChunk {
    uint64_t vertices = 0, triangles = 0;  ///< device addresses
    std::vector<shared::MeshCluster> clusters;
};

struct TileAddress {
    uint32_t low = 0, high = 0;
};

/// `tileAddress(source, chunk)`: 0 where a tile is not resident.
struct MeshFrame {
    std::vector<shared::DrawCluster> clusters;
    std::vector<shared::TextureInfo> textures;
    std::vector<TileAddress> tiles;

    template <typename ChunkOf, typename TileOf>
    void fill(const render::DrawList& draws, const ChunkOf& chunkOf, const TileOf& tileOf) {
        clusters.clear();
        textures.clear();
        tiles.clear();
        struct First {
            uint32_t texture, tile;
        };
        std::vector<First> first;
        std::unordered_map<uint32_t, First> bySource;
        for (const render::MeshTextures& t : draws.meshTextures) {
            const auto [known, isNew] = bySource.try_emplace(
                t.source, First{static_cast<uint32_t>(textures.size()), static_cast<uint32_t>(tiles.size())});
            first.push_back(known->second);
            if (!isNew) continue;
            textures.insert(textures.end(), t.infos.begin(), t.infos.end());
            for (uint32_t k = 0; k < t.tiles; ++k) {
                const uint64_t address = tileOf(t.source, t.firstChunk + k);
                tiles.push_back({static_cast<uint32_t>(address), static_cast<uint32_t>(address >> 32)});
            }
        }
        for (size_t r = 0; r < draws.meshDraws.size(); ++r) {
            const render::MeshDraw& draw = draws.meshDraws[r];
            const MeshChunk& chunk = chunkOf(draws.triangles().keys[r]);
            for (uint32_t c = draw.firstCluster; c < draw.firstCluster + draw.clusters; ++c) {
                const shared::MeshCluster& cluster = chunk.clusters[c];
                const uint64_t v = chunk.vertices + uint64_t{cluster.firstVertex} * sizeof(shared::MeshVertex),
                               t = chunk.triangles + uint64_t{cluster.firstTriangle} * 4;
                clusters.push_back({draw.mesh, cluster.counts, static_cast<uint32_t>(v), static_cast<uint32_t>(v >> 32),
                                    static_cast<uint32_t>(t), static_cast<uint32_t>(t >> 32), first[draw.mesh].texture,
                                    first[draw.mesh].tile, draw.level, draw.errorPixels});
            }
        }
    }
};

}  // namespace stipple::gpu
