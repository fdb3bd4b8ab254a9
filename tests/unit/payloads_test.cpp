// Nodes with several payloads: what a store of them says, what the cut has of them, how they are streamed and drawn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "lod/cut/frame.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"
#include "streaming/streamer.h"
#include "tests/support/mixed_store.h"
#include "tests/support/program.h"
#include "tests/support/store_hash.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::Kind;

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

class Payloads : public testing::Test {
  protected:
    void SetUp() override { test::writeMixedStore(folder_ / "mixed.stipple"); }
    std::shared_ptr<const lod::Store> open(const std::string& name) const {
        auto store = lod::openStore(folder_ / name);
        EXPECT_TRUE(store) << store.error().line();
        return std::make_shared<const lod::Store>(std::move(*store));
    }
    std::shared_ptr<const lod::Store> mixed() const { return open("mixed.stipple"); }
    /// A view from the side that sees all of the unit cube.
    static lod::View viewOf() {
        lod::View view;
        view.width = 320;
        view.height = 240;
        view.focalPixels = 300;
        view.eye = {0.5, -1.2, 1.1};
        const glm::dvec3 along = glm::dvec3(0.5, 0.5, 0.3) - view.eye;
        view.forward = glm::normalize(along);
        view.right = {1, 0, 0};
        view.down = glm::cross(view.forward, view.right);
        view.nearPlane = 1e-4;
        return view;
    }
    static render::FrameSettings settings(double tau, render::Mode mode = render::Mode::pullpush) {
        render::FrameSettings s;
        s.budgets.errorPixels = tau;
        s.mode = mode;
        s.wantDepthAndNormal = true;
        return s;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
};

TEST_F(Payloads, AStoreOfSeveralIsTrueAndSaysWhatItHas) {
    const auto store = mixed();
    const lod::Hierarchy& h = store->hierarchy;
    const auto kinds = test::mixedKinds();
    ASSERT_EQ(h.nodes.size(), kinds.size());
    EXPECT_TRUE(h.isMixed);
    EXPECT_FALSE(h.isGraph || h.isCurves);
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        std::vector<Kind> found;
        h.forEachPayload(n, [&](uint32_t chunk) {
            found.push_back(kindOf(h, chunk));
            EXPECT_EQ(h.nodeOf(chunk), n);
            const auto decoded = lod::readChunk(*store, chunk);
            ASSERT_TRUE(decoded) << decoded.error().line();
            EXPECT_EQ(decoded->sizeBytes(), lod::decodedBytes(h, chunk));
        });
        EXPECT_EQ(found, kinds[n]) << n;
    }
    const auto report = lod::verifyStore(*store, *executor_);
    ASSERT_TRUE(report) << report.error().line();
    EXPECT_EQ(report->payloads, h.chunks());
    EXPECT_EQ(report->errorsMeasured, 0u) << "errors across kinds are measured by nobody";
}

TEST_F(Payloads, StreamsAreFoundById) {
    const auto store = mixed();
    const auto stream = lod::findStream(store->hierarchy, 0, lod::StreamId::spacingCode);
    ASSERT_TRUE(stream);
    const auto bytes = lod::readStream(*store, 0, *stream);
    ASSERT_TRUE(bytes) << bytes.error().line();
    EXPECT_EQ(*bytes, test::mixedStream());
    EXPECT_FALSE(lod::findStream(store->hierarchy, 0, lod::StreamId::normals));
    EXPECT_FALSE(lod::findStream(store->hierarchy, 1, lod::StreamId::spacingCode));
    const auto records = lod::findStream(store->hierarchy, 0, lod::StreamId::records);
    ASSERT_TRUE(records);
    EXPECT_EQ(records->bytes, lod::chunkPlace(store->hierarchy, 0).bytes);
    // Damaged, it is found by those who read it, and by verify.
    std::string file = test::slurp(folder_ / "mixed.stipple");
    file[stream->offset] ^= 1;
    test::spit(folder_ / "bad.stipple", file);
    const auto bad = open("bad.stipple");
    EXPECT_FALSE(lod::readStream(*bad, 0, *stream));
    const auto verified = lod::verifyStore(*bad, *executor_);
    ASSERT_FALSE(verified);
    EXPECT_NE(verified.error().line().find("stream 6 of chunk 0"), std::string::npos) << verified.error().line();
}

TEST_F(Payloads, DrawnTogetherAsDrawnApart) {
    std::vector<render::PlacedStore> apart;
    for (const auto& [name, part] : {std::pair{"points", test::kMixedPoints},
                                     {"triangles", test::kMixedTriangles},
                                     {"curves", test::kMixedCurves}}) {
        test::writeMixedStore(folder_ / std::string(name), part);
        apart.push_back({open(name), {}, {}});
    }
    const std::vector<render::PlacedStore> together{{mixed(), {}, {}}};
    for (const auto& [name, backend] : test::cpuBackendsAndOracle(*executor_))
        for (const auto mode :
             {render::Mode::surface, render::Mode::pullpush, render::Mode::points, render::Mode::splat}) {
            SCOPED_TRACE(name + ", mode " + render::reconstructionOf(mode).name);
            FrameCounters one, three;
            const auto a = test::draw(together, *backend, *executor_, viewOf(), settings(0.25, mode), &one);
            const auto b = test::draw(apart, *backend, *executor_, viewOf(), settings(0.25, mode), &three);
            EXPECT_EQ(one.recordsDrawn, three.recordsDrawn);
            EXPECT_EQ(one.trianglesDrawn, three.trianglesDrawn);
            EXPECT_GT(one.trianglesDrawn, 500u);
            EXPECT_EQ(a.rgba, b.rgba);
            EXPECT_EQ(a.depth, b.depth);
        }
    // And the rays see the same leaves.
    const auto rays = reference::trace(together, viewOf(), {}, *executor_);
    const auto raysApart = reference::trace(apart, viewOf(), {}, *executor_);
    ASSERT_TRUE(rays && raysApart);
    EXPECT_EQ(rays->rgba, raysApart->rgba);
    EXPECT_EQ(rays->depth, raysApart->depth);
    // Each of them shows: without one the picture is another.
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto all = test::draw(apart, *backend, *executor_, viewOf(), settings(0.25));
    for (size_t k = 0; k < apart.size(); ++k) {
        auto some = apart;
        some.erase(some.begin() + static_cast<std::ptrdiff_t>(k));
        EXPECT_NE(test::draw(some, *backend, *executor_, viewOf(), settings(0.25)).rgba, all.rgba) << k;
    }
}

/// What each view has of a node is one thing: the root's records of an octant, or its child's.
TEST_F(Payloads, EveryOctantIsCoveredOnceWhateverIsResident) {
    const auto store = mixed();
    const lod::Hierarchy& h = store->hierarchy;
    const std::vector<const lod::Hierarchy*> hierarchies{&h};
    const std::vector<lod::Instance> instances(1);
    const lod::CutScene scene{hierarchies, instances, {}};
    Rng rng(5);
    int partly = 0;
    for (int round = 0; round < 300; ++round) {
        std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(h.chunks(), 1)};
        const uint64_t chance = 2 + rng.below(4);
        for (uint32_t c = 0; c < h.chunks(); ++c) drawable[0][c] = rng.below(chance) > 0 ? 1 : 0;
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::selectCut(scene, {drawable}, viewOf(), {0.25, kNoLimit}, scratch, cut);
        const auto isThere = [&](uint32_t node) {
            bool all = true;
            h.forEachPayload(node, [&](uint32_t c) { all = all && drawable[0][c] != 0; });
            return all;
        };
        std::map<uint32_t, std::set<uint32_t>> drawn;  // node -> octants that are drawn of it
        for (const lod::CutDraw& d : cut.draw)
            for (uint32_t o = 0; o < 4; ++o)
                if (d.node > 0 || (d.octantMask >> o & 1u)) drawn[d.node].insert(o);
        for (const lod::CutMeshDraw& d : cut.meshDraw)
            for (uint32_t r = 0; r < h.groups[h.payload(d.chunk).group].runs; ++r)
                if (const lod::MeshRun& run = h.runs[h.groups[h.payload(d.chunk).group].firstRun + r];
                    run.firstCluster == d.firstCluster)
                    EXPECT_TRUE(d.node > 0 || drawn[0].count(run.producer) == 1) << "roof and floor are drawn together";
        for (uint32_t n = 1; n < h.nodes.size(); ++n) {
            EXPECT_EQ(drawn.count(n), isThere(0) && isThere(n) ? 1u : 0u) << n;
            EXPECT_EQ(drawn[0].count(n - 1), isThere(0) && !isThere(n) ? 1u : 0u) << n;
            partly += isThere(0) && !isThere(n) ? 1 : 0;
        }
        // Every payload that is not there is wanted, and what is there is kept.
        EXPECT_EQ(cut.wanted.size() + cut.keep.size(), h.chunks());
        // What it costs is what is drawn.
        const lod::View view = viewOf();
        const lod::Residency residency{drawable};
        const lod::CutFrame frame{scene, residency, view, scratch};
        const int step = static_cast<int>(32 * std::log2(0.25));
        EXPECT_EQ(lod::shapeOf(h).cutCost(frame, 0, step, kNoLimit, lod::Counted::drawable, nullptr).records,
                  cut.counters.recordsDrawn + cut.counters.trianglesDrawn);
        EXPECT_EQ(cut.counters.nodesMissing > 0, !cut.wanted.empty());
    }
    EXPECT_GT(partly, 100);
}

TEST_F(Payloads, ErrorsAreThoseOfEachPayload) {
    const auto store = mixed();
    const lod::Hierarchy& h = store->hierarchy;
    const std::vector<const lod::Hierarchy*> hierarchies{&h};
    const std::vector<lod::Instance> instances(1);
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(h.chunks(), 1)};
    const uint32_t pointsCode = h.nodes[0].errorCode, roofCode = h.payload(h.chunkOfFurther(0)).errorCode;
    ASSERT_LT(pointsCode, roofCode);
    EXPECT_EQ(h.errorCodeOf(0), roofCode);
    lod::View view = viewOf();
    view.isOrthographic = true;
    // An orthographic view allows the same everywhere: between the two errors the floor stays coarse, and the roof
    // gives way.
    const auto pixelsOf = [&](uint32_t code) { return h.unit * h.errors.decode(code) * view.focalPixels; };
    const auto drawnAt = [&](double tau) {
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::selectCut({hierarchies, instances, {}}, {drawable}, view, {tau, kNoLimit}, scratch, cut);
        std::set<std::pair<uint32_t, Kind>> drawn;
        for (const lod::CutDraw& d : cut.draw) {
            drawn.emplace(std::min(d.node, 1u), kindOf(h, d.chunk));
            EXPECT_LE(double{d.errorPixels}, tau);
        }
        for (const lod::CutMeshDraw& d : cut.meshDraw) {
            drawn.emplace(std::min(d.node, 1u), kindOf(h, d.chunk));
            EXPECT_LE(double{d.errorPixels}, tau);
        }
        EXPECT_LE(cut.tauEffective, tau);
        EXPECT_EQ(cut.counters.trianglesDrawn > 0, !cut.meshDraw.empty());
        return drawn;
    };
    using Drawn = std::set<std::pair<uint32_t, Kind>>;
    EXPECT_EQ(drawnAt(1.2 * pixelsOf(roofCode)), (Drawn{{0, Kind::points}, {0, Kind::triangles}}));
    EXPECT_EQ(drawnAt(1.2 * pixelsOf(pointsCode)), (Drawn{{0, Kind::points}, {1, Kind::triangles}, {1, Kind::curves}}));
    EXPECT_EQ(drawnAt(0.5 * pixelsOf(pointsCode)), (Drawn{{1, Kind::points}, {1, Kind::triangles}, {1, Kind::curves}}));
}

class Sink final : public streaming::ChunkSink {
  public:
    explicit Sink(const lod::Hierarchy& h) : h_(h) {}
    ~Sink() override { EXPECT_TRUE(alive.empty()) << "chunks leaked"; }
    Result<void> upload(streaming::ChunkKey key, lod::Chunk chunk) override {
        EXPECT_TRUE(alive.insert(key.chunk).second);
        bytes += chunk.sizeBytes();
        most = std::max(most, bytes);
        return {};
    }
    void evict(streaming::ChunkKey key) override {
        EXPECT_EQ(alive.erase(key.chunk), 1u);
        bytes -= lod::decodedBytes(h_, key.chunk);
    }
    std::set<uint32_t> alive;
    uint64_t bytes = 0, most = 0;

  private:
    const lod::Hierarchy& h_;
};

TEST_F(Payloads, AreStreamedAndEvictedOneByOne) {
    const auto store = mixed();
    const lod::Hierarchy& h = store->hierarchy;
    uint64_t all = 0, rootBytes = 0;
    for (uint32_t c = 0; c < h.chunks(); ++c) {
        all += lod::decodedBytes(h, c);
        if (h.nodeOf(c) == 0) rootBytes += lod::decodedBytes(h, c);
    }
    const std::vector<const lod::Hierarchy*> hierarchies{&h};
    const std::vector<lod::Instance> instances(1);
    const uint64_t limit = rootBytes + (all - rootBytes) / 2;
    Sink sink(h);
    {
        streaming::StreamSettings settings;
        settings.residentBytes = limit;
        settings.requestsInFlight = 2;
        streaming::Streamer streamer(*executor_, sink, settings);
        streamer.addSource(h, store->file, store->path);
        lod::CutScratch scratch;
        lod::Cut cut;
        for (int frame = 0; frame < 60; ++frame) {
            streamer.collect();
            streamer.upload();
            lod::View view = viewOf();
            if (frame >= 30) {  // from the other side, near one quarter
                view.eye = {0.9, 0.9, 0.6};
                view.forward = {0, 0, -1};
                view.down = {0, -1, 0};
            }
            lod::selectCut({hierarchies, instances, {}}, streamer.residency(), view, {0.25, kNoLimit}, scratch, cut);
            streamer.request(cut);
            executor_->wait();
            EXPECT_LE(sink.bytes, limit);
            EXPECT_EQ(sink.bytes, streamer.counters().residentBytes);
            if (frame > 4)
                h.forEachPayload(0, [&](uint32_t c) { EXPECT_EQ(sink.alive.count(c), 1u) << "of the root"; });
        }
        EXPECT_GT(streamer.counters().refused + streamer.counters().evictions, 0u) << "otherwise it all fitted";
    }
    EXPECT_GT(sink.most, rootBytes);
}

TEST_F(Payloads, ThePlanHasNoNodeWithoutThoseAbove) {
    const auto store = mixed();
    const lod::Hierarchy& h = store->hierarchy;
    const std::vector<const lod::Hierarchy*> hierarchies{&h};
    const std::vector<lod::Instance> instances(1);
    uint64_t all = 0;
    for (uint32_t c = 0; c < h.chunks(); ++c) all += lod::decodedBytes(h, c);
    int partly = 0;
    for (uint64_t budget = 0; budget <= all; budget += all / 40) {
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::ResidentPlan plan;
        lod::planResident({hierarchies, instances, {}}, viewOf(), {0.25, kNoLimit}, budget, {}, scratch, cut, plan);
        uint64_t bytes = 0;
        for (uint32_t c = 0; c < h.chunks(); ++c) {
            if (!plan.chunks[0][c]) continue;
            bytes += lod::decodedBytes(h, c);
            if (h.nodeOf(c) > 0)
                h.forEachPayload(0, [&](uint32_t above) { EXPECT_EQ(plan.chunks[0][above], 1) << budget; });
        }
        EXPECT_EQ(bytes, plan.bytes);
        EXPECT_LE(bytes, budget);
        partly += bytes > 0 && bytes < all ? 1 : 0;
    }
    EXPECT_GT(partly, 5);
}

/// Old stores hold the same once they are written in this version.
TEST_F(Payloads, OldVersionsWrittenAgainHoldTheSame) {
    for (const char* name : {"points_6", "progressive_6", "curves_6", "triangles_6", "triangles_7"}) {
        SCOPED_TRACE(name);
        const auto old = lod::openStore(std::string(STIPPLE_SOURCE_DIR) + "/tests/golden/stores/" + name + ".stipple");
        ASSERT_TRUE(old) << old.error().line();
        auto writer = lod::StoreWriter::create(folder_ / name);
        ASSERT_TRUE(writer);
        lod::Hierarchy h = old->hierarchy;
        const auto copy = [&](uint64_t offset, size_t count) {
            std::vector<uint8_t> bytes(count);
            EXPECT_TRUE(old->file->readAt(offset, bytes.data(), count));
            return bytes;
        };
        for (lod::Node& n : h.nodes)
            ASSERT_TRUE(writer->appendChunk(copy(n.chunkOffset, n.chunkBytes),
                                            copy(n.chunkOffset + n.chunkBytes, n.attributeBytes), n));
        for (lod::TextureTile& t : h.tiles) t.offset = *writer->appendEncoded(copy(t.offset, t.bytes));
        ASSERT_TRUE(writer->finish(h, old->description));
        ASSERT_TRUE(writer->commit());
        const auto now = open(name);
        EXPECT_EQ(test::hashRecords(*now), test::hashRecords(*old));
        EXPECT_EQ(test::hashTable(*now), test::hashTable(*old));
        const auto verified = lod::verifyStore(*now, *executor_);
        EXPECT_TRUE(verified) << verified.error().line();
    }
}

TEST_F(Payloads, InfoSaysWhatAStoreHas) {
    const auto said = test::runProgram(folder_, "info mixed.stipple --verify --json");
    ASSERT_EQ(said.code, 0) << said.err;
    const auto json = nlohmann::json::parse(said.out);
    EXPECT_EQ(json.at("primitive"), "records");
    EXPECT_FALSE(json.at("errors_measured").get<bool>());
    const lod::Hierarchy& h = mixed()->hierarchy;
    uint64_t payloads = 0, records = 0;
    std::set<std::string> kinds;
    for (const auto& p : json.at("payloads")) {
        kinds.insert(p.at("kind").get<std::string>());
        EXPECT_EQ(p.at("codec").get<std::string>(), "meshopt-" + p.at("kind").get<std::string>());
        payloads += p.at("payloads").get<uint64_t>();
        records += p.at("records").get<uint64_t>();
        const auto streams = p.at("streams").get<std::vector<int>>();
        EXPECT_EQ(streams, p.at("kind") == "points" ? (std::vector{1, 6}) : std::vector{1});
    }
    EXPECT_EQ(kinds, (std::set<std::string>{"points", "curves", "triangles"}));
    EXPECT_EQ(payloads, h.chunks());
    EXPECT_EQ(records, json.at("records").get<uint64_t>());
    const auto text = test::runProgram(folder_, "info mixed.stipple --verify");
    EXPECT_NE(text.out.find("4 of triangles (meshopt-triangles): 608 records"), std::string::npos) << text.out;
    EXPECT_NE(text.out.find("errors across kinds are not measured"), std::string::npos) << text.out;
    // Of one kind there is nothing to list.
    test::writeMixedStore(folder_ / "points.stipple", test::kMixedPoints);
    const auto one = test::runProgram(folder_, "info points.stipple");
    EXPECT_EQ(one.out.find("payloads"), std::string::npos) << one.out;
    // What finds points says that there are other things.
    const auto at = test::runProgram(folder_, "info mixed.stipple --at 0,0,0");
    EXPECT_EQ(at.code, 2);
    EXPECT_NE(at.err.find("holds more than points"), std::string::npos) << at.err;
}

/// Names in files are for ever: each is another, and fits.
TEST(PayloadNames, AreDistinctAndFit) {
    std::set<std::string> names;
    for (size_t k = 0; k < lod::kKinds; ++k) names.insert(traitsOf(static_cast<Kind>(k)).name);
    EXPECT_EQ(names, (std::set<std::string>{"points", "curves", "triangles", "patches"}));
    std::set<std::string> codecs;
    for (size_t c = 0; c < lod::kCodecs; ++c) {
        const std::string name = traitsOf(static_cast<lod::Codec>(c)).name;
        EXPECT_LT(name.size(), 24u);
        codecs.insert(name);
    }
    EXPECT_EQ(codecs, (std::set<std::string>{"meshopt-points", "meshopt-curves", "meshopt-triangles", "patches"}));
}

}  // namespace
}  // namespace stipple
