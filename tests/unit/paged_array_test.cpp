// Records that lie side by side in memory, and those of which a few pages are there, are the same records.
#include "engine/base/paged_array.h"

#include <gtest/gtest.h>

#include <sys/mman.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>

#include "engine/base/rng.h"

namespace stipple {
namespace {

constexpr uint64_t kCount = 300'000;

struct Record {
    uint64_t value, twice;
    bool operator==(const Record&) const = default;
};

class PagedArrays : public testing::TestWithParam<uint64_t> {
  protected:
    PagedArray array_{std::filesystem::temp_directory_path().string(), GetParam(), sizeof(Record), kCount};
    std::vector<Record> expected_ = std::vector<Record>(kCount);

    void SetUp() override {
        Rng rng(3);
        for (int k = 0; k < 100'000; ++k) {
            const uint64_t i = rng.below(kCount), value = rng.next();
            expected_[i] = {value, 2 * value};
            std::memcpy(array_.write(i), &expected_[i], sizeof(Record));
        }
    }
};

TEST_P(PagedArrays, HoldWhatWasWrittenAndZerosElsewhere) {
    for (uint64_t i = 0; i < kCount; ++i) ASSERT_EQ(std::memcmp(array_.read(i), &expected_[i], sizeof(Record)), 0) << i;
    EXPECT_TRUE(array_.status());
}

TEST_P(PagedArrays, BecomeNarrowerInPlace) {
    constexpr uint64_t kKept = kCount - 7;
    array_.narrow(kKept, sizeof(uint64_t), [](const uint8_t* from, uint8_t* to) { std::memcpy(to, from + 8, 8); });
    for (uint64_t i = 0; i < kKept; ++i)
        ASSERT_EQ(std::memcmp(array_.read(i), &expected_[i].twice, sizeof(uint64_t)), 0) << i;
    const uint64_t other = 5;
    std::memcpy(array_.write(kKept - 1), &other, sizeof(other));
    EXPECT_EQ(std::memcmp(array_.read(kKept - 1), &other, sizeof(other)), 0);
    EXPECT_TRUE(array_.status());
}

TEST_P(PagedArrays, HaveAFileOnlyWhereTheyDoNotFit) {
    EXPECT_EQ(array_.fileBytes() > 0, GetParam() < kCount * sizeof(Record));
}

INSTANTIATE_TEST_SUITE_P(, PagedArrays,
                         testing::Values(0, 100'000, kCount * sizeof(Record) - 1, kCount * sizeof(Record),
                                         uint64_t{1} << 40));

TEST(PagedArray, WhatIsForgottenGoesBack) {
    constexpr uint64_t kMany = 4 << 20;
    PagedArray array(".", kMany, 64, kMany / 64);
    for (uint64_t i = 0; i < kMany / 64; ++i) array.write(i)[63] = 1;
    const auto residentBytes = [&](const uint8_t* from, uint64_t bytes) {
        const auto first = reinterpret_cast<uintptr_t>(from) / 4096 * 4096;
        std::vector<unsigned char> pages(bytes / 4096);
        EXPECT_EQ(::mincore(reinterpret_cast<void*>(first), bytes, pages.data()), 0);
        return 4096 *
               static_cast<uint64_t>(std::count_if(pages.begin(), pages.end(), [](auto p) { return (p & 1) != 0; }));
    };
    const uint8_t* const first = array.read(0);
    EXPECT_EQ(residentBytes(first, kMany), kMany);
    array.narrow(kMany / 64, 16, [](const uint8_t* from, uint8_t* to) { std::memcpy(to, from + 48, 16); });
    EXPECT_EQ(array.read(0), first);
    EXPECT_EQ(array.read(kMany / 64 - 1)[15], 1);
    EXPECT_LE(residentBytes(first, kMany), kMany / 2) << "a huge page is kept whole";
}

/// A program may have thousands of such files open: none takes a huge page of its own.
TEST(PagedArray, AFewRecordsTakeLittle) {
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "a sanitizer's own memory counts";
#endif
    std::vector<std::unique_ptr<PagedArray>> many;
    const auto residentPages = [] {
        std::ifstream file("/proc/self/statm");
        uint64_t all = 0, resident = 0;
        file >> all >> resident;
        return resident;
    };
    const uint64_t before = residentPages();
    for (int k = 0; k < 300; ++k) {
        many.push_back(std::make_unique<PagedArray>(".", 1 << 20, 28, 1000));
        many.back()->write(999)[0] = 1;
    }
    EXPECT_LT((residentPages() - before) * 4096, 300u * 64 << 10);
}

TEST(PagedArray, OfNoRecordsIsNone) {
    PagedArray none(".", 1 << 20, 12, 0);
    none.narrow(0, 4, [](const uint8_t*, uint8_t*) { FAIL(); });
    EXPECT_TRUE(none.status());
}

}  // namespace
}  // namespace stipple
