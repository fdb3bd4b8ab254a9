// Stores of the versions that this program reads, kept as bytes: they still open, are still true, and hold what they
// held when they were written. (tests/golden/stores; the number in a name is the version.)
#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "lod/primitives/kinds.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/layout.h"
#include "lod/store/surfel_weights.h"
#include "lod/verify/patches.h"
#include "tests/support/store_hash.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

struct Golden {
    const char* name;
    uint32_t version;
    Kind kind;
    size_t nodes;
    uint64_t records, table;  ///< hashes of what is decoded
};
constexpr std::array<Golden, 15> kGoldens{
    {{"points", 6, Kind::points, 11, 0x5303292940de763c, 0x20af3ef2c3f273ac},
     {"progressive", 6, Kind::points, 1, 0xa8c37fef9aee0c9f, 0x17357675d06252b0},
     {"curves", 6, Kind::curves, 29, 0xb99341d7983e2135, 0xf4bf98ee1b06cb81},
     {"triangles", 6, Kind::triangles, 4, 0xf237df112dffc251, 0xeddcb2f2903bb5dd},
     {"triangles", 7, Kind::triangles, 4, 0x5717fdad8f22f3ff, 0x20867ccfa0f04b85},
     // Those of before as this version has them, and what it alone has: nodes of several payloads.
     {"points", 8, Kind::points, 11, 0x5303292940de763c, 0x20af3ef2c3f273ac},
     {"progressive", 8, Kind::points, 1, 0xa8c37fef9aee0c9f, 0x17357675d06252b0},
     {"curves", 8, Kind::curves, 29, 0xb99341d7983e2135, 0xf4bf98ee1b06cb81},
     {"triangles", 8, Kind::triangles, 4, 0x5717fdad8f22f3ff, 0x20867ccfa0f04b85},
     {"mixed", 8, Kind::points, 5, 0x2e3c1d599b4d832e, 0x9c981823682b3036},
     {"points", 9, Kind::points, 49, 0x32465146638ea3da, 0xe56074fae192a5a1},
     // In pages of two nodes.
     {"points", 10, Kind::points, 49, 0x32465146638ea3da, 0xe56074fae192a5a1},
     {"mixed", 10, Kind::points, 5, 0x2e3c1d599b4d832e, 0x9c981823682b3036},
     // A sheet that shines, in 500 samples.
     {"patches", 11, Kind::patches, 6, 0x808b552dbfa71067, 0xa5fe686ad5f17229},
     // 260 points, with an overview.
     {"points", 12, Kind::points, 11, 0xe4590db10100ea74, 0x8fae41a72a564903}}};

std::string pathOf(const Golden& g) {
    return std::string(STIPPLE_SOURCE_DIR) + "/tests/golden/stores/" + g.name + "_" + std::to_string(g.version) +
           ".stipple";
}

TEST(StoreVersions, OldBytesOpenAndHoldWhatTheyHeld) {
    const auto executor = makeSerialExecutor();
    std::set<uint32_t> versions;
    for (const Golden& g : kGoldens) {
        SCOPED_TRACE(pathOf(g));
        const std::string bytes = test::slurp(pathOf(g));
        layout::Head head{};
        ASSERT_GT(bytes.size(), sizeof(head));
        std::memcpy(&head, bytes.data(), sizeof(head));
        ASSERT_EQ(head.version, g.version);
        versions.insert(head.version);
        const auto store = openStore(pathOf(g));
        ASSERT_TRUE(store) << store.error().line();
        EXPECT_EQ(kindOf(store->hierarchy, 0), g.kind);
        EXPECT_EQ(store->hierarchy.nodes.size(), g.nodes);
        EXPECT_EQ(test::hashRecords(*store), g.records);
        EXPECT_EQ(test::hashTable(*store), g.table);
        const auto report = verifyStore(*store, *executor);
        EXPECT_TRUE(report) << report.error().line();
    }
    // A new version comes with its own bytes.
    EXPECT_EQ(versions, (std::set<uint32_t>{kOldVersion, kOldWideMeshVersion, kVersionBefore, kUnpagedVersion,
                                            kStoreVersion, kLightVersion, kOverviewVersion}));
}

// What the two newest versions alone have is in those bytes.
TEST(StoreVersions, LightAndOverviewsAreKeptAsBytes) {
    const auto store = [](const char* name, uint32_t version) {
        return openStore(pathOf({name, version, Kind::points, 0, 0, 0}));
    };
    const auto lit = store("patches", kLightVersion), seen = store("points", kOverviewVersion);
    ASSERT_TRUE(lit && seen);
    const auto patches = readPatches(*lit, 0);
    ASSERT_TRUE(patches);
    size_t shining = 0;
    for (const Patch& p : *patches)
        for (const uint32_t light : p.map.light)
            shining += glm::length(emissionOf(light) - glm::vec3(2, 0.5f, 0)) < 0.05f;
    EXPECT_GT(shining, 0u);
    const Hierarchy& h = seen->hierarchy;
    EXPECT_EQ(h.nodes[0].records, 383u);
    EXPECT_GE(h.overviewOf(h.nodes[0]), 6u);
    EXPECT_EQ(readChunk(*seen, 0)->records.size(), h.ownRecordsOf(h.nodes[0]));
    EXPECT_EQ(readDrawnChunk(*seen, 0)->records.size(), h.nodes[0].records);
}

// Of build version 11: records know how far apart they lie, have weights, and name materials.
TEST(StoreVersions, WeightsAndMaterialsOfPointsStillOpen) {
    const auto store = openStore(std::string(STIPPLE_SOURCE_DIR) + "/tests/golden/stores/weighted_8.stipple");
    ASSERT_TRUE(store) << store.error().line();
    const auto executor = makeSerialExecutor();
    const auto report = verifyStore(*store, *executor);
    EXPECT_TRUE(report) << report.error().line();
    EXPECT_EQ(store->description.points, 300u);
    ASSERT_EQ(store->description.pointMaterials.size(), 244u) << "up to the last that is used";
    EXPECT_NEAR(double{store->description.pointMaterials[12].roughness}, 0.2, 1e-6);
    EXPECT_NEAR(double{store->description.pointMaterials[243].roughness}, 0.8, 1e-6);
    EXPECT_NE(store->hierarchy.nodes[0].spacingCode, 0);
    const Stream* const stream = weightsOf(store->hierarchy, 0);
    ASSERT_NE(stream, nullptr);
    const uint32_t records = store->hierarchy.nodes[0].records;
    const auto bytes = readStream(*store, 0, *stream);
    const auto weights = decodeWeights(bytes->data(), bytes->size(), records, "here");
    ASSERT_TRUE(weights);
    EXPECT_EQ(weights->size(), weightBytes(records));
}

// Negative control: the hashes see one changed record.
TEST(StoreVersions, TheHashesSeeAChange) {
    const auto a = openStore(pathOf(kGoldens[0])), b = openStore(pathOf(kGoldens[1]));
    ASSERT_TRUE(a && b);
    EXPECT_NE(test::hashRecords(*a), test::hashRecords(*b));
    Store changed = *a;
    changed.hierarchy.nodes[0].radius = std::nextafter(changed.hierarchy.nodes[0].radius, 1e9);
    EXPECT_NE(test::hashTable(changed), test::hashTable(*a));
}

}  // namespace
}  // namespace stipple::lod
