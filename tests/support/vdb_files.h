// .vdb files as OpenVDB itself writes them, of shapes that are known. Here stands no header of OpenVDB.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace stipple::test {

/// A signed distance (or density) at a place of the world, as one grid.
struct VdbField {
    std::string name = "surface", gridClass = "level set";
    std::function<double(const glm::dvec3& world)> value;
    glm::dmat4 worldFromVoxel{1};
    glm::ivec3 least{0}, greatest{0};  ///< voxels that are looked at
    double band = 0;                   ///< values below it, either sign, are stored
    bool isDouble = false;
};
/// `hasCounts`: the file says how many voxels its grids have, as it does unless asked not to.
void writeVdb(const std::string& path, const std::vector<VdbField>& fields, bool hasCounts = true);

/// One grid of `edge`^3 voxels of one value, in a few kB.
void writeVdbBlock(const std::string& path, int edge, bool hasCounts);

/// A grid of vectors, which no reader here draws.
void writeVdbVectors(const std::string& path);

/// With attributes Cd (linear), N, pscale, intensity (float), class (int32).
struct VdbPoint {
    glm::dvec3 place;
    glm::vec3 colour, normal;
    float radius, intensity;
    int32_t category;
};
void writeVdbPoints(const std::string& path, const std::vector<VdbPoint>& points, double voxel,
                    const glm::dvec3& translation);

}  // namespace stipple::test
