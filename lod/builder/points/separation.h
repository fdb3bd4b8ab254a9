// What is said of inputs that may not belong together.
#pragma once

#include <string>
#include <vector>

#include "lod/builder/points/outliers.h"

namespace stipple::lod {

struct PlacedInput {
    const SourceInfo* info = nullptr;
    Bounds bounds;  ///< of its points, file units
};

/// Notes on files without coordinate system beside others that name one, and on files that lie more than 1000 km from
/// the rest. `crs`: what is known of all, from the file at `crsPath`.
std::vector<std::string> separationNotes(const std::vector<PlacedInput>& inputs, const Crs& crs,
                                         const std::string& crsPath);

}  // namespace stipple::lod
