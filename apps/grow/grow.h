// A simulated terrestrial laser scan of a small grove: ground, rocks, trees and a building, seen from several scanner
// positions with angular sampling, range noise and occlusion. Colour, no normals. Same options, same file.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::grow {

struct ScanOptions {
    uint64_t points = 1'000'000;
    uint64_t seed = 1;
    std::array<double, 3> origin{0, 0, 0};  ///< added to every coordinate, e.g. UTM or ECEF sized
    int positions = 4;                      ///< of the scanner
    double noiseMetres = 0.003;             ///< standard deviation along the ray
    int threads = 0, vectorBytes = 64;      ///< at most; 0 threads: all cores. The points are the same
};

struct ScanPoint {
    std::array<double, 3> position;  ///< metres, without the origin
    std::array<uint8_t, 3> colour;
};

/// About options.points points (a ray that meets nothing gives none; the angular step is set from a pilot scan).
std::vector<ScanPoint> growScan(const ScanOptions& options);

/// Can writeScan write to that name?
Result<void> checkScanPath(const std::string& path);
/// By extension: .las (1.2, point format 2, scale 0.001) or .ply (binary, double coordinates).
Result<void> writeScan(const std::string& path, const std::vector<ScanPoint>& points, const ScanOptions& options);

}  // namespace stipple::grow
