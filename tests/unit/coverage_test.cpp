// What samples of curves cover, where one vertex lies far from all others.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/process.h"
#include "lod/builder/curves/curve_coverage.h"
#include "lod/primitives/curves.h"
#include "tests/support/curves.h"
#include "tests/support/runs.h"

namespace stipple {
namespace {

/// A tuft of leaves, and maybe one curve that ends `far` away.
lod::CurveSet tuft(double far) {
    lod::CurveSet set;
    Rng rng(5);
    for (int k = 0; k < 1500; ++k) {
        const glm::dvec3 at(rng.normal(), rng.normal(), rng.normal()), d(rng.normal(), rng.normal(), rng.normal());
        const glm::vec3 n(glm::normalize(glm::cross(d, glm::dvec3(rng.normal(), rng.normal(), rng.normal()))));
        set.addVertex(at, 0.02f, n, 0x30a030u);
        set.addVertex(at + 0.1 * glm::normalize(d), 0.02f, n, 0x30a030u);
        if (far > 0 && k == 700) set.addVertex({far, 0.3 * far, 0}, 0.02f, n, 0x30a030u);
        set.endCurve(true);
    }
    return lod::cleanCurves(std::move(set), 0);
}

/// Only of this process, whatever ran in it before.
void expectLittleMemory(uint64_t before) {
    if (!test::isSanitized) EXPECT_LE(peakRssBytes(), std::max(before, uint64_t{600} << 20));
}

TEST(CurveCoverage, AStrayVertexCostsNeitherTimeNorMemoryNorAccuracy) {
    const uint64_t before = peakRssBytes();
    const auto executor = makeTbbExecutor(2);
    const lod::CurveSet plain = tuft(0);
    const lod::CurveSamples samples = lod::sampleCurves(plain, 4096);
    const std::vector<float> wanted = lod::coverageFactors(plain, samples, *executor);
    for (const double far : {1e3, 3e3, 1e7}) {
        const lod::CurveSet stray = tuft(far);
        // The discs of the plant itself: those of a curve as long as this one would be another question.
        const double start = nowSeconds();
        const std::vector<float> factors = lod::coverageFactors(stray, samples, *executor);
        EXPECT_LT(nowSeconds() - start, 10 * test::kSlower) << far;
        ASSERT_EQ(factors.size(), wanted.size());
        for (size_t k = 0; k < factors.size(); ++k) EXPECT_NEAR(factors[k], wanted[k], 0.1f * wanted[k]) << far;
        // And those that the curve has, too.
        const lod::CurveSamples all = lod::sampleCurves(stray, 4096);
        const double again = nowSeconds();
        (void)lod::coverageFactors(stray, all, *executor);
        EXPECT_LT(nowSeconds() - again, 10 * test::kSlower) << far;
    }
    expectLittleMemory(before);
}

TEST(CurveCoverage, ThinCurvesFarApartTakeLittleMemory) {
    // Nothing is stray here; a grid of all pixels of the smallest discs would have 10^13.
    lod::CurveSet set;
    Rng rng(6);
    for (int k = 0; k < 1000; ++k) {
        const glm::dvec3 at(rng.uniform(0, 1e4), rng.uniform(0, 1e4), rng.uniform(0, 1e4));
        set.addVertex(at, 0.001f, glm::vec3(0), 0x30a030u);
        set.addVertex(at + glm::dvec3(0.1, 0.2, 0.1), 0.001f, glm::vec3(0), 0x30a030u);
        set.endCurve(false);
    }
    set = lod::cleanCurves(std::move(set), 0);
    const uint64_t before = peakRssBytes();
    const auto executor = makeTbbExecutor(2);
    const double start = nowSeconds();
    const auto factors = lod::coverageFactors(set, lod::sampleCurves(set, 4096), *executor);
    EXPECT_LT(nowSeconds() - start, 10 * test::kSlower);
    for (const float factor : factors) EXPECT_TRUE(factor >= 0.3f && factor <= 1.15f) << factor;
    expectLittleMemory(before);
}

}  // namespace
}  // namespace stipple
