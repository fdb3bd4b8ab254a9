// Weights of surfels for a store that is built.
#pragma once

#include <functional>
#include <string>

#include "engine/base/executor.h"
#include "engine/base/process.h"
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
/// `to`: where it is written, if not where it was. `isStopped`: asked by any thread; true: nothing is written.
Result<WeightReport> addSurfelWeights(const std::string& path, Executor& executor, Progress& progress,
                                      const std::string& to = {},
                                      const std::function<bool()>& isStopped = isStopRequested);

}  // namespace stipple::lod
