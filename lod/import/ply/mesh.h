// PLY as a mesh: vertices with faces (polygons) or triangle strips.
#pragma once

#include <memory>
#include <string>

#include "engine/base/byte_source.h"
#include "engine/base/result.h"
#include "lod/primitives/mesh_source.h"

namespace stipple::lod {

/// What a file declares beside its vertices: rows of the elements that have corners.
struct PlyFaces {
    uint64_t faces = 0;   ///< polygons
    uint64_t strips = 0;  ///< rows of triangle strips, each of any number of triangles
    bool any() const { return faces + strips > 0; }
};
/// None of a file that is no PLY.
Result<PlyFaces> plyFaces(const std::string& path);
Result<PlyFaces> plyFaces(const ByteSource& file);
/// Vertices in file units, two-sided; sRGB 200 where the file has no colours. Where it has no normals, faces that share
/// a vertex get smooth ones (the sum of the faces', weighted by area). Of the vertices `memoryBytes` are in memory, the
/// rest in a file in `tempFolder`; faces are read from the file as often as it takes.
Result<MeshSource> openPlyMesh(const std::string& path, uint64_t memoryBytes, const std::string& tempFolder);
Result<MeshSource> openPlyMesh(const std::shared_ptr<const ByteSource>& file, uint64_t memoryBytes,
                               const std::string& tempFolder);

}  // namespace stipple::lod
