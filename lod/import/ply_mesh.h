// PLY as a mesh: vertices with faces (polygons) or triangle strips.
#pragma once

#include <string>

#include "engine/base/result.h"
#include "lod/mesh.h"

namespace stipple::lod {

struct PlyMeshNotes {
    uint64_t badFaces = 0;  ///< triangles left out because a corner is no vertex
};

/// Has the file faces or strips? False for a file that is no PLY.
Result<bool> hasPlyFaces(const std::string& path);
/// Vertices in file units, two-sided. Where the file has no normals, faces that share a vertex get smooth ones.
Result<TriangleMesh> readPlyMesh(const std::string& path, PlyMeshNotes& notes);

/// Normals as the sum of the faces' (weighted by area) at each vertex.
void smoothNormals(TriangleMesh& mesh);

}  // namespace stipple::lod
