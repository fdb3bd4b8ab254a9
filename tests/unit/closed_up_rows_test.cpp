// Rows of which only some pixels show points: their texels are made, packed and kept side by side, without the gaps
// (Kernels::resolveRow, openUpPacked, Level::closeUp). On every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/rng.h"
#include "engine/cpu/pyramid.h"
#include "shaders/shared/pack.h"
#include "tests/unit/kernel_formulas.h"

namespace stipple {
namespace {

using namespace shared;
using cpu::kPad, cpu::kTexelGroup, cpu::kTile;

cpu::RowBits randomBits(Rng& rng, uint32_t n, double share) {
    cpu::RowBits bits;
    for (uint32_t i = 0; i < n; ++i)
        if (rng.uniform(0, 1) < share) bits.add(i);
    return bits;
}
bool has(const cpu::RowBits& bits, uint32_t i) { return (bits.of[i / 64] >> i % 64 & 1) != 0; }

constexpr std::array kShares{0.0, 0.02, 0.1, 0.25, 0.5, 0.9, 1.0};

TEST(ClosedUpRows, AreOpenedUpToTheirPlaces) {
    test::forKernels([](const cpu::Kernels& k, const FrameConstants&) {
        Rng rng(5);
        constexpr size_t kPlanes = 6;
        constexpr uint32_t kUntouched = 0xdeadbeef;
        // (Up to a group behind the last is read.)
        std::array<std::vector<uint32_t>, kPlanes> from, to;
        for (int round = 0; round < 700; ++round) {
            const cpu::RowBits bits = randomBits(rng, kTile, kShares.at(static_cast<size_t>(round) % kShares.size()));
            const bool hasNormals = round % 2 == 0, hasSurface = round % 3 == 0;
            const auto planesOf = [&](auto& of) {
                return cpu::Planes{
                    reinterpret_cast<float*>(of[0].data()), of[1].data(), of[2].data(), of[3].data(), of[4].data(),
                    hasSurface ? of[5].data() : nullptr};
            };
            for (auto& plane : from) {
                plane.resize(bits.count() + kTexelGroup);
                for (uint32_t& word : plane) word = static_cast<uint32_t>(rng.below(uint64_t{1} << 32));
            }
            for (auto& plane : to) plane.assign(kTile, kUntouched);
            k.openUpPacked(planesOf(from), bits, hasNormals, planesOf(to));
            for (size_t p = 0; p < kPlanes; ++p) {
                const bool isMeant = p == 3 ? hasNormals : p != 5 || hasSurface;
                size_t next = 0;
                for (uint32_t i = 0; i < kTile; ++i) {
                    const bool isWritten = isMeant && bits.group(i / kTexelGroup) != 0;
                    const uint32_t expected = !isWritten ? kUntouched : has(bits, i) ? from.at(p).at(next++) : 0;
                    ASSERT_EQ(to.at(p).at(i), expected) << "plane " << p << ", texel " << i;
                }
                ASSERT_EQ(next, isMeant ? bits.count() : 0);
            }
        }
    });
}

/// Planes of a row whose values are of the texels that are there.
std::vector<const float*> planesOf(const cpu::TexelRow& row) {
    return {row.depth, row.radius, row.thickness, row.x,     row.y,        row.perpX,    row.perpY,
            row.red,   row.green,  row.blue,      row.share, row.metallic, row.roughness};
}

/// Rows as older ones have left them.
void fill(cpu::TexelRow& row, float value) {
    for (float* const plane : {row.depth, row.radius, row.thickness, row.x, row.y, row.perpX, row.perpY, row.red,
                               row.green, row.blue, row.share, row.metallic, row.roughness})
        std::fill_n(plane, cpu::TexelRow::kSize, value);
}

/// One row of `of`, resolved by one table of kernels.
struct ResolvedRow {
    std::unique_ptr<cpu::TexelRow> row = std::make_unique<cpu::TexelRow>();
    std::unique_ptr<cpu::ClosedUpRow> closedUp = std::make_unique<cpu::ClosedUpRow>();
    float largest = 0;

    void resolve(const cpu::Kernels& k, const FrameConstants& f, const test::SomeShown& of, uint32_t n, bool isExact,
                 std::array<uint64_t, kTile> keys) {
        static const cpu::Tables tables = cpu::makeTables();
        static const std::array<cpu::ResolveKind, kKindNothing> none{};
        cpu::ResolveInput in{};
        in.blocks = &of.block;
        in.exactPoints = in.needsDepths = isExact;
        in.roundsPoints = isExact && f.hasMaterials == 0;
        in.ofKind = none.data();
        fill(*row, 7);
        fill(closedUp->texels, 7);
        row->hasMaterials = f.hasMaterials != 0;
        closedUp->of = {};
        closedUp->of.add(3);  // of an older row
        largest = 0;
        ASSERT_TRUE(k.resolveRow(f, tables, in, keys.data(), 200, 100, n, *row, *closedUp, largest, {}));
        for (uint32_t i = 0; i < n; ++i) ASSERT_EQ(keys.at(i), kNoKey);
    }
};

TEST(ClosedUpRows, AreTheTexelsOfTheRowWithoutGaps) {
    test::forKernels([&](const cpu::Kernels& k, FrameConstants f) {
        f.firstBlock.of[kKindCurves] = f.firstBlock.of[kKindTriangles] = f.firstBlock.of[kKindPatches] =
            f.firstBlock.of[kKindDiscs] = 1;
        Rng rng(6);
        size_t closed = 0;
        ResolvedRow some, all;
        for (int round = 0; round < 140; ++round) {
            const uint32_t n = round % 5 == 0 ? 77 : kTile;
            const bool isExact = round % 2 == 0;
            test::SomeShown of(rng, kShares.at(static_cast<size_t>(round) % kShares.size()));
            of.node.base = {0, 0, 12};
            of.keys[0] = visibilityKey(floatBitsToUint(5.0f), 0);
            f.hasMaterials = round % 3 == 0 ? 1 : 0;
            // The same pixels where all others show a point, too: nothing is closed up there.
            auto filled = of.keys;
            for (uint64_t& key : filled)
                if (key == kNoKey) key = visibilityKey(floatBitsToUint(6.0f), rng.below(kRecordsPerBlock));
            all.resolve(k, f, of, n, isExact, filled);
            some.resolve(k, f, of, n, isExact, of.keys);
            ASSERT_FALSE(all.closedUp->of.isAny()) << "there is nothing to close up";
            uint32_t there = 0;
            float largest = 0;
            const std::vector<const float*> rows = planesOf(*some.row), expected = planesOf(*all.row),
                                            closedUp = planesOf(some.closedUp->texels);
            const size_t planes = f.hasMaterials != 0 ? 13 : 10;
            const bool hasGaps = std::count(of.keys.begin(), of.keys.begin() + n, kNoKey) > 0;
            for (uint32_t i = 0; i < n; ++i) {
                const uint32_t at = kPad + i;
                ASSERT_EQ(has(some.closedUp->of, i), hasGaps && of.keys[i] != kNoKey);
                if (of.keys[i] == kNoKey) {
                    ASSERT_EQ(some.row->depth[at], 0);
                    ASSERT_EQ(some.row->radius[at], 0);
                    if (f.hasMaterials != 0) ASSERT_EQ(some.row->share[at], 0);
                    continue;
                }
                ASSERT_GT(some.row->depth[at], 0);
                largest = std::max(largest, all.row->radius[at]);
                for (size_t p = 0; p < planes; ++p) {
                    ASSERT_EQ(std::memcmp(rows[p] + at, expected[p] + at, sizeof(float)), 0) << "plane " << p;
                    if (hasGaps)
                        ASSERT_EQ(std::memcmp(closedUp[p] + kPad + there, expected[p] + at, sizeof(float)), 0)
                            << "plane " << p << ", texel " << i;
                }
                ++there;
            }
            ASSERT_EQ(some.largest, largest);
            ASSERT_EQ(some.closedUp->of.count(), hasGaps ? there : 0);
            closed += hasGaps ? 1 : 0;
        }
        EXPECT_GT(closed, 80u);
    });
}

TEST(ClosedUpRows, AreNoneWherePointsAreNothing) {
    test::forKernels([&](const cpu::Kernels& k, FrameConstants f) {
        f.firstBlock.of[kKindCurves] = f.firstBlock.of[kKindTriangles] = f.firstBlock.of[kKindPatches] =
            f.firstBlock.of[kKindDiscs] = 1;
        Rng rng(8);
        test::SomeShown of(rng, 0.3);
        of.node.base = {0, 0, -12};  // behind the eye; no frame claims pixels for such
        ResolvedRow row;
        row.resolve(k, f, of, kTile, false, of.keys);
        ASSERT_FALSE(row.closedUp->of.isAny()) << "a group of nothing is not kept";
        for (uint32_t i = 0; i < kTile; ++i) ASSERT_EQ(row.row->depth[kPad + i], 0);
    });
}

/// Rows of a level, now closed up, now not, now empty: each is read back as it was written last, whatever was before.
TEST(ClosedUpRows, AreReadBackFromALevelInTheirPlaces) {
    test::forKernels([](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(7);
        const auto executor = makeSerialExecutor();
        const auto row = std::make_unique<cpu::TexelRow>(), back = std::make_unique<cpu::TexelRow>();
        const auto closedUp = std::make_unique<cpu::ClosedUpRow>();
        for (const uint32_t width : {1u, 15u, 77u, 129u, 300u}) {
            constexpr uint32_t kHeight = 35;  // of two bands
            cpu::Pyramid pyramid(*executor, k);
            pyramid.resize(width, kHeight, false);
            pyramid.beginFrame(f, false);
            cpu::Level& level = pyramid.level(0);
            std::vector<std::vector<Texel>> written(kHeight, std::vector<Texel>(width));  // packed and unpacked
            for (int round = 0; round < 400; ++round) {
                const auto y = static_cast<uint32_t>(rng.below(kHeight));
                const auto x = static_cast<uint32_t>(rng.below((width + kTile - 1) / kTile)) * kTile;
                const uint32_t n = std::min(kTile, width - x);
                const cpu::RowBits bits = randomBits(rng, n, kShares.at(static_cast<size_t>(round) % kShares.size()));
                fill(*row, 0);
                row->hasTubes = row->hasMaterials = back->hasTubes = back->hasMaterials = false;
                closedUp->texels.hasTubes = closedUp->texels.hasMaterials = false;
                fill(closedUp->texels, 0);
                uint32_t there = 0;
                for (uint32_t i = 0; i < n; ++i) {
                    const Texel t = has(bits, i) ? test::randomTexel(rng, false) : Texel{};
                    written[y][x + i] = has(bits, i) ? unpackTexel(packTexel(t)) : Texel{};
                    test::put(*row, kPad + i, t);
                    if (has(bits, i)) test::put(closedUp->texels, kPad + there++, t);
                }
                if (!bits.isAny()) {
                    level.empty(y, x, n);
                } else if (round % 2 == 0) {
                    k.packRow(closedUp->texels, cpu::wholeGroups(there), level.planesClosedUp(y, x, there));
                    level.closeUp(y, x, n, bits);
                } else {
                    level.hold(y, x, n, k.packRow(*row, n, level.planes(y, x)));
                }
                for (uint32_t tile = 0; tile < width; tile += kTile) {
                    const uint32_t count = std::min(kTile, width - tile);
                    fill(*back, 7);
                    const bool any = pyramid.loadRow(level, y, tile, count, *back);
                    bool isThere = false;
                    for (uint32_t i = 0; i < count; ++i) {
                        const Texel& t = written[y][tile + i];
                        isThere = isThere || t.depth > 0;
                        ASSERT_EQ(back->depth[kPad + i], t.depth) << width << " wide, row " << y << ", " << tile + i;
                        ASSERT_LE(test::farthest(*back, kPad + i, t), 1);
                    }
                    ASSERT_EQ(any, isThere);
                    ASSERT_EQ(level.mayHold(y, tile, count), isThere);
                }
            }
        }
    });
}

}  // namespace
}  // namespace stipple
