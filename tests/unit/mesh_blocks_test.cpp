// Triangles that are read block by block: each block has vertices of its own, and one is placed while others are used.
#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "engine/base/rng.h"
#include "lod/builder/mesh/mesh_work.h"

namespace stipple::lod {
namespace {

/// Vertices with any numbers: many of a large mesh, also such as share a line of the table, and the last of it.
TEST(BlockMaker, EveryTriangleHasItsVertices) {
    Rng rng(17);
    std::vector<uint64_t> given, got;
    std::vector<uint64_t> ofBlock;
    size_t blocks = 0;
    BlockMaker maker(
        [&](uint64_t v, TriangleMesh& to) {
            ofBlock.push_back(v);
            to.position.emplace_back(static_cast<double>(v), 0, 0);
        },
        [&](const TriangleMesh& block) -> Result<void> {
            EXPECT_EQ(block.position.size(), ofBlock.size());
            EXPECT_EQ(std::set<uint64_t>(ofBlock.begin(), ofBlock.end()).size(), ofBlock.size()) << "one twice";
            for (const uint32_t i : block.indices) got.push_back(static_cast<uint64_t>(block.position[i].x));
            ofBlock.clear();
            ++blocks;
            return {};
        });
    for (int t = 0; t < 200'000; ++t) {
        std::array<uint64_t, 3> corner{};
        for (uint64_t& c : corner)
            c = t % 3 == 0 ? rng.below(uint64_t{1} << 39) : t % 3 == 1 ? rng.below(1000) : rng.below(200'000) * 8;
        given.insert(given.end(), corner.begin(), corner.end());
        ASSERT_TRUE(maker.triangle(corner[0], corner[1], corner[2]));
    }
    ASSERT_TRUE(maker.finish());
    EXPECT_EQ(blocks, 4u);
    EXPECT_EQ(got, given);
}

/// `blocks` blocks of a triangle each, whose first corner says which; `calls`: the threads that ask.
MeshSource counted(int blocks, std::set<std::thread::id>& calls, int failing = -1) {
    MeshSource source;
    source.read = [=, &calls](const MeshSource::Take& take) -> Result<void> {
        TriangleMesh block;
        for (int b = 0; b < blocks; ++b) {
            calls.insert(std::this_thread::get_id());
            if (b == failing) return fail(ErrorKind::input, "gone", "a source");
            block.position = {{b, 0, 0}, {b, 1, 0}, {b, 0, 1}, {b, 1, 1}};
            block.indices = {0, 1, 2, 2, 2, 2};
            if (const Result<void> taken = take(block); !taken) return taken;
            block.position.clear();  // a source may use it again
            block.indices.clear();
        }
        return {};
    };
    return source;
}

class PlacedBlocks : public testing::TestWithParam<int> {
  protected:
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(GetParam());
    std::set<std::thread::id> calls_;
    std::vector<int> used_;

    Result<void> use(const PlacedBlock& block) {
        EXPECT_EQ(block.given, 2u);
        EXPECT_EQ(block.degenerate, 1u);
        EXPECT_EQ(block.x.size(), 1u);
        calls_.insert(std::this_thread::get_id());
        used_.push_back(block.soup.vertices.low[0].x);
        return {};
    }
};

TEST_P(PlacedBlocks, ComeInOrderOnTheCallingThread) {
    ASSERT_TRUE(
        forPlacedBlocks(counted(300, calls_), {}, *executor_, Placed::all, [&](PlacedBlock& b) { return use(b); }));
    ASSERT_EQ(used_.size(), 300u);
    for (int b = 0; b < 300; ++b) EXPECT_EQ(used_[static_cast<size_t>(b)], b);
    EXPECT_EQ(calls_, std::set{std::this_thread::get_id()}) << "hosts give sources";
}

TEST_P(PlacedBlocks, OfNothingAreNone) {
    ASSERT_TRUE(
        forPlacedBlocks(counted(0, calls_), {}, *executor_, Placed::all, [&](PlacedBlock& b) { return use(b); }));
    EXPECT_TRUE(used_.empty());
}

TEST_P(PlacedBlocks, EndWithTheFirstErrorOfEitherSide) {
    const auto read =
        forPlacedBlocks(counted(9, calls_, 5), {}, *executor_, Placed::all, [&](PlacedBlock& b) { return use(b); });
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().what, "gone");
    used_.clear();
    const auto taken =
        forPlacedBlocks(counted(9, calls_), {}, *executor_, Placed::all, [&](PlacedBlock& b) -> Result<void> {
            if (used_.size() == 3) return fail(ErrorKind::budget, "full", "a disk");
            return use(b);
        });
    ASSERT_FALSE(taken);
    EXPECT_EQ(taken.error().what, "full");
    EXPECT_EQ(used_, (std::vector<int>{0, 1, 2}));
}

TEST_P(PlacedBlocks, OfWhichOnlyThePlacesAreWanted) {
    std::vector<std::array<uint32_t, 3>> centres, expected;
    for (const Placed what : {Placed::all, Placed::positions})
        ASSERT_TRUE(forPlacedBlocks(counted(5, calls_), {}, *executor_, what, [&](PlacedBlock& b) -> Result<void> {
            (what == Placed::all ? expected : centres).push_back({b.x[0], b.y[0], b.z[0]});
            return {};
        }));
    EXPECT_EQ(centres, expected);
}

INSTANTIATE_TEST_SUITE_P(Threads, PlacedBlocks, testing::Values(1, 2, 5));

}  // namespace
}  // namespace stipple::lod
