// The cut of a graph of groups of triangles: groups are refined or not, all of a group's clusters at once
// (lod/primitives/mesh.h); and what the cut of an octree has of a payload of triangles.
#include <algorithm>
#include <span>

#include "lod/cut/frame.h"

namespace stipple::lod {
namespace {

enum GroupState : uint8_t { kCoarse = 0, kRefined = 1, kUnseen = 2 };

struct Looked {
    uint64_t visited = 0, culled = 0;
};

/// Decides for every group whether its clusters stand in for its simplification, into scratch.groupState; calls
/// onRefined(index, epsilon) for those in view that should, which says whether they can.
template <typename OnRefined>
Looked refineGroups(const CutFrame& frame, uint32_t i, int step, const OnRefined& onRefined) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    std::vector<uint8_t>& state = frame.scratch.groupState;
    state.assign(h.nodes.size(), kCoarse);
    Looked looked;
    for (uint32_t index = 0; index < h.nodes.size(); ++index) {
        const MeshGroup& group = h.groups[index];
        bool isReached = true;
        for (uint32_t k = 0; k < group.parents; ++k) isReached = isReached && state[h.parents[group.firstParent + k]];
        if (!isReached) continue;
        ++looked.visited;
        const int32_t epsilon = epsilonOf(frame, h, slot, index, kInside);
        if (epsilon == kCulled) {
            ++looked.culled;
            state[index] = kUnseen;
        } else if (h.nodes[index].errorCode > codeAt(epsilon, step) && onRefined(index, epsilon)) {
            state[index] = kRefined;
        }
    }
    return looked;
}

/// Calls use(index, run) for all runs that are drawn.
template <typename Use>
void drawnRuns(const Hierarchy& h, const std::vector<uint8_t>& state, const Use& use) {
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
bool drawsAny(const Hierarchy& h, const std::vector<uint8_t>& state, uint32_t index) {
    for (uint32_t r = 0; r < h.groups[index].runs; ++r) {
        const uint32_t producer = h.runs[h.groups[index].firstRun + r].producer;
        if (producer == MeshRun::kOriginal || state[producer] == kCoarse) return true;
    }
    return false;
}

/// The tiles of a texture's level that the coordinates from (lowU, lowV) to (highU, highV) can show.
struct TileRange {
    uint32_t x0, x1, y0, y1;
};
TileRange tilesSeen(const MeshGroup& g, const shared::TextureInfo& t, uint32_t level) {
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
    const auto [x0, x1] =
        range(g.lowU, g.highU, t.wrapU, shared::levelSize(t.width, level), shared::tilesAcross(t.width, level));
    const auto [y0, y1] =
        range(g.lowV, g.highV, t.wrapV, shared::levelSize(t.height, level), shared::tilesAcross(t.height, level));
    return {x0, x1, y0, y1};
}

/// Texture tiles that the groups in view can show: from the level whose texels are about a pixel where the group is
/// nearest to the coarsest, the part that its texture coordinates cover.
/// Geometry comes first: while some of it is missing, only the coarsest level is asked for and nothing finer is
/// held on to, or the textures of coarse groups would fill the memory that fine groups need.
void wantTiles(const CutFrame& frame, uint32_t instance, bool isWhole, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(instance);
    const LocalView& local = slotOf(frame, instance).view;
    const uint32_t source = frame.instance(instance).source;
    const std::vector<uint8_t>& drawable = frame.drawableOf(instance);
    const std::vector<uint8_t>& state = frame.scratch.groupState;
    std::vector<uint8_t>& seen = frame.scratch.tileSeen;
    seen.assign(h.tiles.size(), 0);
    const auto want = [&](uint32_t tile, float priority) {
        if (seen[tile]) return;
        seen[tile] = 1;
        const auto chunk = static_cast<uint32_t>(h.nodes.size() + tile);
        if (drawable[chunk])
            cut.keep.emplace_back(source, chunk);
        else
            cut.wanted.push_back({source, chunk, priority});
    };
    for (uint32_t index = 0; index < h.nodes.size(); ++index) {
        const MeshGroup& g = h.groups[index];
        if (state[index] != kRefined || g.textures == 0 || !drawsAny(h, state, index)) continue;
        const double uvPerPixel = 0.5 * g.uvPerStep * stepsPerPixel(h.nodes[index], local);
        for (uint32_t k = 0; k < g.textures; ++k) {
            const shared::TextureInfo& t = h.textures[h.groupTextures[g.firstTexture + k]];
            const double texels = uvPerPixel * std::max(t.width, t.height);
            const auto finest = static_cast<uint32_t>(
                std::clamp(std::floor(std::log2(std::max(1.0, texels))), 0.0, double(t.levels - 1)));
            // Parts that are seen at a slant, or farther away, take the coarser levels.
            for (uint32_t level = t.levels; level-- > (isWhole ? finest : t.levels - 1);) {
                const TileRange tiles = tilesSeen(g, t, level);
                const uint32_t across = shared::tilesAcross(t.width, level);
                for (uint32_t y = tiles.y0; y <= tiles.y1; ++y)
                    for (uint32_t x = tiles.x0; x <= tiles.x1; ++x)
                        want(t.firstTile[level] + y * across + x, static_cast<float>(1 + level));
            }
        }
    }
}

}  // namespace

CutCost costOfGraph(const CutFrame& frame, uint32_t i, int step, uint64_t /*most*/, Counted counted,
                    ActiveMembers* /*members*/) {
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    CutCost cost;
    refineGroups(frame, i, step, [&](uint32_t index, int32_t) {
        cost.isWhole = cost.isWhole && drawable[index] != 0;
        return counted == Counted::all || drawable[index] != 0;
    });
    drawnRuns(frame.hierarchyOf(i), frame.scratch.groupState,
              [&](uint32_t, const MeshRun& run) { cost.records += run.triangles; });
    return cost;
}

void emitGraph(const CutFrame& frame, uint32_t instance, int step, ActiveMembers& /*members*/, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(instance);
    const CutScratch::Slot& slot = slotOf(frame, instance);
    const uint32_t source = frame.instance(instance).source;
    const std::vector<uint8_t>& drawable = frame.drawableOf(instance);
    const uint64_t missingBefore = cut.counters.nodesMissing;
    const Looked looked = refineGroups(frame, instance, step, [&](uint32_t index, int32_t epsilon) {
        if (drawable[index]) {
            cut.keep.emplace_back(source, index);
            return true;
        }
        ++cut.counters.nodesMissing;
        const Node& node = h.nodes[index];
        const bool isRoot = h.groups[index].parents == 0;
        const double pixels = isRoot ? 1e9 : pixelsOf(slot, node.errorCode, epsilon);
        cut.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
        if (!isRoot) cut.tauEffective = std::max(cut.tauEffective, pixels);
        return false;
    });
    cut.counters.nodesVisited += looked.visited;
    cut.counters.nodesCulled += looked.culled;
    if (!h.textures.empty()) wantTiles(frame, instance, cut.counters.nodesMissing == missingBefore, cut);
    uint32_t last = MeshRun::kOriginal;
    drawnRuns(h, frame.scratch.groupState, [&](uint32_t index, const MeshRun& run) {
        const bool isExact = run.producer == MeshRun::kOriginal;
        // A producer that no view asked about was not looked at: its own error is smaller still.
        const double pixels =
            isExact ? 0
                    : pixelsOf(slot, h.nodes[run.producer].errorCode, epsilonOf(frame, h, slot, run.producer, kInside));
        cut.meshDraw.push_back(
            {instance, index, index, run.firstCluster, run.clusters, run.triangles, static_cast<float>(pixels)});
        cut.counters.trianglesDrawn += run.triangles;
        cut.counters.nodesDrawn += index != last ? 1 : 0;
        last = index;
    });
}

// ---- in an octree: all triangles of a payload have one error, and its parent's; a run stands in an octant

namespace {

/// Calls use(run) for the runs of a payload that are drawn.
template <typename Use>
void askedRuns(const Hierarchy& h, const Payload& p, const Asked& asked, const Use& use) {
    if (h.countGreater(p.parentCounts, p.records, asked.parentCode) == 0) return;
    const bool isFine = h.countGreater(p.ownCounts, p.records, asked.code) == 0;
    const MeshGroup& g = h.groups[p.group];
    for (const MeshRun& run : std::span(h.runs).subspan(g.firstRun, g.runs))
        if (isFine || (asked.octantMask >> run.producer & 1u) != 0) use(run);
}

}  // namespace

uint64_t costOfClusters(const Hierarchy& h, uint32_t chunk, const Asked& asked) {
    uint64_t triangles = 0;
    askedRuns(h, h.payload(chunk), asked, [&](const MeshRun& run) { triangles += run.triangles; });
    return triangles;
}

void emitClusters(const CutFrame& frame, uint32_t i, uint32_t chunk, const Asked& asked, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const Payload& p = h.payload(chunk);
    const double delivered = deliveredPixels(slotOf(frame, i), p.errorCode, asked);
    const size_t before = cut.meshDraw.size();
    askedRuns(h, p, asked, [&](const MeshRun& run) {
        if (asked.octantMask) cut.tauEffective = std::max(cut.tauEffective, delivered);
        cut.meshDraw.push_back(
            {i, h.nodeOf(chunk), chunk, run.firstCluster, run.clusters, run.triangles, static_cast<float>(delivered)});
        cut.counters.trianglesDrawn += run.triangles;
    });
    cut.counters.nodesDrawn += cut.meshDraw.size() > before ? 1 : 0;
}

}  // namespace stipple::lod
