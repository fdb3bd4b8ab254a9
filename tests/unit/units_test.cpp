// Numbers as people write and read them.
#include "engine/base/units.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stipple {
namespace {

TEST(ParseCount, KnowsUnitsAndRefusesTheRest) {
    EXPECT_EQ(parseCount("0"), 0u);
    EXPECT_EQ(parseCount("1000000"), 1'000'000u);
    EXPECT_EQ(parseCount("500k"), 500'000u);
    EXPECT_EQ(parseCount("1.5M"), 1'500'000u);
    EXPECT_EQ(parseCount("2G"), 2'000'000'000u);
    EXPECT_EQ(parseCount("0.3k"), 300u);
    EXPECT_EQ(parseCount("1e6"), 1'000'000u);
    for (const char* bad : {"", "k", "x", "0x10", "-1", "-0", "nan", "inf", "1.5", "1Mx", "1MiB", "1e30", " 1", "1 "})
        EXPECT_FALSE(parseCount(bad)) << "'" << bad << "'";
}

TEST(ParseBytes, RefusesWhatIsNoPlainNumber) {
    EXPECT_EQ(parseBytes("2g"), uint64_t{2} << 30);
    EXPECT_EQ(parseBytes("1.5KiB"), 1536u);
    for (const char* bad : {"0x10", "0x10M", "inf", "-1", "1 G"}) EXPECT_EQ(parseBytes(bad), 0u) << bad;
}

TEST(LatticeText, HasTheDecimalsOfTheScannersUnit) {
    EXPECT_EQ(latticeText(500000 + 12 * 0.01, 0.01, 500000), "500000.12");
    EXPECT_EQ(latticeText(5400000 + 29 * 0.01, 0.01, 5400000), "5400000.29");
    EXPECT_EQ(latticeText(7, 0.01), "7.00");
    EXPECT_EQ(latticeText(3 * 0.00025, 0.00025), "0.00075");
    EXPECT_EQ(latticeText(0.1 + 0.2, 0.1), "0.3") << "not 0.30000000000000004";
    EXPECT_EQ(latticeText(-1e-17, 0.01), "0.00");
    EXPECT_EQ(latticeText(1234.5678 + 2 * 0.01, 0.01, 1234.5678), "1234.5878") << "the offset's decimals too";
    EXPECT_EQ(latticeText(49.02539999999999 + 164 * 0.0001, 0.0001, 49.02539999999999), "49.0418")
        << "an offset that somebody computed";
    EXPECT_EQ(latticeText(3815.999999999953 - 15, 0.001, 3815.999999999953), "3801.000");
    EXPECT_EQ(latticeValue(49.02539999999999 + 164 * 0.0001, 0.0001, 49.02539999999999), 49.0418);
    EXPECT_EQ(latticeText(12, 1), "12");
    // No decimal lattice: the shortest text that gives the number back.
    EXPECT_EQ(latticeText(0.375, 0.125), "0.375");
    EXPECT_EQ(latticeText(1.0 / 3, 1.0 / 3), "0.3333333333333333");
    EXPECT_EQ(latticeValue(0.1 + 0.2, 0.1), 0.3);
}

TEST(LatticeText, GivesEveryIntegerBack) {
    for (const double unit : {0.01, 0.001, 0.00025, 1e-7, 1.4e-8})
        for (int64_t n = -2'000'000'000; n < 2'000'000'000; n += 104'729'333) {
            const double origin = 0, value = origin + static_cast<double>(n) * unit;
            EXPECT_EQ(std::llround(std::stod(latticeText(value, unit, origin)) / unit), n) << unit;
        }
}

}  // namespace
}  // namespace stipple
