// Weights of surfels for a store that is built.
#pragma once

#include <string>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct WeightReport {
    uint64_t surfels = 0, bytes = 0;  ///< of the streams
    uint64_t fileBytes = 0, contentHash = 0;
    double seconds = 0;
};

/// Measures the weight of every surfel of an octree of points within its level (measure.h), its neighbours' nodes
/// included, and writes the store again, whole or not at all, with a stream of them for every node. The same bytes for
/// any number of threads. Fails for stores of other kinds, and where weights are there already.
Result<WeightReport> addSurfelWeights(const std::string& path, Executor& executor, Progress& progress);

}  // namespace stipple::lod
