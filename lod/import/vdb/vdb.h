// OpenVDB (.vdb): level sets as triangles or as discs, point grids as points; and out again. The row of the table of
// formats (formats.h) says what each function is for.
#pragma once

#include "lod/import/formats.h"

namespace stipple::lod {

/// Points of point grids; of a file without any (or of a level set that is named) a disc for each cell of eight voxels
/// that the surface crosses, on it, with a radius at which they close it. World space, fp64.
Result<PointSource> openVdbPoints(const std::string& path, const ReadOptions& options, const FormatOptions& more);
/// Does it have level sets, and are not only points wanted? Refuses by name what is not drawn.
Result<bool> vdbHasMesh(const std::string& path, const FormatOptions& more);
/// All level sets (or the named one) as triangles with the normals of their gradient; notes say of each how far they
/// lie from its zero crossing, in units and voxels.
Result<OpenedMesh> openVdbMesh(const std::string& path, const FormatOptions& more);
Result<std::vector<FilePart>> describeVdb(const std::string& path, bool isWhole, const FormatOptions& more);

/// A point grid: positions to 2^-24 of a voxel, colours as linear `Cd`, normals `N`, radii `pscale`, attributes by
/// name.
Result<WriteReport> writeVdbPoints(const PointSource& points, const std::string& path, double voxel,
                                   const FormatOptions& more);
/// A level set three voxels to both sides of closed triangles, with the measured distance between both.
Result<WriteReport> writeVdbMesh(const MeshSource& triangles, const std::string& path, double voxel,
                                 const FormatOptions& more);

}  // namespace stipple::lod
