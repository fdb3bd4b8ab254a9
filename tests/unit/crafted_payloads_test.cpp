// Tables of payloads that somebody wrote on purpose, every hash right: refused by name before memory is taken, or found
// by verification and drawn without harm.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/crafted_store.h"
#include "tests/support/mixed_store.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::layout::PayloadOnDisk;
using lod::layout::StreamOnDisk;
using test::CraftedStore;

class CraftedPayloads : public testing::Test {
  protected:
    // Payloads in the order of the file: the root's points and roof; points; triangles, tubes; triangles, points;
    // points, triangles, tubes.
    enum Place : size_t { rootPoints, roof, points, firstTriangles, firstTubes, lastTubes = 9 };
    void SetUp() override { test::writeMixedStore(folder_ / "mixed.stipple"); }
    CraftedStore take() const { return CraftedStore::read(folder_ / "mixed.stipple"); }
    void expectRefused(const CraftedStore& c, const std::string& text) const {
        const std::string path = folder_ / "crafted.stipple";
        c.write(path);
        const auto store = lod::openStore(path);
        ASSERT_FALSE(store) << text;
        EXPECT_EQ(store.error().kind, ErrorKind::input);
        EXPECT_NE(store.error().line().find(text), std::string::npos) << store.error().line();
    }
    void expectFound(const CraftedStore& c, const std::string& text) const {
        const std::string path = folder_ / "crafted.stipple";
        c.write(path);
        const auto store = lod::openStore(path);
        ASSERT_TRUE(store) << store.error().line();
        const auto executor = makeSerialExecutor();
        const auto verified = lod::verifyStore(*store, *executor);
        ASSERT_FALSE(verified) << text;
        EXPECT_NE(verified.error().line().find(text), std::string::npos) << verified.error().line();
        test::tryEverything(path);
    }
    template <typename T>
    static void put(CraftedStore& c, size_t at, const T& value) {
        std::memcpy(c.mesh.data() + at, &value, sizeof(value));
    }
    template <typename T>
    static T got(const CraftedStore& c, size_t at) {
        T value;
        std::memcpy(&value, c.mesh.data() + at, sizeof(value));
        return value;
    }
    test::TempFolder folder_;
};

TEST_F(CraftedPayloads, WhatIsOnlyWrittenAgainIsFine) {
    take().write(folder_ / "again.stipple");
    EXPECT_EQ(take().payloads.size(), lastTubes + 1u);
    EXPECT_EQ(take().streams.size(), lastTubes + 2u) << "one of a reserved id";
    EXPECT_TRUE(test::tryEverything(folder_ / "again.stipple"));
    const auto store = lod::openStore(folder_ / "again.stipple");
    const auto executor = makeSerialExecutor();
    EXPECT_TRUE(lod::verifyStore(*store, *executor));
}

TEST_F(CraftedPayloads, PlacesOutsideOfTheFileAreRefused) {
    for (const size_t place : {size_t{rootPoints}, size_t{roof}, size_t{lastTubes}})
        for (const uint64_t offset : {~uint64_t{0}, uint64_t{1} << 63, uint64_t{1} << 40}) {
            CraftedStore c = take();
            c.streamOf(place).offset = offset;
            expectRefused(c, "not possible");
        }
    for (const size_t place : {size_t{rootPoints}, size_t{roof}, size_t{lastTubes}}) {
        CraftedStore c = take();
        c.streamOf(place).bytes = ~0u;
        expectRefused(c, "not possible");
    }
    // Streams that nobody asks for, too.
    CraftedStore c = take();
    ASSERT_EQ(c.streams[1].id, static_cast<uint16_t>(lod::StreamId::spacingCode));
    c.streams[1].offset = ~uint64_t{0} - 4;
    expectRefused(c, "not possible");
}

TEST_F(CraftedPayloads, SpacingsThatAreNotThoseOfTheRecordsAreFound) {
    for (const size_t place : {size_t{rootPoints}, size_t{roof}}) {
        CraftedStore c = take();
        c.payloads[place].spacingCode = 255;
        expectFound(c, "steps apart");
    }
}

TEST_F(CraftedPayloads, KindsAndCodecsThatAreNotKnownAreNamed) {
    CraftedStore c = take();
    c.kinds[1] = {'v', 'o', 'x', 'e', 'l', 's'};
    expectRefused(c, "kind \"voxels\", which this program does not know");
    c = take();
    c.codecs[0] = {'l', 'a', 'z'};
    expectRefused(c, "codec \"laz\", which this program does not know");
    // A name is no message to the terminal.
    for (const char odd : {'\x1b', '\n', '\0', '\x80'}) {
        c = take();
        c.kinds[0] = {odd, 'x'};
        expectRefused(c, "a kind has no name");
    }
    c = take();
    c.codecs[0].fill('x');
    expectRefused(c, "a codec has no name");
    for (uint8_t PayloadOnDisk::*field : {&PayloadOnDisk::kind, &PayloadOnDisk::codec}) {
        c = take();
        c.payloads[roof].*field = 3;
        expectRefused(c, "not possible");
    }
    // Names may come in any order: by name they are the same store.
    c = take();
    std::swap(c.kinds[0], c.kinds[2]);
    for (PayloadOnDisk& p : c.payloads) p.kind = static_cast<uint8_t>(p.kind == 0 ? 2 : p.kind == 2 ? 0 : 1);
    c.write(folder_ / "order.stipple");
    const auto store = lod::openStore(folder_ / "order.stipple");
    ASSERT_TRUE(store) << store.error().line();
    EXPECT_EQ(store->hierarchy.nodes[0].kind, lod::Kind::points);
    // Records of one kind are not decoded as those of another.
    c = take();
    c.payloads[points].codec = 1;
    expectRefused(c, "not possible");
}

/// Backends find vertices, segments and texels behind weights only where there are none.
TEST_F(CraftedPayloads, WeightsOfOtherThanPointsAreRefused) {
    CraftedStore c = take();
    c.streams[1].id = static_cast<uint16_t>(lod::StreamId::surfelWeights);
    c.write(folder_ / "weighed.stipple");
    EXPECT_TRUE(lod::openStore(folder_ / "weighed.stipple")) << "the control: points may have them";
    --c.payloads[rootPoints].streams;
    ++c.payloads[roof].streams;
    std::swap(c.streams[1], c.streams[2]);
    ASSERT_EQ(c.streams[1].id, static_cast<uint16_t>(lod::StreamId::records));
    expectRefused(c, "not possible");
}

TEST_F(CraftedPayloads, MapsAreOfPatchesAlone) {
    for (const size_t place : {size_t{rootPoints}, size_t{roof}, size_t{lastTubes}}) {
        CraftedStore c = take();
        c.payloads[place].maps = 1;
        expectRefused(c, "not possible");
    }
}

TEST_F(CraftedPayloads, StreamsThatAreThereTwiceOrShareBytesAreRefused) {
    CraftedStore c = take();
    c.streams[1].id = static_cast<uint16_t>(lod::StreamId::records);
    expectRefused(c, "twice");
    c = take();  // no records at all
    c.streams[0].id = static_cast<uint16_t>(lod::StreamId::normals);
    expectRefused(c, "no records");
    c = take();  // attributes elsewhere than behind their records
    c.streams[1].id = static_cast<uint16_t>(lod::StreamId::attributes);
    c.streams[1].offset += 1;
    c.streams[1].bytes -= 1;
    expectRefused(c, "do not follow");
    // Two payloads in one place, or one byte into another.
    for (const uint64_t into : {0, 1}) {
        c = take();
        StreamOnDisk& other = c.streamOf(lastTubes);
        const StreamOnDisk from = c.streamOf(firstTubes);
        other.offset = from.offset + (into == 0 ? 0 : from.bytes - 1);
        other.bytes = from.bytes;
        expectRefused(c, "share the bytes");
    }
    c = take();  // as does one that nobody asks for
    c.streams[1].offset = c.streamOf(firstTubes).offset + 3;
    expectRefused(c, "share the bytes");
    // An id that this program does not know is none of its business.
    c = take();
    c.streams[1].id = 4711;
    c.write(folder_ / "new.stipple");
    EXPECT_TRUE(test::tryEverything(folder_ / "new.stipple"));
}

TEST_F(CraftedPayloads, CountsThatClaimGigabytesAreRefusedBeforeMemoryIsTaken) {
    for (const size_t place : {size_t{rootPoints}, size_t{roof}, size_t{points}, size_t{lastTubes}}) {
        CraftedStore c = take();
        size_t used = 0;
        for (size_t i = 0; i < place; ++i) used += c.payloads[i].parentCodes + c.payloads[i].ownCodes;
        c.payloads[place].records = c.counts[used].count = c.counts[used + 1].count = ~0u;
        expectRefused(c, "not possible");
    }
    for (uint64_t CraftedStore::*claim : {&CraftedStore::claimPayloads, &CraftedStore::claimStreams,
                                          &CraftedStore::claimKinds, &CraftedStore::claimRawPayloads})
        for (const uint64_t value : {uint64_t{11}, uint64_t{1} << 32, uint64_t{1} << 60, ~uint64_t{0}}) {
            CraftedStore c = take();
            c.*claim = value + 100;
            const std::string path = folder_ / "crafted.stipple";
            c.write(path);
            EXPECT_FALSE(lod::openStore(path)) << value;
        }
    CraftedStore c = take();
    c.payloads[roof].streams = uint16_t{0xffff};
    expectRefused(c, "not possible");
    // Names: 400 MB of them in some kilobytes.
    c = take();
    c.kinds.resize(size_t{17} << 20);
    expectRefused(c, "cannot come from");
    c = take();
    c.payloads[roof].parentCodes = ~0u;
    expectRefused(c, "code counts");
}

TEST_F(CraftedPayloads, NodesHaveFourAtMost) {
    CraftedStore c = take();
    c.nodes[0].furtherPayloads = 4;
    expectRefused(c, "more payloads than nodes have");
    for (const uint8_t count : {uint8_t{0}, uint8_t{2}, uint8_t{3}}) {  // they are the next one's
        c = take();
        c.nodes[0].furtherPayloads = count;
        expectRefused(c, "not possible");
    }
}

TEST_F(CraftedPayloads, StoresAreOfTheShapeTheySay) {
    CraftedStore c = take();
    c.head.isGraph = 1;
    expectRefused(c, "not possible");
    c.head.isGraph = 2;
    expectRefused(c, "not possible");
    // Cones would hide triangles and tubes.
    c = take();
    c.nodes[2].normalConeCosine = 0.5f;
    expectRefused(c, "node 2 of the node table is not possible");
    for (const size_t place : {size_t{rootPoints}, size_t{roof}, size_t{lastTubes}}) {
        c = take();
        c.payloads[place].stepShift = static_cast<int8_t>(c.payloads[place].stepShift + 1);
        expectRefused(c, "not possible");
    }
    c = take();
    for (const auto& [from, to] : {std::pair{"\"is_strands\":false", "\"is_strands\":true"},
                                   {"\"is_progressive\":false", "\"is_progressive\":true"}}) {
        c = take();
        const size_t at = c.description.find(from);
        ASSERT_NE(at, std::string::npos);
        c.description.replace(at, std::strlen(from), to);
        expectRefused(c, "");
    }
}

TEST_F(CraftedPayloads, GroupsOfOctreesAreTheirOwn) {
    using lod::MeshGroup;
    using lod::MeshRun;
    const auto refused = [&](auto change) {
        CraftedStore c = take();
        change(c);
        expectRefused(c, "not possible");
    };
    const auto group = [&](size_t k, auto change) {
        refused([&](CraftedStore& c) {
            const size_t at = c.groupsAt() + k * sizeof(MeshGroup);
            auto g = got<MeshGroup>(c, at);
            change(g);
            put(c, at, g);
        });
    };
    group(1, [](MeshGroup& g) { g.firstRun = 0; });  // another's
    group(1, [](MeshGroup& g) { g.firstRun = ~0u; });
    group(0, [](MeshGroup& g) { g.runs = ~0u; });
    group(0, [](MeshGroup& g) { g.runs = 0; });
    group(0, [](MeshGroup& g) { g.vertices = ~0u; });
    group(0, [](MeshGroup& g) { g.clusters = ~0u; });
    group(0, [](MeshGroup& g) { g.textures = 1; });
    group(0, [](MeshGroup& g) { g.parents = 1; });
    const auto run = [&](size_t k, auto change) {
        refused([&](CraftedStore& c) {
            const size_t at = c.runsAt() + k * sizeof(MeshRun);
            auto r = got<MeshRun>(c, at);
            change(r);
            put(c, at, r);
        });
    };
    run(0, [](MeshRun& r) { r.producer = 8; });
    run(0, [](MeshRun& r) { r.producer = MeshRun::kOriginal; });
    run(1, [](MeshRun& r) { r.producer = 0; });  // an octant of two runs
    run(1, [](MeshRun& r) { r.firstCluster = 0; });
    run(1, [](MeshRun& r) { r.triangles += 1; });
    run(1, [](MeshRun& r) { r.clusters = ~0u; });
    // Triangles of a payload have one error, and what they replace.
    refused([](CraftedStore& c) { c.payloads[roof].errorCode = 1; });
}

TEST_F(CraftedPayloads, WhatIsFalseOfOnePayloadIsFound) {
    // Points of the root say that they are as good as those below: then they were an overview, which mixed stores do
    // not have, nor nodes without anything below it.
    CraftedStore c = take();
    c.payloads[rootPoints].errorCode = 0;
    expectRefused(c, "not possible");
    // They say that they are worse than they are.
    c = take();
    ++c.payloads[rootPoints].errorCode;
    expectFound(c, "largest error");
    // The tubes lie elsewhere.
    const auto store = lod::openStore(folder_ / "mixed.stipple");
    const uint32_t tubes = store->hierarchy.chunkOfFurther(static_cast<uint32_t>(store->hierarchy.further.size()) - 1);
    auto chunk = lod::readChunk(*store, tubes);
    for (shared::CurveSegment& s : chunk->segments) s.a.positionZ |= 0x4000u << 16;  // radii of 2^65
    c = take();
    c.replaceChunk(lastTubes, test::encodeAgain(*chunk));
    expectFound(c, "reaches out of the bounding sphere");
    // A material that there is not.
    const uint32_t triangles = store->hierarchy.chunkOfFurther(0);
    chunk = lod::readChunk(*store, triangles);
    for (shared::MeshVertex& v : chunk->vertices) v.surface |= 77u;
    c = take();
    c.replaceChunk(roof, test::encodeAgain(*chunk));
    expectFound(c, "names material 77");
    // A vertex out of the node's sphere.
    chunk = lod::readChunk(*store, triangles);
    chunk->vertices[0].x = 1 << 29;
    c = take();
    c.replaceChunk(roof, test::encodeAgain(*chunk));
    expectFound(c, "a vertex reaches out");
}

}  // namespace
}  // namespace stipple
