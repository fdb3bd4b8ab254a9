// One cell of a mesh build: clusters, their groups, and each group's simplification, level by level.
#pragma once

#include "lod/builder/mesh/mesh_build.h"
#include "lod/builder/mesh/mesh_work.h"
#include "lod/builder/octree/reduction.h"

namespace stipple::lod {

/// Welds and simplifies what is in a cell: the input of a subtree or what came up from below, until few enough
/// triangles are left to go up. Of the last cell nothing goes up; neither does what cannot be simplified and is too
/// much.
Result<CellProduct> reduceMeshCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame, const Lattice& lattice,
                                   const MeshBuildSettings& settings, Executor& executor);

/// A group in the order of the build: fine before coarse.
struct Group {
    static constexpr double kRootError = 1e300;
    static constexpr uint32_t kOwn = 0x80000000u;  ///< in a run's producer: a number within the cell
    Node node;
    MeshGroup counts;
    std::vector<MeshRun> runs;  ///< producers are numbers of the build's order
    std::vector<uint32_t> textures;
    double error = 0;  ///< lattice units
};

/// What a product's table holds.
struct CellTable {
    std::vector<Group> groups;
    uint64_t triangles = 0, duplicate = 0;  ///< of the input
    Steps lo{0}, hi{0};                     ///< of its vertices
    void put(ByteWriter& to) const;
    bool get(ByteReader& from);
};

}  // namespace stipple::lod
