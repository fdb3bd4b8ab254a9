// Triangles that are read block by block: each block has vertices of its own, and one is placed while others are used.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
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
        forPlacedBlocks(counted(300, calls_), {}, *executor_, Placed::all, 0, [&](PlacedBlock& b) { return use(b); }));
    ASSERT_EQ(used_.size(), 300u);
    for (int b = 0; b < 300; ++b) EXPECT_EQ(used_[static_cast<size_t>(b)], b);
    EXPECT_EQ(calls_, std::set{std::this_thread::get_id()}) << "hosts give sources";
}

TEST_P(PlacedBlocks, OfNothingAreNone) {
    ASSERT_TRUE(
        forPlacedBlocks(counted(0, calls_), {}, *executor_, Placed::all, 0, [&](PlacedBlock& b) { return use(b); }));
    EXPECT_TRUE(used_.empty());
}

TEST_P(PlacedBlocks, EndWithTheFirstErrorOfEitherSide) {
    const auto read =
        forPlacedBlocks(counted(9, calls_, 5), {}, *executor_, Placed::all, 0, [&](PlacedBlock& b) { return use(b); });
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().what, "gone");
    EXPECT_EQ(used_, GetParam() == 1 ? (std::vector<int>{0, 1, 2, 3, 4}) : (std::vector<int>{0, 1, 2, 3}));
    used_.clear();
    const auto taken =
        forPlacedBlocks(counted(9, calls_), {}, *executor_, Placed::all, 0, [&](PlacedBlock& b) -> Result<void> {
            if (used_.size() == 3) return fail(ErrorKind::budget, "full", "a disk");
            return use(b);
        });
    ASSERT_FALSE(taken);
    EXPECT_EQ(taken.error().what, "full");
    EXPECT_EQ(used_, (std::vector<int>{0, 1, 2}));
}

/// Counting and parts look at positions alone: they have to leave out the same triangles as what is sent.
TEST_P(PlacedBlocks, OfPositionsAloneAreTheSamePlaces) {
    TriangleMesh mesh;
    Rng rng(29);
    for (uint32_t i = 0; i < 3000; ++i) {
        const double far = i % 500 == 7 ? 1e12 : 1;
        mesh.position.emplace_back(far * rng.uniform(), rng.uniform(), i == 4 ? NAN : rng.uniform());
        mesh.normal.emplace_back(0, 1, 0);
        mesh.uv.emplace_back(0.25, 0.75);
        mesh.colour.push_back(0xff102030u);
        mesh.surface.push_back(0x40u);
        mesh.indices.push_back(i % 300 == 9 ? i - 1 : i);
    }
    const MeshSource source = sourceOf(std::move(mesh));
    for (const bool isWide : {false, true}) {
        const auto bounds = source.survey({});
        ASSERT_TRUE(bounds);
        Lattice lattice = latticeOf(*bounds);
        EXPECT_TRUE(lattice.isWide());
        if (!isWide) lattice = {};
        const auto placed = [&](Placed what) {
            PlacedBlock out;
            EXPECT_TRUE(forPlacedBlocks(source, lattice, *executor_, what, 0, [&](PlacedBlock& b) -> Result<void> {
                out = std::move(b);
                return {};
            }));
            return out;
        };
        const PlacedBlock all = placed(Placed::all), only = placed(Placed::positions);
        EXPECT_EQ(only.x, all.x);
        EXPECT_EQ(only.y, all.y);
        EXPECT_EQ(only.z, all.z);
        EXPECT_EQ(only.high, all.high);
        EXPECT_EQ(only.soup.indices, all.soup.indices);
        EXPECT_EQ(only.rounding, all.rounding);
        EXPECT_EQ(only.degenerate, all.degenerate);
        EXPECT_EQ(only.notFinite, all.notFinite);
        EXPECT_EQ(only.notFinite, 1u);
        ASSERT_EQ(only.soup.vertices.size(), all.soup.vertices.size());
        for (uint32_t v = 0; v < all.soup.vertices.size(); ++v) {
            EXPECT_EQ(only.soup.vertices.at(v), all.soup.vertices.at(v));
            EXPECT_EQ(all.soup.vertices.low[v].surface & 0x40u, 0x40u);
            EXPECT_EQ(only.soup.vertices.low[v].colour, 0u) << "nobody looks at it";
        }
    }
}

TEST_P(PlacedBlocks, OfWhichTheFirstWereSentAlready) {
    size_t number = 0;
    ASSERT_TRUE(
        forPlacedBlocks(counted(9, calls_), {}, *executor_, Placed::all, 4, [&](PlacedBlock& b) -> Result<void> {
            EXPECT_EQ(b.given, 2u);
            EXPECT_EQ(b.soup.vertices.size(), number < 4 ? 0u : 4u);
            if (number >= 4) EXPECT_EQ(b.soup.vertices.low[0].x, static_cast<int>(number));
            ++number;
            return {};
        }));
    EXPECT_EQ(number, 9u);
}

/// Whose tasks beside the caller have no memory, or wait until the caller is somewhere.
class OtherExecutor final : public Executor {
  public:
    void parallelFor(size_t count, size_t, const std::function<void(size_t, size_t)>& body) override {
        if (std::this_thread::get_id() != caller_ && before_) before_();
        body(0, count);
    }
    void run(std::function<void()> task) override { task(); }
    void wait() override {}
    int threads() const override { return 2; }
    std::unique_ptr<Beside> beside(const std::function<void()>& task) override { return tasks_->beside(task); }
    std::function<void()> before_;

  private:
    std::unique_ptr<Executor> tasks_ = makeTbbExecutor(2);
    std::thread::id caller_ = std::this_thread::get_id();
};

TEST(PlacedBlocksBeside, WhatFailsThereIsToldHere) {
    OtherExecutor executor;
    int beside = 0;
    std::atomic<bool> isOver{false};
    executor.before_ = [&] { throw std::bad_alloc(); };
    std::set<std::thread::id> calls;
    for (int k = 0; k < 20 && beside == 0; ++k) try {
            (void)forPlacedBlocks(counted(50, calls), {}, executor, Placed::all, 0, [&](PlacedBlock&) -> Result<void> {
                std::this_thread::sleep_for(std::chrono::milliseconds(2));  // so that the other thread takes the next
                return {};
            });
        } catch (const std::bad_alloc&) {
            ++beside;
        }
    EXPECT_EQ(beside, 1);
    // A caller that throws while another block is placed: that one is waited for.
    executor.before_ = [&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        isOver = true;
    };
    EXPECT_THROW((void)forPlacedBlocks(counted(50, calls), {}, executor, Placed::all, 0,
                                       [&](PlacedBlock&) -> Result<void> { throw std::bad_alloc(); }),
                 std::bad_alloc);
}

TEST(PlacedBlocksBeside, OneIsPlacedWhileAnotherIsUsed) {
    OtherExecutor executor;
    std::atomic<int> placed{0};
    executor.before_ = [&] { ++placed; };
    std::set<std::thread::id> calls;
    bool wasPlacedMeanwhile = false;
    ASSERT_TRUE(forPlacedBlocks(counted(20, calls), {}, executor, Placed::all, 0, [&](PlacedBlock&) -> Result<void> {
        const int before = placed;
        for (int k = 0; k < 1000 && placed == before && !wasPlacedMeanwhile; ++k)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        wasPlacedMeanwhile = wasPlacedMeanwhile || placed > before;
        return {};
    }));
    EXPECT_TRUE(wasPlacedMeanwhile);
}

INSTANTIATE_TEST_SUITE_P(Threads, PlacedBlocks, testing::Values(1, 2, 5));

}  // namespace
}  // namespace stipple::lod
