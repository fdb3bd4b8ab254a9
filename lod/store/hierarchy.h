// The node table of one store, in memory: plain arrays that selectCut walks. Lengths are lattice units (world = origin
// + unit * lattice); spheres are fp64 and nested, errors are codes of one file-wide scale.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "lod/primitives/mesh.h"
#include "lod/primitives/payload.h"
#include "lod/primitives/primitives.h"
#include "shaders/shared/curve.h"

namespace stipple::lod {

/// Errors are coded in 1/8 octaves: code 0 is exact, code c > 0 stands for smallest * 2^(c/8). 255 stands for "no
/// parent": larger than every error that a view may ask for.
struct ErrorScale {
    double smallest = 1;  ///< lattice units
    static constexpr uint32_t kNoParent = 255, kLargest = 254;
    double decode(uint32_t code) const { return smallest * kTimes[code]; }
    /// The smallest code whose value is at least `error`; kLargest if there is none.
    uint32_t encodeUp(double error) const {
        if (!(error > 0)) return 0;
        // From the exponent; the table has the last word.
        int octave = 0;
        const double mantissa = std::frexp(error / smallest, &octave);  // 1/2 to 1
        const double guess = std::clamp(8.0 * (octave - 1) + 8.0 * (2 * mantissa - 1), 1.0, double{kLargest});
        auto result = static_cast<uint32_t>(guess);
        while (result < kLargest && decode(result) < error) ++result;
        while (result > 1 && decode(result - 1) >= error) --result;
        return result;
    }

  private:
    static inline const std::array<double, 256> kTimes = [] {
        std::array<double, 256> times{};
        for (uint32_t c = 1; c < times.size(); ++c) times.at(c) = std::exp2(c / 8.0);
        return times;
    }();
};

/// A node, with the first of its payloads (most have no other; those that have: Hierarchy::further).
struct Node : Payload {
    glm::dvec3 centre{0};  ///< bounding sphere, lattice units; encloses all payloads and the spheres of the children
    double radius = 0;
    uint32_t parent = 0, firstChild = 0;  ///< children are contiguous, in octant order
    std::array<uint64_t, 3> cell{};       ///< index of the node's cell at its level
    uint8_t level = 0, childMask = 0;
    uint8_t furtherPayloads = 0;
    /// Of a leaf with patches: bound of the distance, either way, of what it draws from what it was built from, as an
    /// error code; 0: no such leaf. (Errors of coarser nodes are of that distance, too, and no less than a leaf's
    /// below.)
    uint8_t sourceCode = 0;
    uint32_t firstFurther = 0;    ///< into Hierarchy::further
    uint32_t normalCone = 0;      ///< axis, octahedral
    float normalConeCosine = -1;  ///< cosine of the half-angle; -1: all directions
    bool isLeaf() const { return childMask == 0; }
};

/// A payload that is not the first of its node.
struct FurtherPayload : Payload {
    uint32_t node = 0;
};

/// Which pages of a node table are there: all, or those that were read so far (pages.h), also while others look. A copy
/// has those that were there when it was made.
class KnownPages {
  public:
    KnownPages() = default;
    /// Of 2^log2Nodes nodes each; none is there.
    KnownPages(uint32_t log2Nodes, size_t pages) : log2Nodes_(log2Nodes), count_(pages) {
        if (pages > 0) isThere_ = std::make_unique<std::atomic<bool>[]>(pages);
    }
    KnownPages(const KnownPages& other) : KnownPages(other.log2Nodes_, other.count_) {
        for (size_t p = 0; p < count_; ++p) isThere_[p] = other.isThere(static_cast<uint32_t>(p));
    }
    KnownPages(KnownPages&&) = default;
    KnownPages& operator=(KnownPages other) {
        std::swap(isThere_, other.isThere_);
        log2Nodes_ = other.log2Nodes_;
        count_ = other.count_;
        return *this;
    }
    ~KnownPages() = default;

    /// Nothing is asked for page by page: all are there.
    bool isWhole() const { return count_ == 0; }
    size_t count() const { return count_; }
    uint32_t pageOf(uint32_t node) const { return node >> log2Nodes_; }
    bool isThere(uint32_t page) const { return isThere_[page].load(std::memory_order_acquire); }
    bool hasNode(uint32_t node) const { return isWhole() || isThere(pageOf(node)); }
    /// Of each page, for whoever reads them (pages.h): what was written before one is set is seen by those who find it.
    std::atomic<bool>* places() { return isThere_.get(); }

  private:
    std::unique_ptr<std::atomic<bool>[]> isThere_;
    uint32_t log2Nodes_ = 0;
    size_t count_ = 0;
};

struct Hierarchy {
    KnownPages known;       ///< first: a copy has of what follows at least what it says (nodes that are not: anything)
    glm::dvec3 origin{0};   ///< world position of lattice (0,0,0)
    double unit = 1;        ///< world units per lattice step
    uint32_t rootLog2 = 0;  ///< the root's cell has 2^rootLog2 lattice steps along each axis
    ErrorScale errors;
    std::vector<Node> nodes;              ///< breadth first; node 0 is the root
    std::vector<uint32_t> greaterThan;    ///< see CodeCounts
    std::vector<FurtherPayload> further;  ///< of the nodes that have several payloads, in the order of the nodes
    std::vector<Stream> streams;          ///< beside records and attributes
    /// Nodes are no octree but groups of triangles (lod/primitives/mesh.h), parents before children; `records` counts
    /// triangles and `errorCode` is what a view that does not refine the group would see; cells, children and counts
    /// are not used.
    bool isGraph = false;
    bool isMixed = false;  ///< payloads are of several kinds, or some nodes have several
    // Of payloads of triangles:
    std::vector<MeshGroup> groups;  ///< of a graph one a node
    std::vector<MeshRun> runs;
    std::vector<uint32_t> parents;
    std::vector<uint32_t> groupTextures;  ///< see MeshGroup
    std::vector<shared::TextureInfo> textures;
    std::vector<TextureTile> tiles;
    bool hasMaterials = false;      ///< points with attributes, and samples of patches, name materials (materials.h)
    bool isCurves = false;          ///< all records are segments of ribbons and tubes
    bool hasOneSourceCode = false;  ///< all leaves with patches have that of the worst: stores of build version 15
    bool isRigid = false;           ///< such that wind does not bend
    /// Records of a node are discs of one size, in an order in which any beginning shows the whole: n of them stand for
    /// all, sqrt(records / n) times as large. Error codes are those of the radius.
    bool isStochastic = false;
    uint8_t finestCode = 0;  ///< largest error code of a leaf of such a store
    /// Of such a store: discs of nominal radius smallestDisc * 2^(k/2) are drawn discFactors[k] times as large (so that
    /// they cover as much as what they stand for); between and beyond, the nearest do.
    std::vector<float> discFactors;
    double smallestDisc = 1;  ///< lattice units
    float discFactor(double radius) const {
        if (discFactors.empty()) return 1;
        const double last = static_cast<double>(discFactors.size() - 1);
        const double at = std::clamp(2 * std::log2(radius / smallestDisc), 0.0, last);
        const auto k = static_cast<size_t>(std::min(at, std::max(last - 1, 0.0)));
        const auto u = static_cast<float>(at - static_cast<double>(k));
        return discFactors[k] + u * (discFactors[std::min(k + 1, discFactors.size() - 1)] - discFactors[k]);
    }
    /// Cells of records reach beyond those of nodes: by half a cell on each side.
    bool hasOverlappingCells() const { return isCurves || isStochastic; }
    bool isMesh() const { return isGraph; }

    // A CHUNK is what is loaded at once: of node n its first payload is chunk n; then come the tiles of textures, then
    // the further payloads.
    size_t chunks() const { return nodes.size() + tiles.size() + further.size(); }
    bool isTile(uint32_t chunk) const { return chunk >= nodes.size() && chunk - nodes.size() < tiles.size(); }
    uint32_t chunkOfFurther(uint32_t k) const { return static_cast<uint32_t>(nodes.size() + tiles.size()) + k; }
    /// Of a chunk that is no tile.
    const Payload& payload(uint32_t chunk) const {
        if (chunk < nodes.size()) return nodes[chunk];
        return further[chunk - nodes.size() - tiles.size()];
    }
    uint32_t nodeOf(uint32_t chunk) const {
        return chunk < nodes.size() ? chunk : further[chunk - nodes.size() - tiles.size()].node;
    }
    /// Is what the table says of a node's children there? (First children and further payloads of unknown nodes are
    /// unknown, too: nobody asks for other chunks of theirs than that of the node's number.)
    bool hasChildrenOf(const Node& n) const {
        if (known.isWhole() || n.isLeaf()) return true;
        const uint32_t last = n.firstChild + static_cast<uint32_t>(__builtin_popcount(n.childMask)) - 1;
        for (uint32_t page = known.pageOf(n.firstChild); page <= known.pageOf(last); ++page)
            if (!known.isThere(page)) return false;
        return true;
    }
    /// Of a chunk that a cut wants.
    bool isUnknown(uint32_t chunk) const { return !known.isWhole() && chunk < nodes.size() && !known.hasNode(chunk); }
    /// Calls use(chunk) for every payload of a node.
    template <typename Use>
    void forEachPayload(uint32_t node, const Use& use) const {
        use(node);
        if (further.empty()) return;
        const Node& n = nodes[node];
        for (uint32_t k = 0; k < n.furtherPayloads; ++k) use(chunkOfFurther(n.firstFurther + k));
    }
    /// Largest own error of a node's payloads: what its children take away.
    uint32_t errorCodeOf(uint32_t node) const {
        uint32_t code = nodes[node].errorCode;
        if (!further.empty())
            forEachPayload(node, [&](uint32_t chunk) { code = std::max<uint32_t>(code, payload(chunk).errorCode); });
        return code;
    }

    /// Records with a code > `code`.
    uint32_t countGreater(const CodeCounts& c, uint32_t records, uint32_t code) const {
        if (code < c.lo) return records;
        return code >= c.hi ? 0u : greaterThan[c.first + (code - c.lo)];
    }
    /// Records of the OVERVIEW, which come first: levels of ever fewer records for all that a store of points holds, in
    /// the chunk of its root (lod/builder/points/overview.h). Their own codes are larger than the payload's errorCode,
    /// which is that of the others.
    uint32_t overviewOf(const Payload& p) const { return countGreater(p.ownCounts, p.records, p.errorCode); }
    /// Those that the node holds itself.
    uint32_t ownRecordsOf(const Payload& p) const { return p.records - overviewOf(p); }
    double cellSize(const Node& n) const { return std::exp2(static_cast<double>(rootLog2) - n.level); }
    /// Lattice position that record coordinate (0,0,0) stands for: the centre of the lattice steps that the
    /// first position step holds.
    glm::dvec3 recordOrigin(const Node& n) const { return recordOrigin(n, n); }
    glm::dvec3 recordOrigin(const Node& n, const Payload& p) const {
        if (hasOverlappingCells() || (isMixed && p.stepShift == static_cast<int>(rootLog2) - n.level - 15))
            return (glm::dvec3(n.cell[0], n.cell[1], n.cell[2]) - double{shared::kCurveMargin}) * cellSize(n);
        const double size = cellSize(n), half = p.stepShift > 0 ? 0.5 * (std::exp2(p.stepShift) - 1) : 0.0;
        return glm::dvec3(n.cell[0], n.cell[1], n.cell[2]) * size + glm::dvec3(half);
    }
};

}  // namespace stipple::lod
