#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "lod/primitives/kinds.h"
#include "streaming/streamer.h"
#include "tests/support/mode_checks.h"
#include "tests/support/support.h"

namespace stipple::streaming {
namespace {

/// Counts what is alive and checks that nothing is uploaded or evicted twice.
class CountingSink final : public ChunkSink {
  public:
    ~CountingSink() override { EXPECT_EQ(alive.size(), 0u) << "chunks leaked"; }
    Result<void> upload(ChunkKey key, lod::Chunk chunk) override {
        if (refuse) return fail(ErrorKind::budget, "no room in the sink");
        EXPECT_TRUE(alive.insert({key.source, key.chunk}).second);
        if (onUpload) onUpload(key);
        bytes += chunk.sizeBytes();
        most = std::max(most, bytes);
        sizes[{key.source, key.chunk}] = chunk.sizeBytes();
        return {};
    }
    void evict(ChunkKey key) override {
        if (onEvict) onEvict(key);
        EXPECT_EQ(alive.erase({key.source, key.chunk}), 1u);
        bytes -= sizes[{key.source, key.chunk}];
    }
    std::set<std::pair<uint32_t, uint32_t>> alive;
    std::map<std::pair<uint32_t, uint32_t>, uint64_t> sizes;
    uint64_t bytes = 0, most = 0;
    bool refuse = false;
    std::function<void(ChunkKey)> onUpload, onEvict;
};

class BrokenSource final : public ByteSource {
  public:
    uint64_t sizeBytes() const override { return 0; }
    const std::string& path() const override { return path_; }
    uint64_t identity() const override { return 0; }
    Result<void> readAt(uint64_t, void*, size_t) const override {
        return fail(ErrorKind::input, "the cable is unplugged");
    }

  private:
    std::string path_ = "cable";
};

class StreamerTest : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 1));
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        hierarchies_ = {&store_->hierarchy};
    }
    /// One frame, stepped by hand: all work that was started finishes before the next.
    const lod::Cut& step(Streamer& streamer, const lod::View& view, double tau) {
        streamer.collect();
        streamer.upload();
        lod::selectCut({hierarchies_, instances_, {}}, streamer.residency(), view,
                       {tau, std::numeric_limits<uint64_t>::max()}, scratch_, cut_);
        streamer.request(cut_);
        executor_->wait();
        return cut_;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
    std::shared_ptr<const lod::Store> store_;
    std::vector<const lod::Hierarchy*> hierarchies_;
    std::vector<lod::Instance> instances_{1};
    lod::CutScratch scratch_;
    lod::Cut cut_;
};

TEST_F(StreamerTest, FillsUpAndThenRests) {
    CountingSink sink;
    {
        Streamer streamer(*executor_, sink, {});
        streamer.addSource(store_->hierarchy, store_->file, "a");
        const lod::View view = test::fitView(*store_, 640, 480);
        for (int i = 0; i < 10; ++i) step(streamer, view, 0.1);
        EXPECT_TRUE(cut_.wanted.empty());
        EXPECT_TRUE(streamer.isIdle());
        EXPECT_EQ(streamer.counters().requests, sink.alive.size());
        const uint64_t before = streamer.counters().requests;
        for (int i = 0; i < 60; ++i) step(streamer, view, 0.1);
        EXPECT_EQ(streamer.counters().requests, before) << "a static view must not stream";
        EXPECT_EQ(streamer.counters().evictions, 0u);
    }
}

/// What came is what goes, also where chunks come without what their tables promise.
TEST_F(StreamerTest, ResidentBytesEndAtNone) {
    CountingSink sink;
    lod::Hierarchy h = store_->hierarchy;
    h.hasMaterials = true;
    for (lod::Node& n : h.nodes) n.attributeBytes = 1;
    hierarchies_ = {&h};
    StreamSettings settings;
    settings.residentBytes = 400'000;
    Streamer streamer(*executor_, sink, settings);
    streamer.addSource(h, store_->file, "a");
    const lod::View front = test::fitView(*store_, 640, 480);
    lod::View back = front;
    back.eye = -front.eye;
    back.forward = -front.forward;
    back.right = -front.right;
    for (int i = 0; i < 200; ++i) {
        step(streamer, i % 40 < 20 ? front : back, i % 20 < 10 ? 0.5 : 30);
        uint64_t resident = 0;
        for (const auto& [source, chunk] : sink.alive) resident += lod::decodedBytes(h, chunk);
        ASSERT_EQ(streamer.counters().residentBytes, resident);
    }
    EXPECT_GT(streamer.counters().uploads, 10u);
    EXPECT_GT(streamer.counters().evictions, 0u) << "nothing went";
}

TEST_F(StreamerTest, TheByteBudgetIsNeverExceededWhateverTheViews) {
    CountingSink sink;
    {
        StreamSettings settings;
        settings.residentBytes = 200'000;
        Streamer streamer(*executor_, sink, settings);
        streamer.addSource(store_->hierarchy, store_->file, "a");
        Rng rng(4);
        for (int i = 0; i < 300; ++i) {
            lod::View view = test::fitView(*store_, 640, 480);
            view.eye = {rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-2, 2)};
            view.forward = glm::normalize(-view.eye);
            view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0.1, 1, 0)));
            view.down = glm::cross(view.forward, view.right);
            step(streamer, view, std::exp2(rng.uniform(-3, 4)));
            ASSERT_LE(sink.bytes, settings.residentBytes);
            ASSERT_EQ(sink.bytes, streamer.counters().residentBytes);
            if (i > 2) ASSERT_FALSE(cut_.draw.empty()) << "once the root is resident there is always an image";
        }
        EXPECT_GT(streamer.counters().evictions, 0u);
    }
}

/// By brute force, of each chunk that goes: no other that could go was used less recently.
TEST_F(StreamerTest, WhatWasUsedLeastRecentlyGoesFirst) {
    CountingSink sink;
    const lod::Hierarchy& h = store_->hierarchy;
    std::map<uint32_t, uint64_t> used;
    uint64_t frame = 0, wrong = 0, others = 0;
    const auto isParent = [&](uint32_t chunk) {
        bool is = false;
        for (const auto& [source, below] : sink.alive)
            lod::forEachRequired(h, below, [&](uint32_t above) { is = is || above == chunk; });
        return is;
    };
    Streamer streamer(*executor_, sink, {400'000, 1u << 26, 64});
    streamer.addSource(h, store_->file, "a");
    bool isOver = false;
    sink.onUpload = [&](ChunkKey key) { used[key.chunk] = frame; };
    sink.onEvict = [&](ChunkKey key) {
        if (isOver) return;
        wrong += isParent(key.chunk) || used[key.chunk] >= frame ? 1 : 0;
        for (const auto& [source, chunk] : sink.alive)
            if (chunk != key.chunk && !lod::isOfRoot(h, chunk) && !isParent(chunk)) {
                ++others;
                wrong += used[chunk] < used[key.chunk] ? 1 : 0;
            }
    };
    Rng rng(6);
    for (int i = 0; i < 400; ++i) {
        lod::View view = test::fitView(*store_, 640, 480);
        view.eye = {rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-2, 2)};
        view.forward = glm::normalize(-view.eye);
        view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0.1, 1, 0)));
        view.down = glm::cross(view.forward, view.right);
        step(streamer, view, std::exp2(rng.uniform(1, 5)));
        ++frame;
        for (const auto& [source, chunk] : cut_.keep) used[chunk] = frame;
    }
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(others, 100u);
    EXPECT_GT(streamer.counters().evictions, 30u);
    isOver = true;
}

/// Chunks arrive in any order; where there is room for some of them alone, it is not taken by those that nothing can be
/// drawn of yet.
TEST_F(StreamerTest, NothingIsUploadedBeforeWhatItBuildsOn) {
    executor_ = test::makeBackwardsExecutor();
    CountingSink sink;
    Streamer streamer(*executor_, sink, {200'000, 1u << 26, 64});
    const lod::Hierarchy& h = store_->hierarchy;
    streamer.addSource(h, store_->file, "a");
    size_t early = 0;
    sink.onUpload = [&](ChunkKey key) {
        lod::forEachRequired(h, key.chunk, [&](uint32_t above) { early += sink.alive.contains({0, above}) ? 0 : 1; });
    };
    const lod::View view = test::fitView(*store_, 640, 480);
    for (int i = 0; i < 3; ++i) step(streamer, view, 0.1);
    EXPECT_FALSE(cut_.draw.empty()) << "the root was there with the first that came";
    for (int i = 0; i < 300; ++i) step(streamer, view, 0.1);
    EXPECT_EQ(early, 0u);
    EXPECT_GT(streamer.counters().uploads, 3u);
    EXPECT_FALSE(cut_.wanted.empty()) << "all of it would have fitted";
}

TEST_F(StreamerTest, WhatNobodyWantsAnyMoreIsNotUploaded) {
    CountingSink sink;
    Streamer streamer(*executor_, sink, {});
    streamer.addSource(store_->hierarchy, store_->file, "a");
    lod::View view = test::fitView(*store_, 640, 480);
    for (int i = 0; i < 10; ++i) step(streamer, view, 30);
    const size_t before = sink.alive.size();
    // What this frame asks for arrives after the next one has asked for nothing of it.
    streamer.collect();
    streamer.upload();
    lod::selectCut({hierarchies_, instances_, {}}, streamer.residency(), view, {0.1}, scratch_, cut_);
    streamer.request(cut_);
    const uint32_t asked = streamer.counters().inFlight;
    EXPECT_GT(asked, 3u);
    lod::selectCut({hierarchies_, instances_, {}}, streamer.residency(), view, {30}, scratch_, cut_);
    streamer.request(cut_);
    executor_->wait();
    streamer.collect();
    streamer.upload();
    EXPECT_EQ(streamer.counters().unwanted, asked);
    EXPECT_EQ(sink.alive.size(), before);
    for (int i = 0; i < 20; ++i) step(streamer, view, 0.1);
    EXPECT_TRUE(cut_.wanted.empty()) << "asked for again, they come";
    EXPECT_EQ(streamer.counters().unwanted, asked);
}

TEST_F(StreamerTest, StreamsFromMemoryToo) {
    const auto bytes = readWhole(store_->path);
    ASSERT_TRUE(bytes);
    const auto memory = std::make_shared<const MemorySource>("in memory", *bytes);
    const auto store = lod::openStore(memory);
    ASSERT_TRUE(store) << store.error().line();
    EXPECT_EQ(store->contentHash, store_->contentHash);
    CountingSink sink;
    Streamer streamer(*executor_, sink, {});
    streamer.addSource(store->hierarchy, store->file, "a");
    const lod::View view = test::fitView(*store_, 640, 480);
    for (int i = 0; i < 20; ++i) step(streamer, view, 0.1);
    EXPECT_TRUE(cut_.wanted.empty());
    const auto cut = std::make_shared<const MemorySource>(
        "half", std::vector<uint8_t>(bytes->begin(), bytes->begin() + static_cast<std::ptrdiff_t>(bytes->size() / 2)));
    const auto half = lod::openStore(cut);
    ASSERT_FALSE(half);
    EXPECT_NE(half.error().line().find("half"), std::string::npos);
}

TEST_F(StreamerTest, AFailedChunkIsCountedAndTriedAgainLater) {
    CountingSink sink;
    {
        Streamer streamer(*executor_, sink, {});
        streamer.addSource(store_->hierarchy, std::make_shared<BrokenSource>(), "a");
        const lod::View view = test::fitView(*store_, 640, 480);
        for (int i = 0; i < 5; ++i) step(streamer, view, 0.1);
        const uint64_t failures = streamer.counters().failures;
        EXPECT_GT(failures, 0u);
        EXPECT_NE(streamer.lastFailure().find("unplugged"), std::string::npos);
        for (int i = 0; i < 5; ++i) step(streamer, view, 0.1);
        EXPECT_EQ(streamer.counters().failures, failures) << "not in every frame";
        for (int i = 0; i < 130; ++i) step(streamer, view, 0.1);
        EXPECT_GT(streamer.counters().failures, failures);
        EXPECT_TRUE(cut_.draw.empty());
    }
}

TEST_F(StreamerTest, ASinkThatIsFullDoesNotStall) {
    CountingSink sink;
    sink.refuse = true;
    Streamer streamer(*executor_, sink, {});
    streamer.addSource(store_->hierarchy, store_->file, "a");
    const lod::View view = test::fitView(*store_, 640, 480);
    for (int i = 0; i < 5; ++i) step(streamer, view, 0.1);
    EXPECT_GT(streamer.counters().failures, 0u);
    sink.refuse = false;
    for (int i = 0; i < 260; ++i) step(streamer, view, 0.1);
    EXPECT_TRUE(cut_.wanted.empty());
}

TEST(ChunkState, TheTableOfTransitionsIsWhatTheLifeOfARequestSays) {
    using S = ChunkState;
    constexpr std::array kAll{S::absent, S::requested, S::arrived, S::resident, S::failed};
    const auto before = [&](S to) {
        std::set<S> from;
        for (const S s : kAll)
            if (isLegalTransition(s, to)) from.insert(s);
        return from;
    };
    // One request at a time; nothing can be drawn that did not arrive; what is drawn is not asked for again.
    EXPECT_EQ(before(S::requested), (std::set{S::absent, S::failed}));
    EXPECT_EQ(before(S::arrived), std::set{S::requested});
    EXPECT_EQ(before(S::resident), std::set{S::arrived});
    // Reading and taking in may fail, being resident may not; a chunk that is on its way cannot be forgotten.
    EXPECT_EQ(before(S::failed), (std::set{S::requested, S::arrived}));
    EXPECT_EQ(before(S::absent), (std::set{S::arrived, S::resident}));
}

}  // namespace
}  // namespace stipple::streaming
