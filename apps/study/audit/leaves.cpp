// Shapes of the leaves of placed stores, decoded from the description of the format alone.
#include <fmt/format.h>

#include "apps/study/audit/full_detail.h"
#include "engine/reference/decode.h"
#include "engine/reference/decode_patch.h"
#include "lod/store/mesh_place.h"
#include "lod/store/store.h"
#include "shaders/shared/record.h"

namespace stipple::study {
namespace {

using glm::dvec3;

/// One placed store.
struct Leaves {
    const lod::Store& store;
    const lod::Instance& place;
    FullShapes& shapes;
    bool withPatches;

    dvec3 placed(const dvec3& local) const { return place.translation + place.rotation * (place.scale * local); }

    void addPoints(uint32_t node, const lod::Chunk& chunk) {
        const lod::Hierarchy& h = store.hierarchy;
        for (const shared::PointRecord& r : chunk.records) {
            const reference::Disc d = reference::decodeDisc(h, h.nodes[node], r);
            shapes.discs.push_back({placed(d.position), place.rotation * d.normal, place.scale * d.radius});
        }
    }
    void addCurves(uint32_t node, const lod::Chunk& chunk) {
        const lod::Hierarchy& h = store.hierarchy;
        for (const shared::CurveSegment& segment : chunk.segments) {
            const reference::Segment s = reference::decodeSegment(h, h.nodes[node], segment);
            shapes.tubes.push_back({placed(s.a), placed(s.b), place.scale * s.radiusA, place.scale * s.radiusB});
        }
    }
    void addTriangles(uint32_t node, const lod::Payload& payload, const lod::Chunk& chunk) {
        const lod::Hierarchy& h = store.hierarchy;
        const lod::MeshGroup& group = h.groups[payload.group];
        for (uint32_t r = group.firstRun; r < group.firstRun + group.runs; ++r) {
            if (h.runs[r].producer != lod::MeshRun::kOriginal) continue;
            for (uint32_t c = h.runs[r].firstCluster; c < h.runs[r].firstCluster + h.runs[r].clusters; ++c)
                for (uint32_t t = 0; t < chunk.clusters[c].counts >> 16; ++t) {
                    FullTriangle corners;
                    for (uint32_t k = 0; k < 3; ++k) {
                        const uint32_t corner = chunk.triangles[chunk.clusters[c].firstTriangle + t] >> (8 * k) & 255u;
                        corners.at(k) = placed(
                            h.origin + h.unit * lod::vertexPlace(h.nodes[node], chunk, chunk.clusters[c], corner));
                    }
                    shapes.triangles.push_back(corners);
                }
        }
    }
    void addPatches(uint32_t node, const lod::Chunk& chunk) {
        const lod::Hierarchy& h = store.hierarchy;
        for (size_t b = 0; b < chunk.patchBlocks.size(); ++b) {
            const reference::PatchBlockReader block(h, h.nodes[node], chunk.patchBlocks[b], chunk.patchPlanes[b]);
            const auto corner = [&](uint32_t s) { return placed(h.origin + h.unit * block.sample(s).place); };
            block.forEachTriangle([&](uint32_t i, uint32_t j, uint32_t k) {
                shapes.triangles.push_back({corner(i), corner(j), corner(k)});
            });
        }
    }
    Result<void> add(uint32_t node, uint32_t index) {
        const lod::Payload& payload = store.hierarchy.payload(index);
        if (store.hierarchy.isGraph && payload.kind != lod::Kind::triangles) return {};  // coarse ones
        if (!withPatches && payload.kind == lod::Kind::patches) return {};
        STIPPLE_ASSIGN(const lod::Chunk chunk, lod::readChunk(store, index));
        if (payload.kind == lod::Kind::points) addPoints(node, chunk);
        if (payload.kind == lod::Kind::curves) addCurves(node, chunk);
        if (payload.kind == lod::Kind::triangles) addTriangles(node, payload, chunk);
        if (payload.kind == lod::Kind::patches) addPatches(node, chunk);
        return {};
    }
};

/// Records of leaves, each of which is a shape or more: no less than add() makes, without a chunk being read.
uint64_t leastShapesOf(const lod::Hierarchy& h) {
    uint64_t least = 0;
    if (h.isGraph) return least;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        if (h.nodes[n].isLeaf())
            h.forEachPayload(n, [&](uint32_t index) {
                const lod::Payload& payload = h.payload(index);
                if (payload.kind == lod::Kind::points || payload.kind == lod::Kind::curves)
                    least += h.ownRecordsOf(payload);
            });
    return least;
}

Error tooMany(size_t most, const lod::Store& store) {
    return {ErrorKind::budget, fmt::format("has more than {} shapes in its leaves", most), store.path, {}};
}

}  // namespace

Result<FullShapes> leavesOf(std::span<const render::PlacedStore> placed, size_t most, bool withPatches) {
    FullShapes shapes;
    uint64_t least = 0;
    for (const render::PlacedStore& p : placed) {
        STIPPLE_TRY(lod::readWholeTable(*p.store));
        least += leastShapesOf(p.store->hierarchy);
        if (least > most) return tl::unexpected(tooMany(most, *p.store));
    }
    for (const render::PlacedStore& p : placed) {
        const lod::Hierarchy& h = p.store->hierarchy;
        Leaves leaves{*p.store, p.place, shapes, withPatches};
        for (uint32_t n = 0; n < h.nodes.size(); ++n) {
            if (!h.isGraph && !h.nodes[n].isLeaf()) continue;
            Result<void> added;
            h.forEachPayload(n, [&](uint32_t index) {
                if (added) added = leaves.add(n, index);
            });
            STIPPLE_TRY(added);
            if (shapes.size() > most) return tl::unexpected(tooMany(most, *p.store));
        }
    }
    return shapes;
}

}  // namespace stipple::study
