// The overview of a store of points: levels of few records for all of it, one of which is drawn where the store is
// small in the picture. Every level lies within its error of the leaves, and the leaves within it of the level;
// distances are measured here, of discs, with formulas of this file.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "engine/base/rng.h"
#include "engine/reference/decode.h"
#include "lod/builder/points/overview.h"
#include "lod/builder/weights/add.h"
#include "lod/cut/cut.h"
#include "lod/primitives/octahedral.h"
#include "lod/store/leaves.h"
#include "lod/store/store.h"
#include "lod/store/surfel_weights.h"
#include "tests/support/crafted_store.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

using glm::dvec3;

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

struct Level {
    uint32_t code = 0;
    std::vector<reference::Disc> discs;
};

/// Of a place from a disc. One without a normal turns with the view: it is a ball.
double distanceOf(const dvec3& p, const reference::Disc& disc) {
    const dvec3 d = p - disc.position;
    if (!(glm::length(disc.normal) > 0)) return std::max(0.0, glm::length(d) - disc.radius);
    const dvec3 n = glm::normalize(disc.normal);
    const double height = glm::dot(d, n), beside = glm::length(d - height * n);
    return std::hypot(height, std::max(0.0, beside - disc.radius));
}

/// A place of a disc.
dvec3 placeOn(const reference::Disc& disc, Rng& rng) {
    const dvec3 any = glm::normalize(dvec3(rng.normal(), rng.normal(), rng.normal()));
    const double r = disc.radius * std::sqrt(rng.uniform(0, 1));
    if (!(glm::length(disc.normal) > 0)) return disc.position + r * any;
    const dvec3 n = glm::normalize(disc.normal), along = any - glm::dot(any, n) * n;
    return disc.position + r * glm::normalize(along);
}

/// What holds normals of all ways, of one way, of none, several of them; a slope between two axes.
std::vector<test::TestPoint> pointsOf(const std::string& shape, size_t count) {
    Rng rng(5);
    std::vector<test::TestPoint> all;
    if (shape == "sphere") return test::bumpySphere(count, 3);
    for (size_t i = 0; i < count; ++i) {
        test::TestPoint p;
        const dvec3 any(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
        const bool isCloud = shape == "cloud" || (shape == "house" && i % 3 == 0);
        const bool isWall = shape == "house" && i % 3 == 1;
        p.position = isCloud  ? dvec3(0.3, 0.2, 0.5) + 0.3 * any
                     : isWall ? dvec3(any.x, 0.1, 0.4 * (any.z + 1))
                              : dvec3(any.x, any.y, shape == "slope" ? -any.x : 0);
        p.normal = isCloud ? glm::vec3(0) : isWall ? glm::vec3(0, -1, 0) : glm::vec3(0, 0, 1);
        if (shape == "slope") p.normal = glm::normalize(glm::vec3(1 + 0.1 * any.z, 0.1 * any.y, 1));
        p.colour = isCloud ? 0x208020 : isWall ? 0xc0c0c0 : 0x604020;
        p.radius = 0.03f;
        all.push_back(p);
    }
    return all;
}

class Overviews : public testing::Test {
  protected:
    void make(const std::string& shape, size_t count, uint32_t leafRecords) {
        points_ = pointsOf(shape, count);
        test::writePly(folder_ / "a.ply", points_, true, shape != "sphere");
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, leafRecords);
        const Hierarchy& h = store_->hierarchy;
        const auto drawn = readDrawnChunk(*store_, 0), own = readChunk(*store_, 0);
        ASSERT_TRUE(drawn && own);
        const uint32_t count0 = h.overviewOf(h.nodes[0]);
        ASSERT_EQ(drawn->records.size(), h.nodes[0].records);
        ASSERT_EQ(own->records.size(), h.ownRecordsOf(h.nodes[0]));
        ASSERT_EQ(count0 + own->records.size(), drawn->records.size());
        levels_.clear();
        for (uint32_t i = 0; i < count0; ++i) {
            const reference::Disc disc = reference::decodeDisc(h, h.nodes[0], drawn->records[i]);
            if (levels_.empty() || levels_.back().code != disc.errorCode) levels_.push_back({disc.errorCode, {}});
            levels_.back().discs.push_back(disc);
        }
        leaves_.clear();
        for (uint32_t n = 0; n < h.nodes.size(); ++n) {
            if (!h.nodes[n].isLeaf()) continue;
            const auto chunk = readChunk(*store_, n);
            ASSERT_TRUE(chunk);
            for (const shared::PointRecord& r : chunk->records)
                leaves_.push_back(reference::decodeDisc(h, h.nodes[n], r));
        }
        ASSERT_EQ(leaves_.size(), points_.size());
    }
    double errorOf(const Level& level) const {
        return store_->hierarchy.unit * store_->hierarchy.errors.decode(level.code);
    }
    /// From the nearest leaf.
    double fromLeaves(const dvec3& p) const {
        double least = HUGE_VAL;
        for (const reference::Disc& leaf : leaves_) least = std::min(least, distanceOf(p, leaf));
        return least;
    }
    Cut select(const View& view, const Budgets& budgets, const Instance& instance = {}) const {
        const std::vector<const Hierarchy*> hierarchies{&store_->hierarchy};
        const std::vector<Instance> instances{instance};
        const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(store_->hierarchy.nodes.size(), 1)};
        CutScratch scratch;
        Cut cut;
        selectCut({hierarchies, instances, {}}, {drawable}, view, budgets, scratch, cut);
        return cut;
    }
    /// A sphere of radius 1 about the origin is about so many pixels across.
    static View viewFrom(const dvec3& eye, bool isOrthographic, double pixels) {
        View view;
        view.eye = eye;
        view.forward = glm::normalize(-eye);
        view.right = glm::normalize(glm::cross(view.forward, dvec3(0.1, 1, 0.2)));
        view.down = glm::cross(view.forward, view.right);
        view.width = 1920;
        view.height = 1080;
        view.isOrthographic = isOrthographic;
        view.focalPixels = 0.5 * pixels * (isOrthographic ? 1 : glm::length(eye));
        return view;
    }

    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
    std::vector<test::TestPoint> points_;
    std::shared_ptr<const Store> store_;
    std::vector<Level> levels_;  ///< the coarsest first
    std::vector<reference::Disc> leaves_;
};

TEST_F(Overviews, AreWithinTheirErrorBothWays) {
    Rng rng(17);
    for (const std::string shape : {"sphere", "plane", "cloud", "house", "slope"})
        for (const uint32_t leafRecords : {256u, 8192u}) {  // an inner root, and one that is a leaf
            SCOPED_TRACE(testing::Message() << shape << ", leaves of " << leafRecords);
            make(shape, 6'000, leafRecords);
            if (HasFatalFailure()) return;
            ASSERT_EQ(store_->hierarchy.nodes[0].isLeaf(), leafRecords > 6'000);
            ASSERT_GE(levels_.size(), 3u);
            EXPECT_LE(levels_.front().discs.size(), 6u);
            double closest = 0;
            for (const Level& level : levels_) {
                const double error = errorOf(level) * (1 + 1e-5);
                // Each leaf as a whole: its middle and its rim.
                for (size_t i = 0; i < leaves_.size(); i += 7) {
                    for (int k = 0; k < 4; ++k) {
                        const dvec3 p = k == 0 ? leaves_[i].position : placeOn(leaves_[i], rng);
                        double least = HUGE_VAL;
                        for (const reference::Disc& d : level.discs) least = std::min(least, distanceOf(p, d));
                        ASSERT_LE(least, error) << "a leaf is farther from level " << level.code;
                        closest = std::max(closest, least / error);
                    }
                }
                for (size_t i = 0; i < level.discs.size(); i += 1 + level.discs.size() / 40)
                    for (int k = 0; k < 6; ++k) {
                        const double off = fromLeaves(placeOn(level.discs[i], rng));
                        ASSERT_LE(off, error) << "of level " << level.code;
                        closest = std::max(closest, off / error);
                    }
            }
            EXPECT_GT(closest, 0.15) << "the errors are so large that this shows nothing";
            for (size_t k = 1; k < levels_.size(); ++k) {
                EXPECT_LT(levels_[k].code, levels_[k - 1].code);
                EXPECT_GE(levels_[k].discs.size(), (k == 1 ? 1 : 2) * levels_[k - 1].discs.size());
            }
        }
}

// Who verifies looks both ways, too: at leaves that no disc of a level is near enough, and at discs that no leaf is.
TEST_F(Overviews, AreFoundWhereTheirErrorsAreFalse) {
    struct Case {
        const char *shape, *says;
        uint32_t radius;
    };
    for (const auto& [shape, says, radius] :
         {Case{"plane", "off the overview's level of", 60}, {"house", "off the nearest leaf", 255}})
        for (const uint32_t leafRecords : {256u, 8192u}) {
            SCOPED_TRACE(testing::Message() << shape << ", leaves of " << leafRecords);
            make(shape, 6'000, leafRecords);
            if (HasFatalFailure()) return;
            EXPECT_TRUE(verifyStore(*store_, *executor_));
            auto chunk = readDrawnChunk(*store_, 0, true);
            ASSERT_TRUE(chunk);
            for (uint32_t i = 0; i < store_->hierarchy.overviewOf(store_->hierarchy.nodes[0]); ++i) {
                uint32_t& word = chunk->records[i].positionZRadiusError;
                word = (word & 0xff00ffffu) | radius << 16;
            }
            auto crafted = test::CraftedStore::read(folder_ / "a.stipple");
            crafted.replaceChunk(0, test::encodeAgain(*chunk));
            crafted.write(folder_ / "b.stipple");
            const auto wrong = openStore(folder_ / "b.stipple");
            ASSERT_TRUE(wrong);
            const auto verified = verifyStore(*wrong, *executor_);
            ASSERT_FALSE(verified);
            EXPECT_NE(verified.error().line().find(says), std::string::npos) << verified.error().line();
        }
}

// Half way to the front of all, a face of a body beside few strays were out of the sphere: no store is built of that.
TEST(Overview, LiesInsideOfTheSphere) {
    Frame frame = makeFrame(dvec3(0), 1, 65535, 8192);
    PendingNode root;
    const dvec3 middle(32768);
    constexpr double kRadius = 30000;
    std::vector<dvec3> places{{-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
    Rng rng(4);
    while (places.size() < 100)
        places.push_back(dvec3(0.95, 0, 0) + 0.04 * glm::normalize(dvec3(rng.normal(), rng.normal(), rng.normal())));
    std::vector<std::pair<Key, std::array<uint32_t, 3>>> sorted;
    for (const dvec3& p : places) {
        const dvec3 at = middle + kRadius * p;
        const std::array<uint32_t, 3> q{static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y),
                                        static_cast<uint32_t>(at.z)};
        sorted.emplace_back(frame.keyOf(q[0], q[1], q[2]), q);
    }
    std::sort(sorted.begin(), sorted.end());
    for (const auto& [key, q] : sorted) {
        root.own.key.push_back(key);
        root.own.points.x.push_back(q[0]);
        root.own.points.y.push_back(q[1]);
        root.own.points.z.push_back(q[2]);
        root.own.points.colour.push_back(0x808080);
        const glm::vec3 n(glm::normalize(dvec3(q[0], q[1], q[2]) - (middle + dvec3(0.95 * kRadius, 0, 0))));
        root.own.points.normal.push_back(octEncode(n));
        root.own.points.radius.push_back(300);
    }
    root.leafParentCode.assign(places.size(), static_cast<uint8_t>(ErrorScale::kNoParent));
    root.node.records = static_cast<uint32_t>(places.size());
    root.node.centre = middle;
    root.node.radius = kRadius + 400;
    root.node.stepShift = static_cast<int8_t>(static_cast<int>(frame.rootLog2) - 16);
    addOverview(frame, root);
    ASSERT_GE(root.records.size(), 6u);
    double farthest = 0;
    for (const AggregateRecord& r : root.records) farthest = std::max(farthest, glm::length(r.place - middle));
    EXPECT_LE(farthest, root.node.radius + 1);
    EXPECT_GT(farthest, 0.99 * root.node.radius) << "some are held back";
}

TEST_F(Overviews, OneLevelIsDrawnOfWhatIsSmall) {
    make("sphere", 20'000, 512);
    Rng rng(21);
    std::map<uint32_t, int> drawn;  // of which code how often
    int own = 0;
    const Hierarchy& h = store_->hierarchy;
    const auto chunk = readDrawnChunk(*store_, 0);
    for (int round = 0; round < 600; ++round) {
        const dvec3 eye = rng.uniform(3, 4000) * glm::normalize(dvec3(rng.normal(), rng.normal(), rng.normal()));
        const double pixels = std::exp2(rng.uniform(-6, 7)), tau = std::exp2(rng.uniform(-5, 5));
        const View view = viewFrom(eye, round % 3 == 0, pixels);
        const Cut cut = select(view, {tau, kNoLimit});
        ASSERT_FALSE(cut.draw.empty());
        const CutDraw& first = cut.draw.front();
        const uint32_t overview = h.overviewOf(h.nodes[0]);
        if (first.node != 0 || first.first >= overview) {
            ++own;
            // What is as small as that is drawn as the coarsest level, whatever is asked for beyond it.
            ASSERT_GT(errorOf(levels_.back()) * 0.5 * pixels * 2, tau * 0.5);
            continue;
        }
        ASSERT_EQ(cut.draw.size(), 1u);
        ASSERT_TRUE(cut.wanted.empty());
        const auto level = std::find_if(levels_.begin(), levels_.end(), [&](const Level& l) {
            return l.code == shared::recordErrorCode(chunk->records[first.first]);
        });
        ASSERT_NE(level, levels_.end());
        ASSERT_EQ(first.count, level->discs.size()) << "one level, all of it";
        ASSERT_EQ(cut.counters.recordsDrawn, first.count);
        ++drawn[level->code];
        ASSERT_LE(first.errorPixels, tau * (1 + 1e-6));
        // On the picture no leaf is farther from what is drawn.
        const double perPixel = view.isOrthographic ? 1 / view.focalPixels
                                                    : (glm::length(eye) - 1.2) / view.focalPixels;  // (it reaches 1.1)
        double most = 0;
        for (size_t i = 0; i < leaves_.size(); i += 37) {
            double least = HUGE_VAL;
            for (const reference::Disc& d : level->discs) least = std::min(least, distanceOf(leaves_[i].position, d));
            most = std::max(most, least);
        }
        ASSERT_LE(most / perPixel, first.errorPixels * 1.2) << "(at the nearest place that there may be)";
        ASSERT_GE(first.errorPixels, 0.9 * errorOf(*level) / (glm::length(eye) + 2) * view.focalPixels *
                                         (view.isOrthographic ? glm::length(eye) + 2 : 1))
            << "no less than its error says";
    }
    EXPECT_GE(drawn.size(), levels_.size()) << "every level comes up";
    EXPECT_GT(own, 50);
}

TEST_F(Overviews, CountAsFewWhereABudgetBinds) {
    make("sphere", 20'000, 512);
    const View view = viewFrom({0, 0, -500}, false, 3);
    const Cut exact = select(view, {1e-3, kNoLimit});
    ASSERT_GT(exact.counters.recordsDrawn, 1000u) << "a thousandth of a pixel is asked for";
    const Cut bound = select(view, {1e-3, 6});
    EXPECT_LE(bound.counters.recordsDrawn, 6u);
    EXPECT_FALSE(bound.truncated) << "the coarsest level fits";
    EXPECT_GE(bound.tauTarget, 0.3);
}

TEST_F(Overviews, CostNoMoreWhereTheyAreHidden) {
    make("sphere", 20'000, 512);
    const std::vector<PlacedNode> hidden{{0, 0}};
    for (const double pixels : {0.2, 1.0, 5.0, 30.0, 200.0}) {
        const View view = viewFrom({0, 0, -500}, false, pixels);
        Budgets budgets{1, kNoLimit};
        const uint64_t without = select(view, budgets).counters.recordsDrawn;
        budgets.unrefined = hidden;
        const Cut cut = select(view, budgets);
        EXPECT_LE(cut.counters.recordsDrawn, without) << pixels << " px";
        EXPECT_GT(cut.counters.recordsDrawn, 0u);
    }
}

TEST_F(Overviews, AreWeighedLevelByLevel) {
    make("sphere", 20'000, 512);
    Progress silent(false);
    ASSERT_TRUE(addSurfelWeights(folder_ / "a.stipple", *executor_, silent));
    const auto weighed = openStore(folder_ / "a.stipple");
    ASSERT_TRUE(weighed);
    const Hierarchy& h = weighed->hierarchy;
    const auto bytes = readStream(*weighed, 0, *weightsOf(h, 0));
    ASSERT_TRUE(bytes);
    const auto codes = decodeWeights(bytes->data(), bytes->size(), h.nodes[0].records, "here");
    ASSERT_TRUE(codes);
    // Discs of a level overlap as those of other levels do: they would add up to more than what is there.
    size_t at = 0;
    for (const Level& level : levels_) {
        size_t less = 0;
        for (size_t k = 0; k < level.discs.size(); ++k, ++at) less += (*codes)[at] < 250 ? 1 : 0;
        if (level.discs.size() > 200) EXPECT_GT(2 * less, level.discs.size()) << "of " << level.discs.size();
    }
    EXPECT_TRUE(verifyStore(*weighed, *executor_));
}

TEST_F(Overviews, HaveTheInputsErrorInTheirs) {
    make("sphere", 20'000, 512);
    const View view = viewFrom({0, 0, -500}, false, 0.25);  // an eighth of a pixel a unit
    Instance instance;
    const Cut without = select(view, {1, kNoLimit}, instance);
    ASSERT_EQ(without.draw.front().first, 0u);
    instance.inputError = 2;
    const Cut with = select(view, {1, kNoLimit}, instance);
    ASSERT_EQ(with.draw.size(), 1u);
    EXPECT_NEAR(with.draw.front().errorPixels, without.draw.front().errorPixels + 0.25, 0.01);
    instance.inputError = 7;
    EXPECT_GT(select(view, {1, kNoLimit}, instance).draw.front().first, 0u) << "less of the error is left";
}

TEST_F(Overviews, AreNoPartOfWhatIsRead) {
    for (const uint32_t leafRecords : {256u, 8192u}) {
        make("house", 3'000, leafRecords);
        auto source = leafPoints(store_);
        ASSERT_TRUE(source);
        EXPECT_EQ(source->info.points, points_.size());
        const auto report = verifyStore(*store_, *executor_);
        ASSERT_TRUE(report) << report.error().line();
        EXPECT_EQ(report->leafRecords, points_.size());
    }
}

TEST_F(Overviews, FewPointsHaveNone) {
    make("cloud", 60, 512);
    EXPECT_TRUE(levels_.empty());
    EXPECT_EQ(store_->hierarchy.nodes[0].records, 60u);
}

}  // namespace
}  // namespace stipple::lod
