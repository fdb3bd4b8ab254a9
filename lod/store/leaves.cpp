#include "lod/store/leaves.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "engine/base/hash.h"
#include "lod/store/attributes.h"
#include "lod/store/mesh_place.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

glm::dvec3 placeOf(const Hierarchy& h, const Node& node, const Chunk& chunk, size_t i) {
    const shared::PointRecord& r = chunk.records[i];
    const std::array<uint64_t, 3> q{shared::recordX(r), shared::recordY(r), shared::recordZ(r)};
    const auto size = static_cast<uint64_t>(h.cellSize(node));
    glm::dvec3 lattice(0);
    for (size_t a = 0; a < 3; ++a) {
        const uint64_t low = chunk.lowBits.empty() ? 0 : chunk.lowBits[i * 3 + a];
        const uint64_t local = node.stepShift >= 0 ? q.at(a) << node.stepShift | low : q.at(a) >> -node.stepShift;
        lattice[static_cast<int>(a)] = static_cast<double>(node.cell.at(a) * size + local);
    }
    return h.origin + h.unit * lattice;
}

/// One leaf, read as a whole and given in blocks.
struct Leaf {
    std::shared_ptr<const Store> store;
    uint32_t node = 0;
    Chunk chunk;
    std::vector<std::vector<uint8_t>> values;  ///< of the attributes that are wanted
    size_t given = 0;

    size_t give(PointBlock& block, size_t limit) {
        const Hierarchy& h = store->hierarchy;
        const StoreDescription& d = store->description;
        const size_t end = std::min(given + limit, chunk.records.size()), count = end - given;
        block.attributes.resize(values.size());
        for (; given < end; ++given) {
            const shared::PointRecord& r = chunk.records[given];
            block.position.push_back(placeOf(h, h.nodes[node], chunk, given));
            if (d.hasColour) block.colour.push_back(r.colour & 0xffffffu);
            const bool hasNormal = (shared::recordFlags(r) & shared::kFlagNoNormal) == 0;
            if (d.hasNormals) block.normal.push_back(hasNormal ? glm::vec3(shared::octDecode(r.normal)) : glm::vec3(0));
            block.radius.push_back(
                static_cast<float>(h.unit * h.cellSize(h.nodes[node]) *
                                   static_cast<double>(shared::radiusFraction(shared::recordRadiusCode(r)))));
            for (size_t a = 0; a < values.size(); ++a) {
                const size_t width = bytesOf(d.attributes[a].type);
                const uint8_t* const from = values[a].data() + given * width;
                block.attributes[a].insert(block.attributes[a].end(), from, from + width);
            }
        }
        return count;
    }
};

tl::unexpected<Error> otherKind(const Store& store, const char* wanted) {
    return fail(ErrorKind::input, std::string("holds no ") + wanted, store.path,
                "patches, curves and mixed scenes are not written to other formats");
}

}  // namespace

Result<PointSource> leafPoints(std::shared_ptr<const Store> store) {
    const Hierarchy& h = store->hierarchy;
    const StoreDescription& d = store->description;
    if (h.isMixed || h.isStochastic || h.nodes.empty() || h.nodes[0].kind != Kind::points)
        return otherKind(*store, "points alone");
    STIPPLE_TRY(readWholeTable(*store));
    PointSource source;
    source.info.path = store->path;
    source.info.format = "Stipple";
    source.info.hasColour = d.hasColour;
    source.info.hasNormal = d.hasNormals;
    source.info.hasRadius = true;
    source.info.attributes = d.attributes;
    source.info.crs = d.crs;
    std::vector<uint32_t> leaves;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        if (h.nodes[n].isLeaf()) {
            leaves.push_back(n);
            source.parts.push_back(h.ownRecordsOf(h.nodes[n]));
            source.info.points += source.parts.back();
        }
    source.openPart = [store, leaves](size_t part) -> Result<PointReader> {
        auto leaf = std::make_shared<Leaf>();
        leaf->store = store;
        leaf->node = leaves[part];
        STIPPLE_ASSIGN(leaf->chunk, readChunk(*store, leaf->node, true));
        for (size_t a = 0; a < store->description.attributes.size(); ++a) {
            STIPPLE_ASSIGN(std::vector<uint8_t> values, readAttribute(*store, leaf->node, a));
            leaf->values.push_back(std::move(values));
        }
        return PointReader(
            [leaf](PointBlock& block, size_t limit) -> Result<size_t> { return leaf->give(block, limit); });
    };
    return source;
}

Result<MeshSource> leafTriangles(std::shared_ptr<const Store> store) {
    if (store->hierarchy.isMixed || !store->hierarchy.isGraph) return otherKind(*store, "triangles alone");
    MeshSource source;
    source.identity = [hash = hashBytes(store->path.data(), store->path.size())] { return hash; };
    source.read = [store](const MeshSource::Take& take) -> Result<void> {
        const Hierarchy& h = store->hierarchy;
        for (uint32_t n = 0; n < h.nodes.size(); ++n) {
            const Payload payload = h.payload(n);
            if (payload.kind != Kind::triangles) continue;  // coarse ones
            const MeshGroup& group = h.groups[payload.group];
            STIPPLE_ASSIGN(const Chunk chunk, readChunk(*store, n));
            TriangleMesh block;
            for (uint32_t r = group.firstRun; r < group.firstRun + group.runs; ++r) {
                if (h.runs[r].producer != MeshRun::kOriginal) continue;
                for (uint32_t c = h.runs[r].firstCluster; c < h.runs[r].firstCluster + h.runs[r].clusters; ++c) {
                    const shared::MeshCluster& cluster = chunk.clusters[c];
                    const auto first = static_cast<uint32_t>(block.position.size());
                    for (uint32_t v = 0; v < verticesOf(h.nodes[n], cluster); ++v)
                        block.position.push_back(h.origin + h.unit * vertexPlace(h.nodes[n], chunk, cluster, v));
                    for (uint32_t t = 0; t < cluster.counts >> 16; ++t)
                        for (uint32_t k = 0; k < 3; ++k)
                            block.indices.push_back(first +
                                                    (chunk.triangles[cluster.firstTriangle + t] >> (8 * k) & 255u));
                }
            }
            if (!block.indices.empty()) STIPPLE_TRY(take(block));
        }
        return {};
    };
    return source;
}

}  // namespace stipple::lod
