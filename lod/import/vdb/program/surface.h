// The triangles of a level set, its zero crossing, and how far one lies from the other.
#pragma once

#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

#include <optional>
#include <vector>

#include "lod/import/vdb/program/grids.h"

namespace stipple::vdb {

/// Vertices in voxels of the (moved) grid; three corners a triangle, seen from outside against the clock.
struct Surface {
    std::vector<openvdb::Vec3s> vertices;
    std::vector<openvdb::Vec3I> triangles;
};
/// By OpenVDB's volumeToMesh without adaptivity: one vertex in each cell of eight voxels that the surface crosses, two
/// triangles for each edge between neighbours of either sign. Always the same.
Surface surfaceOf(const openvdb::FloatGrid& grid);

/// The level set between its voxels: trilinear.
class Field {
  public:
    explicit Field(const openvdb::FloatGrid& grid) : access_(grid.getConstAccessor()) {}
    double at(const openvdb::Vec3d& voxel) const { return openvdb::tools::BoxSampler::sample(access_, voxel); }
    /// By central differences over a voxel.
    openvdb::Vec3d gradient(const openvdb::Vec3d& voxel) const;
    /// A place of the zero crossing near `voxel`, found along the gradient; nothing where it leads nowhere within two
    /// voxels. How far it is bounds the distance from the zero crossing.
    std::optional<openvdb::Vec3d> crossing(const openvdb::Vec3d& voxel) const;

  private:
    openvdb::FloatGrid::ConstAccessor access_;
};

/// Calls `take` with the places, voxels, where the zero crossing meets the lines from `at` to its three next
/// neighbours.
template <typename Take>
void eachCrossing(const openvdb::FloatGrid::ConstAccessor& value, const openvdb::Coord& at, const Take& take) {
    const double here = value.getValue(at);
    for (int a = 0; a < 3; ++a) {
        openvdb::Coord next = at;
        ++next[a];
        const double there = value.getValue(next);
        if ((here < 0) == (there < 0) || !value.isValueOn(next)) continue;
        openvdb::Vec3d p = at.asVec3d();
        p[a] += here / (here - there);
        take(p);
    }
}

/// Distances between triangles and zero crossing, of places on either.
struct Deviation {
    uint64_t places = 0, unmeasured = 0;
    double mostUnits = 0, sumUnits = 0, mostVoxels = 0, sumVoxels = 0;
    void add(double units, double voxels);
};
/// Both ways: corners, middles of edges and of triangles from the zero crossing, and where it crosses the edges between
/// neighbouring voxels from the triangles. Of a large grid, of a part of its leaves spread over it.
Deviation measure(const LevelSet& set, const Surface& surface);

}  // namespace stipple::vdb
