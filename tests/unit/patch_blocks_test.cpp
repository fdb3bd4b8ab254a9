// Blocks of patches: every drawn cell is in one, with the samples around it.
#include <gtest/gtest.h>

#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"
#include "lod/primitives/patch_blocks.h"
#include "lod/store/patch_bytes.h"
#include "tests/support/patch_scene.h"

namespace stipple {
namespace {

TEST(PatchBlocks, HoldEachDrawnCellOnceWithItsSamples) {
    for (const auto& [width, height] :
         {std::pair{2u, 2u}, {3u, 9u}, {16u, 8u}, {17u, 9u}, {18u, 10u}, {33u, 25u}, {70u, 5u}})
        for (const double holes : {0.0, 0.5, 0.98}) {
            const lod::Patch p = test::patchOfHeights(
                width, height, [](double x, double y) { return 0.2 * x + 0.1 * y; }, holes);
            const lod::PatchBlocks of = lod::blocksOf(p, 7);
            EXPECT_EQ(of.blocks.size(), lod::countBlocks(p));
            EXPECT_EQ(of.blocks.size(), of.planes.size());
            std::vector<uint32_t> times(p.cells.size(), 0);
            for (const shared::PatchBlock& b : of.blocks) {
                EXPECT_EQ(b.number, 7u);
                EXPECT_NE(b.cells[0] | b.cells[1] | b.cells[2] | b.cells[3], 0u) << "a block without a cell";
                for (uint32_t cell = 0; cell < 128; ++cell) {
                    if ((b.cells[cell / 32] >> cell % 32 & 1u) == 0) continue;
                    const uint32_t i = b.place % 65536 + cell % 16, j = b.place / 65536 + cell / 16;
                    ASSERT_LT(i + 1, width);
                    ASSERT_LT(j + 1, height);
                    ++times[size_t{j} * (width - 1) + i];
                    for (uint32_t k = 0; k < 4; ++k) {
                        const uint32_t s = 17 * (cell / 16 + k / 2) + cell % 16 + k % 2;
                        const size_t from = p.at(i + k % 2, j + k / 2);
                        EXPECT_EQ(b.heights[s / 2] >> (16 * (s % 2)) & 0xffffu, p.heights[from]);
                        EXPECT_EQ(b.normals[s], p.normals[from]);
                        EXPECT_EQ(b.colours[s], p.colours[from]);
                    }
                }
            }
            for (size_t c = 0; c < times.size(); ++c) EXPECT_EQ(times[c], p.cells[c]) << c;
        }
}

TEST(PatchBlocks, AreCutAlongTheDiagonalThatTheFormatSays) {
    Rng rng(3);
    for (int k = 0; k < 20'000; ++k) {
        int h[4];  // NOLINT
        for (int& v : h) v = 1 + static_cast<int>(rng.below(k % 2 == 0 ? 3 : 65535));
        const auto& expected = lod::cellTriangles(h[0], h[1], h[2], h[3]);
        for (uint32_t t = 0; t < 2; ++t) {
            const uint32_t corners = shared::patchTriangle(40, h[0], h[1], h[2], h[3], t);
            std::array<uint32_t, 3> found{}, want{};
            for (uint32_t c = 0; c < 3; ++c) {
                const uint32_t off = (corners >> (8 * c) & 255u) - 40;
                found.at(c) = off % 17 + 2 * (off / 17);
                want.at(c) = expected.at(3 * t + c);
            }
            EXPECT_EQ(found, want);
        }
    }
}

TEST(PatchBlocks, OfAnotherNumberThanThePayloadSaysAreRefused) {
    const lod::Patch p = test::patchOfHeights(
        40, 20, [](double, double) { return 0; }, 0.3);
    const std::vector<uint8_t> bytes = lod::encodePatches(std::span(&p, 1)).bytes;
    lod::Hierarchy h;
    h.nodes.resize(1);
    setKind(h.nodes[0], lod::Kind::patches);
    for (const uint32_t more : {0u, 1u}) {
        h.nodes[0].records = lod::countBlocks(p) + more;
        const auto chunk = lod::traitsOf(lod::Codec::patches).decode(h, 0, bytes.data(), bytes.size(), "test", false);
        ASSERT_EQ(chunk.has_value(), more == 0);
        if (chunk) EXPECT_EQ(chunk->sizeBytes(), lod::decodedBytes(h, 0));
    }
}

}  // namespace
}  // namespace stipple
