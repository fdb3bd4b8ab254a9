// Reads every point of a source once, in parallel, and says what is there: to compare with what its header promises.
#pragma once

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

struct Survey {
    uint64_t points = 0, notFinite = 0, lostPoints = 0;
    glm::dvec3 least{0}, greatest{0};          ///< world units
    glm::ivec3 leastStep{0}, greatestStep{0};  ///< of sources on a lattice
    uint32_t colourMax = 0;                    ///< largest channel value, where colours have 16 bits
    std::vector<AttributeInfo> attributes;     ///< with least, greatest and counts filled in
    std::vector<std::string> problems;         ///< parts that could not be read
};

/// `source` must have been opened with the names of all `source.info.attributes` as ReadOptions::attributes.
Survey surveySource(const PointSource& source, Executor& executor, Progress& progress);

}  // namespace stipple::lod
