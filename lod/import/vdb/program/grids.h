// The grids of a file that are asked for, in memory, or why not.
#pragma once

#include <openvdb/openvdb.h>

#include <vector>

#include "lod/import/vdb/program/job.h"

namespace stipple::vdb {

/// A level set as floats.
struct LevelSet {
    std::string name;
    openvdb::FloatGrid::Ptr grid;  ///< its tree moved by -`shift`, its transform still that of the file
    openvdb::Vec3d shift{0};       ///< voxels: fp32 coordinates in voxels are fine near 0 only
    openvdb::Vec3d world(const openvdb::Vec3d& voxel) const { return grid->transform().indexToWorld(voxel + shift); }
};

/// Every level set of the file, or the named grid as one. Errors: what is there instead, by name; more voxels than
/// memory allows.
Result<std::vector<LevelSet>> readLevelSets(const Request& request);

/// A file whose points are all in `bytesEach` bytes or more, counted before they are read. Every point grid, or the
/// one named.
Result<std::vector<openvdb::GridBase::Ptr>> readPointGrids(const Request& request);

/// "takes about 4 GiB, but --memory allows 2 GiB".
tl::unexpected<Error> overBudget(const Request& request, const std::string& what, uint64_t bytes);

}  // namespace stipple::vdb
