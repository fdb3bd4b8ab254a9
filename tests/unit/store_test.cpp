#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/support/support.h"

namespace stipple::lod {
namespace {

std::string slurp(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {(std::istreambuf_iterator<char>(in)), {}};
}

Result<VerifyReport> openAndVerify(const std::string& path, Executor& executor) {
    auto store = openStore(path);
    if (!store) return tl::unexpected(store.error());
    return verifyStore(*store, executor);
}

class StoreTest : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(3000, 1));
        test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        whole_ = slurp(folder_ / "a.stipple");
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
    std::string whole_;
};

TEST_F(StoreTest, VerifiesWhatItBuilt) {
    const auto report = openAndVerify(folder_ / "a.stipple", *executor_);
    ASSERT_TRUE(report) << report.error().line();
    EXPECT_EQ(report->leafRecords, 3000u);
    EXPECT_GT(report->nodes, 8u);
}

TEST_F(StoreTest, EveryTruncationIsFound) {
    Rng rng(1);
    for (size_t k = 0; k < 400; ++k) {
        const size_t length = k < 300 ? k : static_cast<size_t>(rng.below(whole_.size()));
        std::ofstream(folder_ / "b.stipple", std::ios::binary) << whole_.substr(0, length);
        ASSERT_FALSE(openStore(folder_ / "b.stipple")) << length;
    }
}

TEST_F(StoreTest, EveryChangedByteIsFound) {
    Rng rng(2);
    for (int k = 0; k < 400; ++k) {
        std::string changed = whole_;
        const auto at = static_cast<size_t>(rng.below(changed.size()));
        changed[at] = static_cast<char>(changed[at] ^ (1 << rng.below(8)));
        std::ofstream(folder_ / "b.stipple", std::ios::binary) << changed;
        const auto report = openAndVerify(folder_ / "b.stipple", *executor_);
        ASSERT_FALSE(report) << "byte " << at;
        EXPECT_EQ(report.error().kind, ErrorKind::input);
    }
}

TEST_F(StoreTest, VerifyFindsWhatHashesCannot) {
    // Negative controls: a store whose hashes are right but whose promises are not.
    auto store = openStore(folder_ / "a.stipple");
    ASSERT_TRUE(store);
    Store shrunk = *store;
    shrunk.hierarchy.nodes[1].radius *= 0.5;
    EXPECT_FALSE(verifyStore(shrunk, *executor_));
    Store louder = *store;
    louder.hierarchy.nodes[1].errorCode = 254;
    EXPECT_FALSE(verifyStore(louder, *executor_));
    Store outside = *store;
    outside.hierarchy.nodes[1].centre.x += 4 * outside.hierarchy.nodes[0].radius;
    EXPECT_FALSE(verifyStore(outside, *executor_));
    Store miscounted = *store;
    for (uint32_t& c : miscounted.hierarchy.greaterThan) ++c;
    EXPECT_FALSE(verifyStore(miscounted, *executor_));
}

TEST(Chunk, EveryTruncatedLengthIsRefused) {
    Chunk chunk;
    Rng rng(1);
    for (int i = 0; i < 200; ++i)
        chunk.records.push_back(
            {static_cast<uint32_t>(rng.next()), static_cast<uint32_t>(rng.next()), 7, static_cast<uint32_t>(i)});
    for (int i = 0; i < 600; ++i) chunk.lowBits.push_back(static_cast<uint32_t>(rng.below(16)));
    const std::vector<uint8_t> bytes = encodeChunk(chunk);
    const auto whole = decodeChunk(bytes.data(), bytes.size(), 200, "test", true);
    ASSERT_TRUE(whole);
    EXPECT_EQ(std::memcmp(whole->records.data(), chunk.records.data(), 3200), 0);
    EXPECT_EQ(whole->lowBits, chunk.lowBits);
    for (size_t length = 0; length < bytes.size(); ++length) {
        const std::vector<uint8_t> exact(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length));
        ASSERT_FALSE(decodeChunk(exact.data(), exact.size(), 200, "test", true)) << length;
    }
    EXPECT_FALSE(decodeChunk(bytes.data(), bytes.size(), 199, "test", true));
    EXPECT_FALSE(decodeChunk(bytes.data(), bytes.size(), 201, "test", true));
}

}  // namespace
}  // namespace stipple::lod
