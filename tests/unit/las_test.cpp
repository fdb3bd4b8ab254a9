#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "lod/import/import.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

std::string slurp(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {(std::istreambuf_iterator<char>(in)), {}};
}

std::vector<glm::ivec3> randomIntegers(size_t count, uint64_t seed, int extent) {
    Rng rng(seed);
    std::vector<glm::ivec3> points(count);
    for (glm::ivec3& p : points)
        for (int a = 0; a < 3; ++a) p[a] = static_cast<int>(rng.below(static_cast<uint64_t>(extent))) - extent / 2;
    return points;
}

TEST(Las, ScannerIntegersComeBackExactlyAtAnyExtent) {
    const auto executor = makeSerialExecutor();
    for (const int extent : {7, 1000, 200'000, 2'000'000'000}) {
        const test::TempFolder folder;
        const auto points = randomIntegers(3000, 5, extent);
        test::writeLas(folder / "a.las", points, 0.001, {4.1e6, 5.2e5, 4.9e6});
        const auto store = test::buildAndOpen(folder / "a.las", folder / "a.stipple", *executor, 64);
        EXPECT_EQ(store->description.roundingUnits, 0.0);
        EXPECT_EQ(store->hierarchy.unit, 0.001);
        glm::ivec3 lo = points[0];
        for (const glm::ivec3& p : points) lo = glm::min(lo, p);
        std::vector<std::array<int64_t, 3>> expected;
        for (const glm::ivec3& p : points)
            expected.push_back({int64_t{p.x} - lo.x, int64_t{p.y} - lo.y, int64_t{p.z} - lo.z});
        std::sort(expected.begin(), expected.end());
        EXPECT_EQ(test::leafLattice(*store), expected) << "extent " << extent;
    }
}

TEST(Las, EightBitColoursInSixteenBitFieldsAreRecognised) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    const auto points = randomIntegers(100, 1, 1000);
    test::writeLas(folder / "wide.las", points, 0.01, {0, 0, 0});
    std::string bytes = slurp(folder / "wide.las");
    for (size_t i = 0; i < points.size(); ++i)
        for (size_t c = 0; c < 3; ++c) {  // 0x8080 -> 0x0080
            bytes[227 + 26 * i + 20 + 2 * c + 1] = 0;
        }
    std::ofstream(folder / "narrow.las", std::ios::binary) << bytes;
    std::array<uint32_t, 2> colours{};
    size_t k = 0;
    for (const char* name : {"wide", "narrow"}) {
        const auto store = test::buildAndOpen(folder / (std::string(name) + ".las"),
                                              folder / (std::string(name) + ".stipple"), *executor);
        colours.at(k++) = readChunk(*store, 0)->records[0].colour & 0xffffffu;
    }
    EXPECT_EQ(colours[0], 0xc04080u);
    EXPECT_EQ(colours[0], colours[1]);
}

TEST(Las, EveryTruncatedLengthAndEveryHeaderByteIsSurvived) {
    const test::TempFolder folder;
    test::writeLas(folder / "a.las", randomIntegers(5, 1, 100), 0.01, {0, 0, 0});
    const std::string whole = slurp(folder / "a.las");
    const auto tryFile = [&](const std::string& bytes) -> Result<uint64_t> {
        std::ofstream(folder / "b.las", std::ios::binary) << bytes;
        auto source = openLas(folder / "b.las");
        if (!source) return tl::unexpected(source.error());
        return readPoints(*source);
    };
    for (size_t length = 0; length < whole.size(); ++length) ASSERT_FALSE(tryFile(whole.substr(0, length))) << length;
    ASSERT_EQ(*tryFile(whole), 5u);
    Rng rng(3);
    for (size_t at = 0; at < 227; ++at)
        for (int k = 0; k < 4; ++k) {
            std::string changed = whole;
            changed[at] = static_cast<char>(rng.next());
            const auto count = tryFile(changed);  // fine or an error, but never more points than the file can hold
            if (count) EXPECT_LE(*count, (whole.size() - 227) / 20);
        }
}

TEST(Las, AnOffsetOfWholeStepsBetweenFilesStaysExact) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    const auto points = randomIntegers(500, 2, 10000);
    test::writeLas(folder / "a.las", points, 0.01, {1000, 0, 0});
    test::writeLas(folder / "b.las", points, 0.01, {1000.37, 0, -2});
    const BuildReport report = test::build({folder / "a.las", folder / "b.las"}, folder / "c.stipple", *executor);
    EXPECT_EQ(report.pointsOut, 1000u);
    EXPECT_EQ(openStore(folder / "c.stipple")->description.roundingUnits, 0.0);
    // Not whole steps, but whole fifths of a step: a finer lattice holds both.
    test::writeLas(folder / "f.las", points, 0.01, {1000.374, 0, 0});
    test::build({folder / "a.las", folder / "f.las"}, folder / "g.stipple", *executor);
    EXPECT_EQ(openStore(folder / "g.stipple")->description.roundingUnits, 0.0);
    EXPECT_NEAR(openStore(folder / "g.stipple")->hierarchy.unit, 0.002, 1e-15);
    // No lattice of a thousandth of a step holds both: rounded, and it says so.
    test::writeLas(folder / "d.las", points, 0.01, {1000.3741234567, 0, 0});
    test::build({folder / "a.las", folder / "d.las"}, folder / "e.stipple", *executor);
    const double rounding = openStore(folder / "e.stipple")->description.roundingUnits;
    EXPECT_GT(rounding, 0.003);
    EXPECT_LE(rounding, 0.005);
}

}  // namespace
}  // namespace stipple::lod
