// One cell of a curve build: nodes of the octree in it, their parts, and their chunks.
#pragma once

#include "lod/builder/curves/curve_division.h"
#include "lod/builder/curves/curve_work.h"
#include "lod/builder/octree/assemble.h"
#include "lod/builder/octree/reduction.h"

namespace stipple::lod {

/// What is asked of the steps of leaves.
struct Fineness {
    double stepsInDetail = 8;  ///< of what is visible of a segment
    double mostStep = 1e300;   ///< lattice units
    bool isCoarse(double step, double detail) const { return stepsInDetail * step > detail || step > mostStep; }
};

/// Builds a subtree, or joins those that came up from the octants of a cell. All nodes but the topmost are
/// encoded: that waits for its parent, as its order needs the parent's codes. `leafSegments`: cells with more are
/// divided, down to `frame.keyLevels`, and so are those that are too coarse for `fineness`.
Result<CellProduct> buildCurveCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame, uint32_t leafSegments,
                                   const Fineness& fineness, const CurveDivision& division);

/// Distance between places that a node with cells of this edge tells apart.
inline double curveStep(double cell) { return cell / 32768; }
/// What can be seen of a segment: its radius; of a very thin one how it lies.
inline double detailOf(double radius, double length) { return std::max(radius, length / 64); }

/// What a product's table holds.
struct CurveTable {
    NodeBatch batch;
    double rounding = 0;    ///< largest of a leaf's positions, lattice units
    double fewestKept = 1;  ///< of the root: share of the curves that it draws
    void put(ByteWriter& to) const;
    bool get(ByteReader& from);
};

}  // namespace stipple::lod
