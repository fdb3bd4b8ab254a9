// A small forest for the tests: one tree that stands in many places, with proxies of it.
#pragma once

#include "lod/builder/stochastic/stochastic_build.h"
#include "tests/support/curves.h"

namespace stipple::test {

/// An oak of tubes and ribbons.
lod::CurveSet oak(uint64_t leaves, uint64_t seed = 1);

struct Forest {
    lod::CurveSet tree;
    lod::CurveSamples samples;
    std::vector<render::PlacedStore> placed;  ///< all of them members of the instance group
    std::vector<render::PlacedGroup> groups;
    std::shared_ptr<const lod::Store> curves, afar;
};
/// `side` x `side` trees, turned and scaled, 8 m apart, on a slope.
Forest plantForest(const std::string& folder, uint32_t side, Executor& executor);

}  // namespace stipple::test
