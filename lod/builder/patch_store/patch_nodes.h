// Nodes of a store of patches on their way to the file, and the tables that say what was written.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <span>
#include <vector>

#include "lod/builder/octree/assemble.h"
#include "lod/builder/patch_store/node_patches.h"

namespace stipple::lod {

/// What a product's table holds.
struct PatchTable {
    struct Points {            ///< of a node: what no patch stands for
        uint32_t node = 0;     ///< into the batch
        uint32_t isAlone = 0;  ///< the node has no patches
        uint32_t records = 0, bytes = 0;
        uint64_t offset = 0, hash = 0;
    };
    NodeBatch batch;                                 ///< parents' codes are not known
    std::vector<Points> points;                      ///< ascending
    uint64_t elements = 0, duplicate = 0, left = 0;  ///< triangles or points of the leaves
    uint64_t patches = 0, samples = 0, discs = 0;    ///< of the leaves; discs of what fits no patch
    std::array<uint8_t, 256> hasMaterial{};          ///< of each number: some sample has it
    double residual = 0;                             ///< of the leaves: see PatchNode, lattice units
    double beside = 0;   ///< of the leaves of scans: farthest that a place of a patch is from a point, lattice units
    Steps lo{0}, hi{0};  ///< of vertices or points, where there are elements
    void put(ByteWriter& to) const;
    bool get(ByteReader& from);
};

/// Of all tables of a build.
struct PatchSums {
    std::vector<PatchTable> tables;  ///< whose offsets are of the file
    PatchCounts counts;
    uint64_t kept = 0, duplicate = 0;  ///< triangles or points of the leaves
    std::array<uint8_t, 256> hasMaterial{};
    double residual = 0, beside = 0;  ///< as in PatchTable
    Steps lo{std::numeric_limits<int64_t>::max()}, hi{std::numeric_limits<int64_t>::min()};
    /// A table as `put` wrote it, of a product that begins at `at` in the file. How many there are then.
    uint64_t add(uint64_t at, const std::vector<uint8_t>& bytes);
};

/// Level of the subtree that the key lies in.
uint32_t levelOfOwner(const std::vector<Subtree>& subtrees, Key key);

/// A node; what its patches are made of goes with it or not.
struct PatchNode {
    Node node;
    Key key = 0;
    double surfaceError = 0;  ///< of what its patches are made of, bound of the distance from the source, lattice units
    double residual = 0;      ///< of a leaf: of its patches from the source
    double error = 0;         ///< of others: likewise; no less than any below
    double texturedArea = 0, texels = 0;  ///< of its triangles, those with textures: lattice units^2; of the source
};

PatchNode patchNodeAt(const Frame& frame, uint32_t level, Key key);
inline glm::dvec3 cornerOf(const Frame& frame, const Node& n) {
    return glm::dvec3(n.cell[0], n.cell[1], n.cell[2]) * frame.cellSize(n.level);
}
/// Says so for ever once `isStopped` has: what was cut short is never taken for whole, whoever asks next.
std::function<bool()> forGood(std::function<bool()> isStopped);

/// Samples that may be asked for, of so many triangles or points: no grid is so fine that there would be more.
inline uint64_t mostSamplesOf(uint64_t elements) {
    constexpr uint64_t kFewest = uint64_t{1} << 20, kEach = 256;
    return std::max(kFewest, kEach * elements);
}
/// As a bit of a mask of children.
inline uint8_t octantOf(const Node& n) {
    return static_cast<uint8_t>(1u << ((n.cell[0] & 1u) | (n.cell[1] & 1u) << 1 | (n.cell[2] & 1u) << 2));
}

/// Completes a node whose residual and error are those of `made`: its code and sphere. Appends it and its payloads to
/// the table. Changes `made.left` to what the file says of it; what that moves is added to the residual of leaves and
/// to the error of others. `children`: the nodes that are its children.
void writePatchNode(const Frame& frame, std::span<const Node> children, NodePatches& made, PatchNode& n,
                    PatchTable& table, std::vector<uint8_t>* patchBytes = nullptr);

/// The tree of all nodes of all tables, whose offsets are of the file: parents' codes are known then.
Hierarchy hierarchyOf(const Frame& frame, std::vector<PatchTable> tables);

}  // namespace stipple::lod
