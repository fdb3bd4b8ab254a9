// One build of a stochastic store: from samples that stand in many places to a verified file.
#pragma once

#include <string>
#include <vector>

#include "lod/builder/build.h"
#include "lod/builder/curves/curve_samples.h"
#include "lod/cut/cut.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// The first `count` of some samples (larger discs then), in some place. `centre` and `reach`: a sphere round all of
/// them, before they are placed.
struct StochasticItem {
    const CurveSamples* samples = nullptr;
    uint32_t count = 0;
    Instance place;
    glm::dvec3 centre{0};
    double reach = 0;
};

struct StochasticSettings {
    uint32_t nodeRecords = 8192;  ///< of a node that shows several items
    StoreDescription description;
};

/// Of one radius, for all radii that a store draws: StoreDescription::discFactors of models that stand in many places.
struct DiscFactors {
    std::vector<float> factors;  ///< from coverageFactors
    double radius = 0;           ///< of the first of them
    double weight = 1;           ///< area of all places
};
void describeDiscs(const std::vector<DiscFactors>& models, StoreDescription& description);

/// Writes `output` (whole or not at all): an octree of the items' centres, whose leaves hold the samples of their items
/// and whose inner nodes a share of those of their children, larger. The same input gives the same bytes.
Result<BuildReport> buildStochasticStore(const std::vector<StochasticItem>& items, const std::string& output,
                                         const StochasticSettings& settings, Executor& executor, Progress& progress);

/// The leaf of a stochastic store that shows an item with this centre (placed, world units).
uint32_t leafOf(const Hierarchy& h, const glm::dvec3& centre);

}  // namespace stipple::lod
