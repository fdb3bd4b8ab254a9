// Parts by union-find over positions, and their clusters.
#include "lod/builder/mesh/parts.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

#include "lod/builder/morton.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kNone = ~0u;

/// Path halving.
template <typename Parents>
uint32_t rootIn(Parents& parent, uint32_t of) {
    while (parent[of] != of) of = parent[of] = parent[parent[of]];
    return of;
}

template <typename Parents>
void unite(Parents& parent, uint32_t a, uint32_t b) {
    a = rootIn(parent, a);
    b = rootIn(parent, b);
    parent[std::max(a, b)] = std::min(a, b);
}

uint64_t mixed(const glm::ivec3& p) {
    const uint64_t h = (static_cast<uint64_t>(p.x) * 0x9e3779b97f4a7c15ull) ^
                       (static_cast<uint64_t>(p.y) * 0xc2b2ae3d27d4eb4full) ^
                       (static_cast<uint64_t>(p.z) * 0x165667b19e3779f9ull);
    return (h ^ h >> 29) * 0xbf58476d1ce4e5b9ull >> 20;
}

}  // namespace

void PartFinder::grow() {
    const size_t size = std::max<size_t>(1024, 2 * slots_.size());
    slots_ = {};  // before there is the larger one
    slots_.assign(size, kNone);
    for (uint32_t i = 0; i < positions_.size(); ++i) {
        size_t at = mixed(positions_[i]) & (slots_.size() - 1);
        while (slots_[at] != kNone) at = (at + 1) & (slots_.size() - 1);
        slots_[at] = i;
    }
}

uint32_t PartFinder::numberOf(const glm::ivec3& p) {
    if (3 * (positions_.size() + 1) > 2 * slots_.size()) grow();
    size_t at = mixed(p) & (slots_.size() - 1);
    for (; slots_[at] != kNone; at = (at + 1) & (slots_.size() - 1))
        if (positions_[slots_[at]] == p) return slots_[at];
    slots_[at] = static_cast<uint32_t>(positions_.size());
    parent_.push_back(slots_[at]);
    positions_.push_back(p);
    return slots_[at];
}

PartFinder::PartFinder(const Lattice& lattice) : isWide_(lattice.isWide()) {
    if (!isWide_) return;
    const glm::u64vec3 least = keyPlace(Steps(-kPartReach), lattice);
    nearest_ = {least.x, least.y, least.z};
    // The first position stands for all that are too far out: more triangles than a part has are theirs.
    parent_.push_back(0);
    positions_.emplace_back(std::numeric_limits<int>::min());
}

uint32_t PartFinder::numberAt(const LatticeVertices& vertices, uint32_t i) {
    const Steps p = vertices.at(i);
    if (isWide_ && glm::any(glm::greaterThan(glm::abs(p), Steps(kPartReach)))) return 0;
    return numberOf(glm::ivec3(p));
}

std::array<uint32_t, 3> PartFinder::shortCentre(const PlacedBlock& block, size_t t) const {
    const Place centre = block.centres().at(t);
    // (Of what lies too far out nothing is kept: it is no part.)
    const auto along = [&](size_t a) { return static_cast<uint32_t>(centre.at(a) - nearest_.at(a)); };
    return {along(0), along(1), along(2)};
}

bool PartFinder::add(const PlacedBlock& block) {
    const auto& indices = block.soup.indices;
    if (ofTriangle_.size() + indices.size() / 3 > kMostTriangles) return false;
    std::vector<uint32_t> number(block.soup.vertices.size(), kNone);
    for (const uint32_t i : indices) {
        if (number[i] == kNone) number[i] = numberAt(block.soup.vertices, i);
    }
    for (size_t t = 0; t < indices.size() / 3; ++t) {
        const uint32_t first = number[indices[3 * t]];
        unite(parent_, first, number[indices[3 * t + 1]]);
        unite(parent_, first, number[indices[3 * t + 2]]);
        ofTriangle_.push_back(first);
        centre_.push_back(shortCentre(block, t));
    }
    firstOfBlock_.push_back(ofTriangle_.size());
    return true;
}

void PartFinder::finish(bool isKnown) {
    if (!isKnown) *this = PartFinder();
    positions_ = {};
    slots_ = {};
    std::vector<uint32_t> triangles(parent_.size(), 0);
    for (uint32_t& t : ofTriangle_) ++triangles[t = rootIn(parent_, t)];
    // The place of a part is that of the centre that is first along the curve: no matter in which order they came.
    std::vector<uint32_t> part(parent_.size(), kNone);
    std::deque<std::array<uint32_t, 3>> places;
    const auto keyOf = [](const std::array<uint32_t, 3>& c) {
        return std::pair(shortMortonCode(c[0] >> 10, c[1] >> 10, c[2] >> 10), c);
    };
    for (size_t t = 0; t < ofTriangle_.size(); ++t) {
        const uint32_t root = ofTriangle_[t];
        if (triangles[root] > kPartTriangles || (isWide_ && root == 0)) {
            ofTriangle_[t] = kNone;
            continue;
        }
        if (part[root] == kNone) {
            part[root] = static_cast<uint32_t>(places.size());
            places.push_back(centre_[t]);
        }
        ofTriangle_[t] = part[root];
        if (keyOf(centre_[t]) < keyOf(places[part[root]])) places[part[root]] = centre_[t];
    }
    centre_ = std::move(places);
    parent_ = {};
}

bool PartFinder::place(PlacedBlock& placed, size_t block) const {
    if (firstOfBlock_.size() == 1) return true;  // of no triangle anything is known
    if (block + 1 >= firstOfBlock_.size()) return false;
    const size_t first = firstOfBlock_[block];
    if (placed.x.size() != firstOfBlock_[block + 1] - first) return false;
    for (size_t t = 0; t < placed.x.size(); ++t) {
        const uint32_t part = ofTriangle_[first + t];
        if (part == kNone) continue;
        Place centre = nearest_;
        for (size_t a = 0; a < 3; ++a) centre.at(a) += centre_[part].at(a);
        placed.x[t] = static_cast<uint32_t>(centre[0]);
        placed.y[t] = static_cast<uint32_t>(centre[1]);
        placed.z[t] = static_cast<uint32_t>(centre[2]);
        if (isWide_) placed.high[t] = highOf(centre);
        for (size_t k = 0; k < 3; ++k)
            placed.soup.vertices.low[placed.soup.indices[3 * t + k]].surface |= kSurfaceOfPart;
    }
    return true;
}

uint32_t partsOf(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& indices,
                 std::vector<uint32_t>& ofTriangle) {
    // Vertices of one position are one: each refers to the first of its position, found by hash.
    std::vector<uint32_t> parent(local.global.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto positionOf = [&](uint32_t v) { return mesh.position[local.global[local.beforeMove(v)]]; };
    std::vector<uint32_t> first(std::bit_ceil(2 * local.global.size() + 1), kNone);
    for (uint32_t v = 0; v < local.global.size(); ++v) {
        const uint32_t position = positionOf(v);
        size_t at = position * 0x9e3779b97f4a7c15ull >> 32 & (first.size() - 1);
        while (first[at] != kNone && positionOf(first[at]) != position) at = (at + 1) & (first.size() - 1);
        if (first[at] == kNone)
            first[at] = v;
        else
            unite(parent, first[at], v);
    }
    for (size_t i = 0; i < indices.size(); i += 3) {
        unite(parent, indices[i], indices[i + 1]);
        unite(parent, indices[i], indices[i + 2]);
    }
    std::vector<uint32_t> number(local.global.size(), kNone);
    ofTriangle.resize(indices.size() / 3);
    uint32_t parts = 0;
    for (size_t t = 0; t < ofTriangle.size(); ++t) {
        uint32_t& n = number[rootIn(parent, indices[3 * t])];
        if (n == kNone) n = parts++;
        ofTriangle[t] = n;
    }
    return parts;
}

void appendWholeClusters(const LocalMesh& local, const std::vector<std::vector<uint32_t>>& parts,
                         std::vector<Cluster>& out) {
    Cluster open;
    open.isWhole = true;
    size_t vertices = 0;
    const size_t mostVertices = local.isWide ? shared::kClusterVertices / 2 : shared::kClusterVertices;
    const auto close = [&] {
        if (!open.indices.empty()) out.push_back(open);
        open.indices.clear();
        vertices = 0;
    };
    for (const std::vector<uint32_t>& part : parts) {
        std::vector<uint32_t> used = part;
        std::sort(used.begin(), used.end());
        const auto own = static_cast<size_t>(std::unique(used.begin(), used.end()) - used.begin());
        if (open.indices.size() + part.size() > size_t{3} * shared::kClusterTriangles || vertices + own > mostVertices)
            close();
        if (part.size() <= size_t{3} * shared::kClusterTriangles && own <= mostVertices) {
            for (const uint32_t v : part) open.indices.push_back(local.global[v]);
            vertices += own;
            continue;
        }
        const size_t first = out.size();
        appendClusters(local, part, Triangles::any, out);
        for (size_t c = first; c < out.size(); ++c) {
            out[c].isWhole = true;
            out[c].isContinued = c > first;
        }
    }
    close();
}

std::vector<std::vector<uint32_t>> groupAll(const WeldedMesh& mesh, const std::vector<Cluster>& clusters, uint32_t size,
                                            Executor& executor) {
    std::vector<uint32_t> others;
    std::vector<std::vector<uint32_t>> groups;
    for (uint32_t c = 0; c < clusters.size(); ++c) {
        if (!clusters[c].isWhole) {
            others.push_back(c);
        } else {
            if (groups.empty() || (groups.back().size() >= size && !clusters[c].isContinued)) groups.emplace_back();
            groups.back().push_back(c);
        }
    }
    if (others.size() == clusters.size()) return groupApart(mesh, clusters, size, executor);
    if (others.empty()) return groups;
    std::vector<Cluster> rest;
    rest.reserve(others.size());
    for (const uint32_t c : others) rest.push_back(clusters[c]);
    for (auto& group : groupApart(mesh, rest, size, executor)) {
        for (uint32_t& c : group) c = others[c];
        groups.push_back(std::move(group));
    }
    return groups;
}

}  // namespace stipple::lod
