// Records that lie side by side in memory, and those of which a few pages are there, are the same records.
#include "engine/base/paged_array.h"

#include <gtest/gtest.h>

#include <filesystem>

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

TEST(PagedArray, OfNoRecordsIsNone) {
    PagedArray none(".", 1 << 20, 12, 0);
    none.narrow(0, 4, [](const uint8_t*, uint8_t*) { FAIL(); });
    EXPECT_TRUE(none.status());
}

}  // namespace
}  // namespace stipple
