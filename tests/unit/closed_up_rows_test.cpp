// Rows of which only some pixels show points: their texels are made, packed and kept side by side, without the gaps
// (Kernels::resolveRow, spreadPacked, Level::closeUp). On every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <vector>

#include "engine/base/rng.h"
#include "engine/cpu/level.h"
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

TEST(ClosedUpRows, AreSpreadToTheirPlaces) {
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
            k.spreadPacked(planesOf(from), bits, hasNormals, planesOf(to));
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

/// Points of one block, of which a row shows some.
struct SomeShown {
    SomeShown(Rng& rng, double share) : node(test::randomNode(rng)), records(kRecordsPerBlock) {
        const auto word = [&] { return static_cast<uint32_t>(rng.below(uint64_t{1} << 32)); };
        for (PointRecord& r : records) {
            r = {word(), word(), word(), word()};
            r.normal = std::min(r.normal & 0xffffu, 65534u) | std::min(r.normal >> 16, 65534u) << 16;
        }
        for (uint64_t& key : keys)
            key = rng.uniform(0, 1) < share
                      ? visibilityKey(floatBitsToUint(test::uniform(rng, 3, 9)), rng.below(kRecordsPerBlock))
                      : kNoKey;
        keys[rng.below(kTile)] = visibilityKey(floatBitsToUint(5.0f), 0);  // one at least
        block = {.records = records.data(), .node = &node};
    }
    DrawNode node;
    std::vector<PointRecord> records;
    std::array<uint64_t, kTile> keys{};
    cpu::BlockSource block;
};

/// Planes of a row whose values are of the texels that are there.
std::vector<const float*> planesOf(const cpu::TexelRow& row) {
    return {row.depth, row.radius, row.thickness, row.x,     row.y,        row.perpX,    row.perpY,
            row.red,   row.green,  row.blue,      row.share, row.metallic, row.roughness};
}

TEST(ClosedUpRows, AreTheTexelsThatTheRowHas) {
    const cpu::Tables tables = cpu::makeTables();
    test::forKernels([&](const cpu::Kernels& k, FrameConstants f) {
        f.firstBlock.of[kKindCurves] = f.firstBlock.of[kKindTriangles] = f.firstBlock.of[kKindPatches] =
            f.firstBlock.of[kKindDiscs] = 1;
        Rng rng(6);
        const std::array<cpu::ResolveKind, kKindNothing> none{};
        size_t closed = 0, whole = 0;
        for (int round = 0; round < 140; ++round) {
            const uint32_t n = round % 5 == 0 ? 77 : kTile;
            SomeShown of(rng, kShares.at(static_cast<size_t>(round) % kShares.size()));
            if (n < kTile) of.keys[0] = visibilityKey(floatBitsToUint(5.0f), 0);
            cpu::ResolveInput in{};
            in.blocks = &of.block;
            in.exactPoints = in.needsDepths = round % 2 == 0;
            in.ofKind = none.data();
            f.hasMaterials = round % 3 == 0 ? 1 : 0;
            const auto row = std::make_unique<cpu::TexelRow>();
            const auto closedUp = std::make_unique<cpu::ClosedUpRow>();
            row->hasMaterials = f.hasMaterials != 0;
            const bool isBehind = round % 10 == 9;  // the eye: such points are nothing (and no frame claims pixels for)
            of.node.base = {0, 0, isBehind ? -12.0f : 12.0f};
            closedUp->of.add(3);  // of an earlier row
            float largest = 0, expectedLargest = 0;
            auto keys = of.keys;
            ASSERT_TRUE(k.resolveRow(f, tables, in, keys.data(), 200, 100, n, *row, *closedUp, largest, {}));
            const auto there = static_cast<uint32_t>(n - std::count(of.keys.begin(), of.keys.begin() + n, kNoKey));
            if (isBehind) {
                ASSERT_FALSE(in.exactPoints);
                ASSERT_FALSE(closedUp->of.isAny()) << "no group of nothing may be kept";
                for (uint32_t i = 0; i < n; ++i) ASSERT_EQ(row->depth[kPad + i], 0);
                continue;
            }
            for (uint32_t i = 0; i < n; ++i) expectedLargest = std::max(expectedLargest, row->radius[kPad + i]);
            EXPECT_EQ(largest, expectedLargest);
            if (there == n) {
                ++whole;
                ASSERT_FALSE(closedUp->of.isAny()) << "there is nothing to close up";
                for (uint32_t i = 0; i < n; ++i) ASSERT_GT(row->depth[kPad + i], 0);
                continue;
            }
            ++closed;
            ASSERT_EQ(closedUp->count, there);
            ASSERT_EQ(closedUp->of.count(), there);
            const std::vector<const float*> rows = planesOf(*row), closedUps = planesOf(closedUp->texels);
            uint32_t next = 0;
            for (uint32_t i = 0; i < n; ++i) {
                ASSERT_EQ(has(closedUp->of, i), of.keys[i] != kNoKey);
                if (!has(closedUp->of, i)) {
                    ASSERT_EQ(row->depth[kPad + i], 0);
                    ASSERT_EQ(row->radius[kPad + i], 0);
                    ASSERT_EQ(row->share[kPad + i], 0);
                    continue;
                }
                ASSERT_GT(row->depth[kPad + i], 0);
                for (size_t p = 0; p < (row->hasMaterials ? 13u : 10u); ++p)
                    ASSERT_EQ(std::memcmp(rows[p] + kPad + i, closedUps[p] + kPad + next, sizeof(float)), 0)
                        << "plane " << p << ", texel " << i;
                ++next;
            }
        }
        EXPECT_GT(closed, 80u);
        EXPECT_GT(whole, 10u);
    });
}

TEST(ClosedUpRows, OfALevelAreGoneOnceTheRowIsAnother) {
    constexpr uint32_t kWidth = 300, kHeight = 4;  // of its third tile 44 columns
    cpu::Level level;
    level.resize(kWidth, kHeight, false, true);
    Rng rng(7);
    for (int round = 0; round < 300; ++round) {
        const auto y = static_cast<uint32_t>(rng.below(kHeight)), tile = static_cast<uint32_t>(rng.below(3));
        const uint32_t x = tile * kTile, n = std::min(kTile, kWidth - x);
        const cpu::RowBits bits = randomBits(rng, n, kShares.at(static_cast<size_t>(round) % kShares.size()));
        if (!bits.isAny()) continue;
        uint32_t groups = 0;
        for (uint32_t i = 0; i < n; ++i) groups |= has(bits, i) ? 1u << i / kTexelGroup : 0u;
        level.closeUp(y, x, bits);
        ASSERT_TRUE(std::equal(bits.of, bits.of + 2, level.closedUp(y, x).of));
        ASSERT_EQ(level.held(y, x, n), groups);
        ASSERT_TRUE(level.mayHold(y, x, n));
        if (round % 3 == 0) continue;
        const uint32_t others = round % 3 == 1 ? 0 : 1;
        if (others == 0)
            level.empty(y, x, n);
        else
            level.hold(y, x, n, others);
        ASSERT_FALSE(level.closedUp(y, x).isAny());
        ASSERT_EQ(level.held(y, x, n), others);
    }
    cpu::Level coarse;
    coarse.resize(kWidth, kHeight, false, false);
    coarse.hold(1, 0, kTile, 5);
    EXPECT_FALSE(coarse.closedUp(1, 0).isAny()) << "of other levels none is";
}

}  // namespace
}  // namespace stipple
