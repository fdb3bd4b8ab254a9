#include "lod/import/ply_mesh.h"

namespace stipple::lod {

void smoothNormals(TriangleMesh& mesh) {
    std::vector<glm::dvec3> sum(mesh.position.size(), glm::dvec3(0));
    for (size_t i = 0; i + 3 <= mesh.indices.size(); i += 3) {
        const uint32_t a = mesh.indices[i], b = mesh.indices[i + 1], c = mesh.indices[i + 2];
        const glm::dvec3 n = glm::cross(mesh.position[b] - mesh.position[a], mesh.position[c] - mesh.position[a]);
        sum[a] += n;
        sum[b] += n;
        sum[c] += n;
    }
    mesh.normal.clear();
    for (const glm::dvec3& n : sum) {
        const double length = glm::length(n);
        mesh.normal.emplace_back(length > 0 ? n / length : glm::dvec3(0));
    }
}

}  // namespace stipple::lod
