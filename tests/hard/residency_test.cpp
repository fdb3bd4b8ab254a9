// Hard case 53: what is resident does not swing to and fro, at rest, under the trembling of a hand, and where it does
// not fit. Stepped by hand, one frame after another.
#include <gtest/gtest.h>

#include <set>

#include "streaming/streamer.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class Sink final : public streaming::ChunkSink {
  public:
    Result<void> upload(streaming::ChunkKey, lod::Chunk) override { return {}; }
    void evict(streaming::ChunkKey) override {}
};

class ResidencyAtRest : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(60'000, 1));
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        hierarchies_ = {&store_->hierarchy};
        view_ = test::fitView(*store_, 640, 480);
    }
    /// Uploads and evictions of `frames` frames after the first 120, of a budget; `move`: the camera of each, m.
    uint64_t toggles(uint64_t residentBytes, const std::function<glm::dvec3(int)>& move, bool* isShort = nullptr) {
        Sink sink;
        streaming::StreamSettings settings;
        settings.residentBytes = residentBytes;
        streaming::Streamer streamer(*executor_, sink, settings);
        streamer.addSource(store_->hierarchy, store_->file, "a");
        uint64_t before = 0;
        constexpr int kSettles = 120, kFrames = 120;
        for (int i = 0; i < kSettles + kFrames; ++i) {
            if (i == kSettles) before = streamer.counters().uploads + streamer.counters().evictions;
            lod::View view = view_;
            view.eye += move(i);
            streamer.collect();
            streamer.upload();
            lod::selectCut({hierarchies_, instances_, {}}, streamer.residency(), view,
                           {1.0, std::numeric_limits<uint64_t>::max()}, scratch_, cut_);
            streamer.request(cut_);
            executor_->wait();
            if (isShort != nullptr) *isShort = !cut_.wanted.empty();
        }
        return streamer.counters().uploads + streamer.counters().evictions - before;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
    std::shared_ptr<const lod::Store> store_;
    std::vector<const lod::Hierarchy*> hierarchies_;
    std::vector<lod::Instance> instances_{1};
    lod::CutScratch scratch_;
    lod::Cut cut_;
    lod::View view_;
};

constexpr uint64_t kPlenty = uint64_t{1} << 30;
constexpr uint64_t kTight = 600'000;  ///< holds a sixth of the chunks that the view asks for
/// By a millimetre, of an object of two metres.
glm::dvec3 tremble(int frame) { return frame % 2 == 0 ? glm::dvec3(1e-3, 0, 0) : glm::dvec3(-1e-3, 1e-3, 0); }

TEST_F(ResidencyAtRest, NothingComesOrGoesWhileTheCameraStands) {
    bool isShort = false;
    const auto still = [](int) { return glm::dvec3(0); };
    EXPECT_EQ(toggles(kPlenty, still, &isShort), 0u);
    EXPECT_FALSE(isShort);
    EXPECT_EQ(toggles(kTight, still, &isShort), 0u);
    EXPECT_TRUE(isShort) << "the budget is too small for the view, as it should be here";
}

TEST_F(ResidencyAtRest, NothingComesOrGoesWhileTheHandTrembles) {
    EXPECT_EQ(toggles(kPlenty, tremble), 0u);
    EXPECT_EQ(toggles(kTight, tremble), 0u);
    // The control: what comes and goes where the camera looks past one side of the object, then past the other, so that
    // most of it is out of view.
    const glm::dvec3 aside = 2.0 * view_.right;
    EXPECT_GT(toggles(kTight, [&](int i) { return i / 30 % 2 == 0 ? aside : -aside; }), 0u);
}

}  // namespace
}  // namespace stipple
