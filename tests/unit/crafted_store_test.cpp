// Stores whose hashes are right and whose content is not: refused by name, or drawn without harm.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "tests/support/crafted_store.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::layout::NodeOnDisk;
using test::CraftedStore;

class Crafted : public testing::Test {
  protected:
    enum Kind { points, mesh, curves, afar, wide, mixed };
    static void SetUpTestSuite() {
        folder_ = new test::TempFolder;
        paths_ = test::smallStores(folder_->path());
    }
    static void TearDownTestSuite() {
        delete folder_;
        folder_ = nullptr;
    }
    static CraftedStore take(Kind kind) { return CraftedStore::read(paths_.at(kind)); }
    static lod::Store open(Kind kind) { return *lod::openStore(paths_.at(kind)); }
    std::string written(const CraftedStore& c) const {
        const std::string path = mine_ / "crafted.stipple";
        c.write(path);
        return path;
    }
    /// It is refused when it is opened, with `text` in the message.
    void expectRefused(const CraftedStore& c, const std::string& text) const {
        const auto store = lod::openStore(written(c));
        ASSERT_FALSE(store) << text;
        EXPECT_EQ(store.error().kind, ErrorKind::input);
        EXPECT_NE(store.error().line().find(text), std::string::npos) << store.error().line();
    }
    /// It is opened; decoding and verification find it, and drawing does no harm.
    void expectFound(const CraftedStore& c, const std::string& text) const {
        const std::string path = written(c);
        const auto store = lod::openStore(path);
        ASSERT_TRUE(store) << store.error().line();
        const auto verified = lod::verifyStore(*store, *executor_);
        ASSERT_FALSE(verified) << text;
        EXPECT_NE(verified.error().line().find(text), std::string::npos) << verified.error().line();
        test::tryEverything(path);
    }
    /// Changes the records of one node.
    template <typename Change>
    static CraftedStore withChunk(Kind kind, uint32_t node, const Change& change) {
        const lod::Store store = open(kind);
        auto chunk = lod::readChunk(store, node, true);
        change(*chunk);
        CraftedStore c = take(kind);
        c.replaceChunk(node, test::encodeAgain(*chunk));
        return c;
    }
    template <typename T>
    static void put(CraftedStore& c, size_t at, const T& value) {
        std::memcpy(c.mesh.data() + at, &value, sizeof(value));
    }
    static size_t innerNode(const CraftedStore& c) {
        size_t i = 0;
        while (c.nodes[i].childMask == 0) ++i;
        return i;
    }

    static test::TempFolder* folder_;
    static std::vector<std::string> paths_;
    test::TempFolder mine_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
};
test::TempFolder* Crafted::folder_ = nullptr;
std::vector<std::string> Crafted::paths_;

TEST_F(Crafted, WhatIsOnlyWrittenAgainIsFine) {
    for (const Kind kind : {points, mesh, curves, afar, wide, mixed}) {
        CraftedStore c = take(kind);
        const lod::Store store = open(kind);
        c.replaceChunk(0, test::encodeAgain(*lod::readDrawnChunk(store, 0, true)));
        const auto again = lod::openStore(written(c));
        ASSERT_TRUE(again) << again.error().line();
        const auto verified = lod::verifyStore(*again, *executor_);
        EXPECT_TRUE(verified) << verified.error().line();
        EXPECT_GT(again->hierarchy.nodes.size(), 3u) << kind;
    }
}

TEST_F(Crafted, NodesThatShareChildrenAreRefused) {
    for (const Kind kind : {points, curves, afar}) {
        CraftedStore c = take(kind);
        const size_t inner = innerNode(c);
        const auto children = static_cast<uint32_t>(__builtin_popcount(c.nodes[inner].childMask));
        // Each child of the first has the same children: that many to the power of the depth would be walked along.
        for (uint32_t k = 0; k < children; ++k) {
            NodeOnDisk& child = c.nodes[c.nodes[inner].firstChild + k];
            child.firstChild = c.nodes[inner].firstChild + children;
            child.childMask = c.nodes[inner].childMask;
        }
        expectRefused(c, "not possible");
        c = take(kind);
        c.nodes.back().parent = static_cast<uint32_t>(c.nodes.size() - 2);
        expectRefused(c, "not possible");
    }
}

TEST_F(Crafted, RecordsThatTheBytesCannotHoldAreRefusedBeforeMemoryIsTaken) {
    for (const Kind kind : {points, curves, afar, mesh, wide}) {
        CraftedStore c = take(kind);
        const uint32_t most = ~0u;
        size_t used = 0;
        for (size_t i = 0; i + 1 < c.payloads.size(); ++i) used += c.payloads[i].parentCodes + c.payloads[i].ownCodes;
        lod::layout::PayloadOnDisk& last = c.payloads.back();
        last.records = most;
        for (size_t k = 0; k < last.parentCodes + last.ownCodes; ++k) c.counts[used + k].count = 0;
        if (kind != mesh && kind != wide) c.counts[used].count = c.counts[used + last.parentCodes].count = most;
        expectRefused(c, "not possible");
    }
}

TEST_F(Crafted, WhatTheHeadClaimsIsCheckedBeforeMemoryIsTaken) {
    // 2^64 / sizeof(NodeOnDisk) nodes have a table whose length wraps round to one that fits.
    CraftedStore c = take(points);
    c.claimNodeCount = c.nodes.size() + (uint64_t{1} << 60);
    static_assert(sizeof(NodeOnDisk) % 16 == 0, "2^60 of them wrap to 0");
    expectRefused(c, "not possible");
    for (uint64_t CraftedStore::*claim :
         {&CraftedStore::claimRawNodes, &CraftedStore::claimRawCounts, &CraftedStore::claimRawDescription,
          &CraftedStore::claimRawMesh, &CraftedStore::claimRawPayloads, &CraftedStore::claimPayloads,
          &CraftedStore::claimStreams, &CraftedStore::claimKinds})
        for (const uint64_t bytes : {uint64_t{13} << 30, uint64_t{1} << 62}) {
            c = take(mesh);
            c.*claim = bytes;
            EXPECT_FALSE(lod::openStore(written(c)));
        }
    // A section that really is that large once it is decompressed: 400 MB of zeros in some kilobytes.
    c = take(mesh);
    c.mesh.resize(size_t{400} << 20);
    expectRefused(c, "cannot come from");
    c = take(points);
    c.description = std::string(size_t{130} << 20, '[');
    expectRefused(c, "cannot come from");
    c.description = std::string(size_t{1} << 20, '[');
    expectRefused(c, "description");
    c.description = "[" + std::string(size_t{20} << 20, ',') + "]";
    expectRefused(c, "description");
}

TEST_F(Crafted, NumbersThatAreNoneAreRefused) {
    for (const double odd : {std::numeric_limits<double>::infinity(), std::nan(""), 1e300, -1e300}) {
        CraftedStore c = take(points);
        c.head.origin[1] = odd;
        expectRefused(c, "not possible");
        c = take(points);
        c.head.unit = odd;
        expectRefused(c, "not possible");
        c = take(points);
        c.nodes[1].sphere[2] = odd;
        expectRefused(c, "node 1");
        c = take(mesh);
        c.nodes[1].sphere[3] = odd;
        expectRefused(c, "group 1");
        c = take(points);
        c.head.smallestError = odd;
        expectRefused(c, "not possible");
    }
    for (const auto& [key, value, text] :
         {std::tuple{"\"roughness\":", "1e308", "too large"}, std::tuple{"\"base_colour\":[", "1e20", "not possible"},
          std::tuple{"\"max\":[", "1e308", "not possible"}, std::tuple{"\"texture\":", "1e308", "whole number"},
          std::tuple{"\"points\":", "-3", "whole number"}}) {
        CraftedStore c = take(mesh);
        const size_t at = c.description.find(key) + std::strlen(key);
        c.description.replace(at, c.description.find_first_of(",]}", at) - at, value);
        expectRefused(c, text);
    }
}

TEST_F(Crafted, VerticesNameMaterialsAndPlacesThatThereAre) {
    const auto first = [](auto change) {
        return [change](lod::Chunk& chunk) {
            for (shared::MeshVertex& v : chunk.vertices) change(v);
        };
    };
    const std::string text = "a vertex lies nowhere";
    expectFound(withChunk(mesh, 0, first([](shared::MeshVertex& v) { v.surface |= 0xffffu; })), "names material 65535");
    expectFound(withChunk(mesh, 0, first([](shared::MeshVertex& v) { v.u = std::numeric_limits<float>::infinity(); })),
                text);
    expectFound(withChunk(mesh, 0, first([](shared::MeshVertex& v) { v.v = std::nanf(""); })), text);
    // Beyond the lattice differences of coordinates overflow.
    for (const int odd : {std::numeric_limits<int>::min(), std::numeric_limits<int>::max(), -1, (1 << 30) + 1})
        expectFound(withChunk(mesh, 0, first([odd](shared::MeshVertex& v) { v.x = odd; })), text);
}

/// The first group of the wide mesh with pairs, or with an origin of its own and none.
uint32_t wideGroup(const lod::Store& store, bool hasPairs) {
    const auto& nodes = store.hierarchy.nodes;
    const auto found = std::find_if(nodes.begin(), nodes.end(), [&](const lod::Node& n) {
        return hasPairs ? n.stepShift == 1 : n.stepShift == 0 && (n.cell[0] | n.cell[1] | n.cell[2]) != 0;
    });
    if (found == nodes.end()) throw std::runtime_error("the wide mesh has not every kind of group");
    return static_cast<uint32_t>(found - nodes.begin());
}

TEST_F(Crafted, GroupsOfWideMeshesLieOnTheirLattice) {
    const lod::Store store = open(wide);
    ASSERT_EQ(store.hierarchy.rootLog2, 62u);
    const uint32_t counted = wideGroup(store, false), paired = wideGroup(store, true);
    for (const int odd : {std::numeric_limits<int>::min(), std::numeric_limits<int>::max(), (1 << 30) + 1}) {
        const auto move = [odd](lod::Chunk& chunk) { chunk.vertices.back().y = odd; };
        expectFound(withChunk(wide, counted, move), "a vertex lies nowhere");
        // The last vertex of a cluster of pairs is an upper half.
        expectFound(withChunk(wide, paired, move), "points outside its chunk");
    }
    const std::string text = "group " + std::to_string(counted);
    for (const int8_t shift : {int8_t{2}, int8_t{-1}, int8_t{127}}) {
        CraftedStore c = take(wide);
        c.payloads[counted].stepShift = shift;
        expectRefused(c, text);
    }
    // Vertices are pairs or are none: read as the other they lie outside of the group's sphere or their cluster.
    for (const uint32_t group : {counted, paired}) {
        CraftedStore c = take(wide);
        c.payloads[group].stepShift = static_cast<int8_t>(1 - c.payloads[group].stepShift);
        const std::string path = written(c);
        const auto opened = lod::openStore(path);
        EXPECT_FALSE(opened && lod::verifyStore(*opened, *executor_)) << group;
        test::tryEverything(path);
    }
    for (const uint32_t far : {0x7fffffffu, 0x80000000u, ~0u, 1u << 20}) {
        CraftedStore c = take(wide);
        c.nodes[counted].cell[1] = far;
        const std::string path = written(c);
        const auto opened = lod::openStore(path);
        EXPECT_FALSE(opened && lod::verifyStore(*opened, *executor_)) << far;
        test::tryEverything(path);
    }
}

/// The cut leaves out what faces away by its cone (facesAway): nothing holds a group's to its triangles.
TEST_F(Crafted, GroupsOfMeshesHaveNoConesOfNormals) {
    for (const Kind kind : {mesh, wide})
        for (const size_t group : {size_t{0}, take(kind).nodes.size() - 1}) {
            CraftedStore c = take(kind);
            c.nodes[group].normalConeCosine = 0.9f;
            expectFound(c, "cone of normals");
        }
}

TEST_F(Crafted, TextureCoordinatesThatAreHugeDoNoHarm) {
    for (const float huge : {3e38f, -3e38f, 1e20f}) {
        const CraftedStore c = withChunk(mesh, 0, [&](lod::Chunk& chunk) {
            for (shared::MeshVertex& v : chunk.vertices) v.u = huge;
        });
        EXPECT_TRUE(test::tryEverything(written(c)));
    }
}

TEST_F(Crafted, RadiiOfSegmentsAreNumbers) {
    expectFound(withChunk(curves, 0,
                          [](lod::Chunk& chunk) {
                              for (shared::CurveSegment& s : chunk.segments) s.a.positionZ |= 0x7fffu << 16;
                          }),
                "a radius that is no number");
}

TEST_F(Crafted, RunsOfGroupsAreTheirOwn) {
    CraftedStore c = take(mesh);
    const lod::Store store = open(mesh);
    // The last group as a copy of the one before, runs and chunk included: all of them could be walked along by each.
    const size_t last = c.nodes.size() - 1;
    lod::MeshGroup group = store.hierarchy.groups[last];
    const lod::MeshGroup& before = store.hierarchy.groups[last - 1];
    group.firstRun = before.firstRun;
    group.runs = before.runs;
    group.vertices = before.vertices;
    group.clusters = before.clusters;
    put(c, c.groupsAt() + last * sizeof(group), group);
    c.payloads[last].records = c.payloads[last - 1].records;
    c.streamOf(last) = c.streamOf(last - 1);
    expectRefused(c, "group " + std::to_string(last));
    c = take(mesh);
    group = store.hierarchy.groups[0];
    group.clusters += 1u << 20;
    group.vertices = ~0u;
    put(c, c.groupsAt(), group);
    expectRefused(c, "group 0");
}

/// Any fields of any store, seeded. What is opened is drawn by both backends, and verified, at once and without harm.
TEST_F(Crafted, AnyChangedFieldIsRefusedOrDrawnInTime) {
    int opened = 0;
    for (const Kind kind : {points, mesh, curves, afar, wide, mixed}) {
        const CraftedStore whole = take(kind);
        const lod::Store store = open(kind);
        for (uint64_t seed = 0; seed < 150; ++seed) {
            Rng rng(1000 * kind + seed);
            CraftedStore c = whole;
            const std::string what = test::mutate(c, store, [&](uint64_t below) { return rng.below(below); });
            SCOPED_TRACE("kind " + std::to_string(kind) + ", seed " + std::to_string(seed) + ":" + what);
            const auto start = std::chrono::steady_clock::now();
            opened += test::tryEverything(written(c)) ? 1 : 0;
            const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
            EXPECT_LT(seconds.count(), 20 * test::kSlower);
        }
    }
    EXPECT_GT(opened, 100) << "otherwise nothing was tried";
}

}  // namespace
}  // namespace stipple
