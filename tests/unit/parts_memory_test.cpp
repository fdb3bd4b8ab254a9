// What looking for the small parts of a mesh allocates, against what the build says of it before.
#include <gtest/gtest.h>

#include <atomic>

#include "engine/base/rng.h"
#include "lod/builder/mesh/parts.h"
#include "tests/support/support.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kCounts = false;  // the sanitizer has its own allocator
std::atomic<size_t> live{0}, peak{0};
#else
constexpr bool kCounts = true;
extern std::atomic<size_t> live, peak;  // of hostile_test.cpp
#endif

namespace stipple::lod {
namespace {

/// Triangles that share nothing.
TriangleMesh separateTriangles(uint32_t count) {
    TriangleMesh mesh;
    Rng rng(5);
    for (uint32_t t = 0; t < count; ++t) {
        const glm::dvec3 at(rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(0, 1));
        mesh.position.insert(mesh.position.end(), {at, at + glm::dvec3(0.004, 0, 0), at + glm::dvec3(0, 0.004, 0.001)});
        mesh.indices.insert(mesh.indices.end(), {3 * t, 3 * t + 1, 3 * t + 2});
        mesh.normal.resize(mesh.position.size(), glm::vec3(0, 0, 1));
        mesh.surface.resize(mesh.position.size(), shared::kSurfaceFlat);
        mesh.uv.resize(mesh.position.size());
        mesh.colour.resize(mesh.position.size());
    }
    return mesh;
}

TEST(PartFinder, TakesNoMoreMemoryThanItCounts) {
    const auto executor = makeTbbExecutor(2);  // a block is placed beside the one that is looked at
    for (const uint32_t triangles : {70'000u, 300'000u, 700'000u})
        for (const bool isWide : {false, true}) {
            TriangleMesh mesh = separateTriangles(triangles);
            if (isWide) mesh.position[0] = glm::dvec3(1e9, 0, 0);
            const MeshSource source = sourceOf(std::move(mesh));
            const auto bounds = source.survey({});
            ASSERT_TRUE(bounds);
            const Lattice lattice = latticeOf(*bounds);
            ASSERT_EQ(lattice.isWide(), isWide);
            peak = live.load();
            const size_t before = live;
            PartFinder finder(lattice);
            ASSERT_TRUE(forPlacedBlocks(source, lattice, *executor, Placed::all, 0,
                                        [&](const PlacedBlock& block) -> Result<void> {
                                            EXPECT_TRUE(finder.add(block));
                                            return {};
                                        }));
            finder.finish(true);
            const uint64_t counted = PartFinder::memory(triangles, uint64_t{3} * triangles);
            printf("[ measured ] %u triangles: %.1f MiB, counted %.1f\n", triangles,
                   static_cast<double>(peak - before) * 0x1p-20, static_cast<double>(counted) * 0x1p-20);
            if (kCounts) {
                EXPECT_LE(peak - before, counted) << triangles;
                EXPECT_GE(peak - before, counted / 3) << triangles << ": far more than it takes";
            }
        }
}

}  // namespace
}  // namespace stipple::lod
