// One job of the program that reads and writes OpenVDB files for the others: its request, its answer, and the columns
// in which places travel. Here stands no header of OpenVDB, which takes seconds to compile.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::vdb {

using Place = std::array<double, 3>;
using Direction = std::array<float, 3>;

/// What a .vdb file is asked for.
struct Request {
    std::string path;          ///< of the .vdb file
    std::string grid;          ///< one of its grids; empty: all that can be drawn
    std::string columns;       ///< where triangles or points go to, or come from
    uint64_t memoryBytes = 0;  ///< of this process
    double voxel = 0;          ///< to write: the edge of a voxel, in units; 0: of points, chosen by OpenVDB
    int threads = 0;           ///< 0: as many as there are cores
};

/// Triangles as PLY (positions in fp64, normals of the gradient), of all level sets. The answer says of each grid how
/// many they are and how far they lie from its zero crossing.
Result<nlohmann::json> levelSetsToTriangles(const Request& request);
/// A point on the zero crossing for each vertex of the triangles, with its normal, and a radius within which the next
/// ones are, so that the discs close the surface.
Result<nlohmann::json> levelSetsToSurfels(const Request& request);
/// The points of all point grids as PLY, with their attributes.
Result<nlohmann::json> pointGridsToPoints(const Request& request);
/// A level set of closed triangles. The answer says how far its zero crossing lies from them.
Result<nlohmann::json> trianglesToLevelSet(const Request& request, const nlohmann::json& layout);
/// A point grid.
Result<nlohmann::json> pointsToPointGrid(const Request& request, const nlohmann::json& layout);

}  // namespace stipple::vdb
