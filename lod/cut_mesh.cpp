// The cut of meshes: groups are refined or not, all of a group's clusters at once (lod/mesh.h).
#include <algorithm>
#include <cmath>

#include "lod/selector.h"

namespace stipple::lod {

/// Decides for every group whether its clusters stand in for its simplification; calls onRefined(index, epsilon)
/// for those in view that should, which says whether they can.
template <typename OnRefined>
void Selector::refineGroups(size_t i, int step, const OnRefined& onRefined) {
    const Hierarchy& h = hierarchyOf(i);
    CutScratch::Slot& slot = slotOf(i);
    std::vector<uint8_t>& state = scratch_.groupState;
    state.assign(h.nodes.size(), kCoarse);
    for (uint32_t index = 0; index < h.nodes.size(); ++index) {
        const MeshGroup& group = h.groups[index];
        bool isReached = true;
        for (uint32_t k = 0; k < group.parents; ++k) isReached = isReached && state[h.parents[group.firstParent + k]];
        if (!isReached) continue;
        ++cut_.counters.nodesVisited;
        const int32_t epsilon = epsilonOf(i, slot, index, kInside);
        if (epsilon == kCulled) {
            ++cut_.counters.nodesCulled;
            state[index] = kUnseen;
        } else if (h.nodes[index].errorCode > codeAt(epsilon, step) && onRefined(index, epsilon)) {
            state[index] = kRefined;
        }
    }
}

/// Calls use(index, run) for all runs that are drawn.
template <typename Use>
void Selector::drawnRuns(const Hierarchy& h, const Use& use) const {
    const std::vector<uint8_t>& state = scratch_.groupState;
    for (uint32_t index = 0; index < h.nodes.size(); ++index) {
        if (state[index] != kRefined) continue;
        const MeshGroup& group = h.groups[index];
        for (uint32_t r = 0; r < group.runs; ++r) {
            const MeshRun& run = h.runs[group.firstRun + r];
            if (run.producer == MeshRun::kOriginal || state[run.producer] == kCoarse) use(index, run);
        }
    }
}

/// Is any of a refined group's runs drawn, not all replaced by finer ones?
bool Selector::drawsAny(const Hierarchy& h, uint32_t index) const {
    for (uint32_t r = 0; r < h.groups[index].runs; ++r) {
        const uint32_t producer = h.runs[h.groups[index].firstRun + r].producer;
        if (producer == MeshRun::kOriginal || scratch_.groupState[producer] == kCoarse) return true;
    }
    return false;
}

uint64_t Selector::meshCost(size_t i, int step) {
    refineGroups(i, step, [](uint32_t, int32_t) { return true; });
    uint64_t total = 0;
    drawnRuns(hierarchyOf(i), [&](uint32_t, const MeshRun& run) { total += run.triangles; });
    return total;
}

void Selector::emitMesh(uint32_t instance, int step) {
    const Hierarchy& h = hierarchyOf(instance);
    CutScratch::Slot& slot = slotOf(instance);
    const uint32_t source = instances_[instance].source;
    const std::vector<uint8_t>& drawable = residency_.drawable[source];
    const uint64_t missingBefore = cut_.counters.nodesMissing;
    refineGroups(instance, step, [&](uint32_t index, int32_t epsilon) {
        if (drawable[index]) {
            cut_.keep.emplace_back(source, index);
            return true;
        }
        ++cut_.counters.nodesMissing;
        const Node& node = h.nodes[index];
        const bool isRoot = h.groups[index].parents == 0;
        const double pixels = isRoot ? 1e9 : pixelsOf(slot, node.errorCode, epsilon);
        cut_.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
        if (!isRoot) cut_.tauEffective = std::max(cut_.tauEffective, pixels);
        return false;
    });
    if (!h.textures.empty()) wantTiles(instance, slot.view, cut_.counters.nodesMissing == missingBefore);
    uint32_t last = MeshRun::kOriginal;
    drawnRuns(h, [&](uint32_t index, const MeshRun& run) {
        const bool isExact = run.producer == MeshRun::kOriginal;
        // A producer that no view asked about was not looked at: its own error is smaller still.
        const double pixels =
            isExact ? 0
                    : pixelsOf(slot, h.nodes[run.producer].errorCode, epsilonOf(instance, slot, run.producer, kInside));
        cut_.meshDraw.push_back(
            {instance, index, run.firstCluster, run.clusters, run.triangles, static_cast<float>(pixels)});
        cut_.counters.trianglesDrawn += run.triangles;
        cut_.counters.nodesDrawn += index != last ? 1 : 0;
        last = index;
    });
}

/// Texture tiles that the groups in view can show: from the level whose texels are about a pixel where the group is
/// nearest to the coarsest, the part that its texture coordinates cover.
/// Geometry comes first: while some of it is missing, only the coarsest level is asked for and nothing finer is
/// held on to, or the textures of coarse groups would fill the memory that fine groups need.
void Selector::wantTiles(uint32_t instance, const LocalView& local, bool isWhole) {
    const Hierarchy& h = hierarchyOf(instance);
    const uint32_t source = instances_[instance].source;
    std::vector<uint8_t>& seen = scratch_.tileSeen;
    seen.assign(h.tiles.size(), 0);
    const auto want = [&](uint32_t tile, float priority) {
        if (seen[tile]) return;
        seen[tile] = 1;
        const auto chunk = static_cast<uint32_t>(h.nodes.size() + tile);
        if (residency_.drawable[source][chunk])
            cut_.keep.emplace_back(source, chunk);
        else
            cut_.wanted.push_back({source, chunk, priority});
    };
    for (uint32_t index = 0; index < h.nodes.size(); ++index) {
        const MeshGroup& g = h.groups[index];
        if (scratch_.groupState[index] != kRefined || g.textures == 0 || !drawsAny(h, index)) continue;
        const double uvPerPixel = 0.5 * g.uvPerStep * stepsPerPixel(h.nodes[index], local);
        for (uint32_t k = 0; k < g.textures; ++k) {
            const shared::TextureInfo& t = h.textures[h.groupTextures[g.firstTexture + k]];
            const double texels = uvPerPixel * std::max(t.width, t.height);
            const auto finest = static_cast<uint32_t>(
                std::clamp(std::floor(std::log2(std::max(1.0, texels))), 0.0, double(t.levels - 1)));
            const auto range = [](float lo, float hi, uint32_t wrap, uint32_t size, uint32_t tiles) {
                // Coordinates that wrap around, or may, take the whole row.
                const float a = std::floor(lo), texel = 1.0f / static_cast<float>(size);
                if (wrap == shared::kWrapMirror || hi - a >= 1 - texel || lo - a <= texel || !(hi - lo < 1))
                    return std::pair{0u, tiles - 1};
                const auto tile = [&](float u) {
                    const float at = std::clamp(u - a, 0.0f, 1.0f) * static_cast<float>(size);
                    return std::min(static_cast<uint32_t>(at / shared::kTileTexels), tiles - 1);
                };
                return std::pair{tile(lo - texel), tile(hi + texel)};
            };
            // Parts that are seen at a slant, or farther away, take the coarser levels.
            for (uint32_t level = t.levels; level-- > (isWhole ? finest : t.levels - 1);) {
                const uint32_t across = shared::tilesAcross(t.width, level),
                               down = shared::tilesAcross(t.height, level);
                const auto [x0, x1] = range(g.lowU, g.highU, t.wrapU, shared::levelSize(t.width, level), across);
                const auto [y0, y1] = range(g.lowV, g.highV, t.wrapV, shared::levelSize(t.height, level), down);
                for (uint32_t y = y0; y <= y1; ++y)
                    for (uint32_t x = x0; x <= x1; ++x)
                        want(t.firstTile[level] + y * across + x, static_cast<float>(1 + level));
            }
        }
    }
}

}  // namespace stipple::lod
