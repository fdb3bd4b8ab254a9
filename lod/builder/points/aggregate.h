// One coarse record from the finer ones in its cell.
#pragma once

#include <limits>

#include "lod/builder/points/levels.h"

namespace stipple::lod {

class Around;

/// Where the records of one inner node may lie.
struct RecordGrid {
    glm::dvec3 base{0};         ///< lattice position of coordinate 0
    double step = 1, edge = 1;  ///< lattice units a step, and of the node's cell; powers of two
    uint32_t clusterShift = 0;  ///< key bits below a cluster's cell
    uint32_t cellsAcross = 1;   ///< clusters along the node's edge
    uint32_t cellSteps = 1;     ///< steps of one cluster's cell
    ErrorScale errors;
};

/// Of a node: 64 clusters along its edge.
RecordGrid gridOf(const Frame& frame, const Node& node);

/// Code of the smallest radius >= `radius` at a node of this edge; but for 2e-7 relative, so that a decoded radius that
/// was rounded to fp32 gets its own code again.
uint32_t radiusCodeUp(double radius, double edge);
double radiusOf(uint32_t code, double edge);
/// The same of one radius after the other, of which many are equal.
class RadiusCodes {
  public:
    explicit RadiusCodes(double edge) : edge_(edge) {}
    uint32_t upOf(float radius) {
        if (radius != radius_) code_ = radiusCodeUp(static_cast<double>(radius), edge_);
        radius_ = radius;
        return code_;
    }

  private:
    double edge_;
    float radius_ = -1;
    uint32_t code_ = 0;
};

/// How far leaves' discs reach from a record's place, over and under the plane of its disc, and in every direction of
/// that plane at least (`inner`).
struct Extent {
    float reach = 0, inner = 0, above = 0, below = 0;
};
/// Of the leaves [begin, end), one at least; of a record without a normal only `reach`: that of their balls.
Extent extentOfLeaves(const Leaves& leaves, size_t begin, size_t end, const AggregateRecord& out);

/// Point i as a record that stands for itself.
AggregateRecord aggregateOfLeaf(const Points& points, size_t i, Key key);
/// Records in one cell whose normals lie in two cones, apart by more than 35 degrees: `side` says which one each
/// belongs to. False if there is one cone, or a record without a normal.
bool splitByNormals(std::span<const AggregateRecord> parts, std::vector<uint8_t>& side);
/// Into `out`, which is new. `parts`: records in one cluster's cell, in order. `leaves`: the points below them, where
/// they are at hand and all points of the cell are meant. `around`: what the disc is held against.
void mergeAggregates(const RecordGrid& grid, std::span<const AggregateRecord> parts, const Leaves* leaves,
                     const Around& around, AggregateRecord& out);
/// Where a disc is to lie, and how large it may be; of one that is not as its parts are, how it looks.
struct DiscWish {
    glm::dvec3 place{0};
    double mostRadius = std::numeric_limits<double>::infinity();
    glm::vec3 normal{0};
    bool isTwoSided = false;
    double extent = std::numeric_limits<double>::infinity();  ///< of all leaves, at most
};
/// The same as a disc of a normal that is given, whatever the parts have; its error counts what it leaves out.
void mergeAtFace(const RecordGrid& grid, std::span<const AggregateRecord> parts, const Around& around,
                 const DiscWish& wish, AggregateRecord& out);
/// The points [begin, end), which are all of a cluster's cell.
void mergeLeaves(const RecordGrid& grid, const Leaves& leaves, size_t begin, size_t end, const Around& around,
                 AggregateRecord& out);

}  // namespace stipple::lod
