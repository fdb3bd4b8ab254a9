#include "lod/store/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"
#include "lod/store/mesh_place.h"
#include "shaders/shared/patch_map.h"

namespace stipple::lod {

Error damagedStore(const std::string& where, const std::string& what) {
    return Error{ErrorKind::input, what, where, "the store is damaged or not whole; build it again"};
}

namespace {

constexpr double kFarthest = 1e150;        ///< of world coordinates: their squares must be numbers, too
constexpr double kFarthestSteps = 0x1p80;  ///< of spheres, lattice units; lattices end at 2^62
constexpr float kLargestFactor = 1e9f;     ///< of a material

bool isWithin(const glm::dvec3& v, double limit) {
    return std::abs(v.x) <= limit && std::abs(v.y) <= limit && std::abs(v.z) <= limit;
}
bool isWithin(const shared::vec3& v, float limit) {
    return std::abs(v.x) <= limit && std::abs(v.y) <= limit && std::abs(v.z) <= limit;
}

/// World coordinates of all that the lattice can name must be finite, and so must be what is measured in them.
bool isPossibleSpace(const Hierarchy& h, const StoreDescription& d) {
    const double edge = std::ldexp(h.unit, static_cast<int>(h.rootLog2));
    bool fits = isWithin(h.origin, kFarthest) && h.unit >= 1e-150 && edge <= kFarthest && h.errors.smallest >= 1e-30 &&
                h.errors.smallest <= kFarthestSteps;
    for (const glm::dvec3& p : {d.boundsMin, d.boundsMax, d.focusMin, d.focusMax})
        fits = fits && isWithin(p, kFarthest);
    for (int axis = 0; axis < 3; ++axis)
        fits = fits && d.boundsMin[axis] <= d.boundsMax[axis] && d.focusMin[axis] <= d.focusMax[axis];
    fits = fits && std::abs(d.lowHeight) <= 2 * kFarthest && std::abs(d.highHeight) <= 2 * kFarthest;
    for (const float factor : h.discFactors) fits = fits && factor >= 1e-6f && factor <= 1e6f;
    return fits && d.metresPerUnit > 0 && d.metresPerUnit <= kFarthest;
}

bool isPossiblePlace(const Node& n) {
    return isWithin(n.centre, kFarthestSteps) && n.radius >= 0 && n.radius <= kFarthestSteps &&
           // (Up to build version 8, all directions might be a little less than -1.)
           n.normalConeCosine >= -1.00001f && n.normalConeCosine <= 1;
}

/// Does a payload lie in the file, and can its bytes hold its records?
bool isPossiblePayload(const Hierarchy& h, uint32_t chunk, uint64_t chunksEnd) {
    const Payload& p = h.payload(chunk);
    const CodecTraits& codec = traitsOf(p.codec);
    bool fits = p.chunkOffset <= chunksEnd && uint64_t{p.chunkBytes} + p.attributeBytes <= chunksEnd - p.chunkOffset &&
                p.chunkBytes >= kFewestChunkBytes && p.records > 0 && codec.kind == p.kind;
    for (uint32_t k = p.firstStream; k < p.firstStream + p.streams; ++k)
        fits = fits && h.streams[k].offset <= chunksEnd && h.streams[k].bytes <= chunksEnd - h.streams[k].offset &&
               (h.streams[k].id != StreamId::surfelWeights || p.kind == Kind::points);
    fits = fits && (p.maps == 0 || p.kind == Kind::patches);
    return fits && isPossibleGain(p.chunkBytes, codec.fewestBytes(h, chunk));
}

/// No byte of the file is in two streams: what they hold together is no more than the file is.
class Overlaps {
  public:
    void add(uint64_t offset, uint64_t bytes) {
        if (bytes == 0) return;
        isAscending_ = isAscending_ && (ranges_.empty() || ranges_.back().second <= offset);
        ranges_.emplace_back(offset, offset + bytes);
    }
    void addNode(const Hierarchy& h, uint32_t node) {
        h.forEachPayload(node, [&](uint32_t chunk) {
            const Payload& p = h.payload(chunk);
            add(p.chunkOffset, uint64_t{p.chunkBytes} + p.attributeBytes);
        });
    }
    Result<void> check(const std::string& path) {
        if (isAscending_) return {};
        std::sort(ranges_.begin(), ranges_.end());
        for (size_t i = 1; i < ranges_.size(); ++i)
            if (ranges_[i].first < ranges_[i - 1].second)
                return tl::unexpected(damagedStore(
                    path, fmt::format("two streams share the bytes at offset {}: not possible", ranges_[i].first)));
        return {};
    }

  private:
    std::vector<std::pair<uint64_t, uint64_t>> ranges_;
    bool isAscending_ = true;
};

Result<void> checkOverlaps(const Store& store) {
    const Hierarchy& h = store.hierarchy;
    Overlaps all;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) all.addNode(h, n);
    for (const Stream& s : h.streams) all.add(s.offset, s.bytes);
    return all.check(store.path);
}

bool isPossibleMaterial(const shared::SurfaceMaterial& m, size_t textures) {
    bool fits = isWithin(m.baseColour, kLargestFactor) && isWithin(m.emissive, kLargestFactor);
    for (const float factor : {m.alpha, m.alphaCutoff, m.metallic, m.roughness, m.normalScale, m.occlusionStrength})
        fits = fits && std::abs(factor) <= kLargestFactor;
    for (const shared::TextureSlot* slot :
         {&m.baseTexture, &m.surfaceTexture, &m.normalTexture, &m.occlusionTexture, &m.emissiveTexture})
        fits = fits && slot->texture <= textures && isWithin(slot->rowU, 1e30f) && isWithin(slot->rowV, 1e30f);
    return fits;
}

/// Every level of a texture has its tiles, and they lie in the file.
Result<void> checkTextures(const Store& store, uint64_t chunksEnd) {
    const Hierarchy& h = store.hierarchy;
    uint64_t tiles = 0;
    bool fits = h.isGraph || h.tiles.size() + h.textures.size() + h.groupTextures.size() + h.parents.size() +
                                     (h.groups.empty() ? h.runs.size() : 0) ==
                                 0;
    for (const shared::TextureInfo& t : h.textures) {
        fits = fits && t.width > 0 && t.height > 0 && t.width <= 65536 && t.height <= 65536 && t.levels > 0 &&
               t.levels <= shared::kTextureLevels && t.wrapU <= 2 && t.wrapV <= 2;
        for (uint32_t l = 0; fits && l < t.levels; ++l) {
            fits = t.firstTile[l] == tiles;
            tiles += uint64_t{shared::tilesAcross(t.width, l)} * shared::tilesAcross(t.height, l);
        }
    }
    fits = fits && tiles == h.tiles.size();
    for (const TextureTile& t : h.tiles) fits = fits && t.offset <= chunksEnd && t.bytes <= chunksEnd - t.offset;
    for (const uint32_t t : h.groupTextures) fits = fits && t < h.textures.size();
    for (const shared::SurfaceMaterial& m : store.description.materials)
        fits = fits && isPossibleMaterial(m, h.textures.size());
    if (!fits)
        return tl::unexpected(damagedStore(store.path, "the textures or materials of the mesh are not possible"));
    return {};
}

/// Parents before children, producers after the groups that hold what they gave; the arrays of one group follow those
/// of the group before it, so that no group can be walked along twice.
Result<void> checkGroups(const Store& store, uint64_t chunksEnd) {
    const Hierarchy& h = store.hierarchy;
    uint64_t runs = 0, parents = 0, textures = 0;
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        const Node& n = h.nodes[i];
        const MeshGroup& g = h.groups[i];
        bool fits = isPossiblePlace(n) && n.attributeBytes == 0 && n.isLeaf() && g.runs > 0 && g.firstRun == runs &&
                    g.firstParent == parents && g.firstTexture == textures && (g.parents > 0) == (n.errorCode != 255) &&
                    (i > 0 || g.parents == 0);
        const bool isWide = h.rootLog2 > kShortMeshBits;
        for (const uint64_t c : n.cell) fits = fits && (c == 0 || isWide);
        fits = fits && (n.stepShift == 0 || (isWide && n.stepShift == 1));
        runs += g.runs;
        parents += g.parents;
        textures += g.textures;
        fits = fits && runs <= h.runs.size() && parents <= h.parents.size() && textures <= h.groupTextures.size();
        fits = fits && g.vertices <= uint64_t{g.clusters} * shared::kClusterVertices && g.clusters <= n.records &&
               n.records <= uint64_t{g.clusters} * shared::kClusterTriangles;
        fits = fits && isPossiblePayload(h, static_cast<uint32_t>(i), chunksEnd);
        fits = fits && std::isfinite(g.lowU + g.lowV + g.highU + g.highV) && std::isfinite(g.uvPerStep);
        uint64_t triangles = 0, clusters = 0;
        for (uint32_t r = 0; fits && r < g.runs; ++r) {
            const MeshRun& run = h.runs[g.firstRun + r];
            fits = run.firstCluster == clusters &&
                   (run.producer == MeshRun::kOriginal || (run.producer > i && run.producer < h.nodes.size()));
            clusters += run.clusters;
            triangles += run.triangles;
        }
        for (uint32_t k = 0; fits && k < g.parents; ++k) fits = h.parents[g.firstParent + k] < i;
        if (!fits || triangles != n.records || clusters != g.clusters)
            return tl::unexpected(damagedStore(store.path, fmt::format("group {} of the mesh is not possible", i)));
    }
    return {};
}

/// Its own: place, payloads.
bool isPossibleNode(const Hierarchy& h, uint32_t number, uint64_t chunksEnd) {
    const Node& n = h.nodes[number];
    bool fits = isPossiblePlace(n) && (number > 0 || n.level == 0) && n.level <= h.rootLog2;
    h.forEachPayload(number, [&](uint32_t chunk) {
        const Payload& p = h.payload(chunk);
        const KindTraits& kind = traitsOf(p.kind);
        const int bits = h.isStochastic ? 15 : static_cast<int>(kind.cellBits);
        const int shift = bits == 0 ? 0 : static_cast<int>(h.rootLog2) - n.level - bits;
        fits = fits && p.stepShift == shift && kind.isPossible(h, chunk) && isPossiblePayload(h, chunk, chunksEnd);
    });
    // A cone says of all that is below its node that it faces away: only points do.
    return fits && !(h.isMixed && n.normalConeCosine > 0);
}

/// Is it the child of its parent, in its octant of the parent's cell? `begin`: of the nodes that are checked; those
/// before are there only if their page was found to be right.
bool isPossibleChild(const Hierarchy& h, uint32_t number, uint64_t begin) {
    const Node& n = h.nodes[number];
    if (n.parent >= number || (n.parent < begin && !h.known.hasNode(n.parent))) return false;
    const Node& parent = h.nodes[n.parent];
    uint32_t child = parent.firstChild;
    for (uint32_t octant = 0; octant < 8; ++octant) {
        if (!(parent.childMask >> octant & 1u)) continue;
        if (child++ != number) continue;
        bool fits = n.level == parent.level + 1;
        for (uint32_t axis = 0; axis < 3; ++axis)
            fits = fits && n.cell.at(axis) == 2 * parent.cell.at(axis) + (octant >> axis & 1u);
        return fits;
    }
    return false;
}

/// What the nodes before have of children (and the root), and of runs.
struct Before {
    uint64_t children = 1, runs = 0;
};

/// Only roots of points alone have one, and something below it. (What reads leaves relies on that.)
bool hasPossibleOverview(const Hierarchy& h, uint32_t node) {
    bool fits = true;
    h.forEachPayload(node, [&](uint32_t chunk) {
        const Payload& p = h.payload(chunk);
        if (p.kind != Kind::points || h.isStochastic) return;
        const uint32_t overview = h.overviewOf(p);
        fits = fits && (overview == 0 || (chunk == 0 && !h.isMixed && overview < p.records));
    });
    return fits;
}

/// Of a tree, breadth first, nodes `begin` to `end`: the children of a node follow those of the node before it, so that
/// no node is the child of two, and so do the runs of its triangles. `before` moves on. What is above them was checked.
Result<void> checkTree(const Hierarchy& h, const std::string& path, uint64_t begin, uint64_t end, uint64_t chunksEnd,
                       Before& before) {
    for (uint64_t i = begin; i < end; ++i) {
        const auto number = static_cast<uint32_t>(i);
        const Node& n = h.nodes[i];
        bool fits = isPossibleNode(h, number, chunksEnd) && hasPossibleOverview(h, number) &&
                    (n.isLeaf() || n.firstChild == before.children) && (i == 0 || isPossibleChild(h, number, begin));
        h.forEachPayload(number, [&](uint32_t chunk) {
            const Payload& p = h.payload(chunk);
            if (p.kind != Kind::triangles) return;
            fits = fits && h.groups[p.group].firstRun == before.runs;
            before.runs += h.groups[p.group].runs;
        });
        before.children += static_cast<uint64_t>(__builtin_popcount(n.childMask));
        if (!fits || before.children > h.nodes.size())
            return tl::unexpected(damagedStore(path, fmt::format("node {} of the node table is not possible", i)));
    }
    return {};
}

Result<void> checkNodes(const Store& store, uint64_t chunksEnd) {
    Before before;
    const uint64_t nodes = store.hierarchy.nodes.size();
    STIPPLE_TRY(checkTree(store.hierarchy, store.path, 0, nodes, chunksEnd, before));
    if (before.children != nodes) return tl::unexpected(damagedStore(store.path, "some nodes are nobody's children"));
    return {};
}

}  // namespace

Result<void> checkMaterials(const Store& store, const Chunk& chunk, const std::string& where) {
    uint32_t last = 0;
    for (const shared::MeshVertex& v : chunk.vertices) {
        const uint32_t material = v.surface & shared::kSurfaceMaterialMask;
        last = material > last ? material : last;
    }
    if (chunk.vertices.empty() || last < store.description.materials.size()) return {};
    return tl::unexpected(damagedStore(where, fmt::format("a vertex names material {}, which there is not", last)));
}

Result<void> checkTables(const Store& store, uint64_t chunksEnd) {
    const Hierarchy& h = store.hierarchy;
    const auto bad = [&](const char* what) { return tl::unexpected(damagedStore(store.path, what)); };
    if (!h.discFactors.empty() && !(h.smallestDisc > 0 && std::isfinite(h.smallestDisc)))
        return bad("the size of its discs is not possible");
    if (!(std::abs(glm::length(store.description.up) - 1) < 1e-6)) return bad("the up direction has not the length 1");
    if (!isPossibleSpace(store.hierarchy, store.description)) return bad("its coordinates are not possible");
    if (h.isCurves != store.description.isCurves) return bad("is not of the kind that it says it is");
    const bool isPoints = !h.isMixed && h.nodes[0].kind == Kind::points;
    if (h.isStochastic && !isPoints) return bad("holds stochastic points and something else");
    if (h.isGraph && (h.isMixed || h.groups.size() != h.nodes.size()))
        return bad("the groups of the mesh are not possible");
    if (!h.known.isWhole()) return checkTextures(store, chunksEnd);  // the rest page by page
    uint64_t groups = 0;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        h.forEachPayload(n, [&](uint32_t chunk) { groups += kindOf(h, chunk) == Kind::triangles ? 1 : 0; });
    if (groups != h.groups.size()) return bad("the groups of the mesh are not possible");
    STIPPLE_TRY(checkTextures(store, chunksEnd));
    STIPPLE_TRY(h.isGraph ? checkGroups(store, chunksEnd) : checkNodes(store, chunksEnd));
    return checkOverlaps(store);
}

Result<void> checkPage(const Hierarchy& h, const layout::Places& first, const layout::Places& end, uint32_t flags,
                       uint64_t chunksEnd, const std::string& path) {
    const auto bad = [&](const char* what) { return tl::unexpected(damagedStore(path, what)); };
    Overlaps overlaps;
    uint64_t groups = 0;
    for (uint64_t i = first.nodes; i < end.nodes; ++i) {
        const Node& n = h.nodes[i];
        const bool isPatches = n.kind == Kind::patches, hasPatches = (flags & layout::kTablePatches) != 0;
        if (!h.isMixed && (n.furtherPayloads > 0 || n.kind != h.nodes[0].kind))
            return bad("is not of the kind that it says it is");
        if (isPatches && !hasPatches) return bad("has patches and says that it has none");
        if (isPatches && n.isLeaf() && n.sourceCode == 0)
            return bad("a leaf of patches does not state its distance from the source");
        h.forEachPayload(static_cast<uint32_t>(i),
                         [&](uint32_t chunk) { groups += kindOf(h, chunk) == Kind::triangles ? 1 : 0; });
        overlaps.addNode(h, static_cast<uint32_t>(i));
    }
    if (groups != end.groups - first.groups) return bad("the groups of the mesh are not possible");
    for (uint64_t k = first.streams; k < end.streams; ++k) overlaps.add(h.streams[k].offset, h.streams[k].bytes);
    Before before{first.children, first.runs};
    STIPPLE_TRY(checkTree(h, path, first.nodes, end.nodes, chunksEnd, before));
    if (before.children != end.children || before.runs != end.runs) return bad("the pages of nodes are not possible");
    return overlaps.check(path);
}

Result<void> checkLight(const Hierarchy& h, uint64_t begin, uint64_t end, uint32_t version, const std::string& path) {
    if (version >= kLightVersion) return {};
    for (uint64_t i = begin; i < end; ++i) {
        bool hasLight = false;
        h.forEachPayload(static_cast<uint32_t>(i), [&](uint32_t chunk) {
            hasLight = hasLight || (h.payload(chunk).maps & shared::kMapLight) != 0;
        });
        if (hasLight)
            return tl::unexpected(damagedStore(
                path, fmt::format("node {} claims light of its patches' own, which files before version {} do not have",
                                  i, kLightVersion)));
    }
    return {};
}

bool isPossibleGroup(const Hierarchy& h, uint32_t chunk) {
    const Payload& p = h.payload(chunk);
    const MeshGroup& g = h.groups[p.group];
    const auto oneCode = [](const CodeCounts& c) { return c.lo == c.hi; };
    bool fits = h.rootLog2 <= kShortMeshBits && oneCode(p.parentCounts) && oneCode(p.ownCounts) &&
                p.errorCode == p.ownCounts.hi && g.parents == 0 && g.textures == 0 && g.runs > 0 && g.runs <= 8 &&
                uint64_t{g.firstRun} + g.runs <= h.runs.size();
    fits = fits && g.vertices <= uint64_t{g.clusters} * shared::kClusterVertices && g.clusters <= p.records &&
           p.records <= uint64_t{g.clusters} * shared::kClusterTriangles;
    uint64_t triangles = 0, clusters = 0;
    for (uint32_t r = 0, octants = 0; fits && r < g.runs; ++r) {
        const MeshRun& run = h.runs[g.firstRun + r];
        fits = run.firstCluster == clusters && run.producer < 8 && (octants >> run.producer & 1u) == 0;
        if (fits) octants |= 1u << run.producer;
        clusters += run.clusters;
        triangles += run.triangles;
    }
    return fits && triangles == p.records && clusters == g.clusters;
}

Result<void> checkSpace(const Hierarchy& h, const StoreDescription& d) {
    if (isPossibleSpace(h, d)) return {};
    double farthest = 0;
    for (const glm::dvec3& p : {d.boundsMin, d.boundsMax})
        for (int a = 0; a < 3; ++a) farthest = std::max(farthest, std::abs(p[a]));
    return fail(
        ErrorKind::input,
        farthest > kFarthest
            ? fmt::format("its coordinates reach {:.3g}: beyond {:.0e} distances are no numbers", farthest, kFarthest)
            : fmt::format("its coordinates cannot be computed with: steps of {:.3g} units", h.unit),
        d.source, "give it other units");
}

}  // namespace stipple::lod
