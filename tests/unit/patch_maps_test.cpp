// Maps of patches: exact as bytes, refused where they are damaged, and mips that know every texel that is looked at.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/rng.h"
#include "engine/reference/decode_map.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/patch_bytes.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/patch_map.h"
#include "tests/support/patch_scene.h"

namespace stipple {
namespace {

lod::Patch flat(uint32_t width, uint32_t height, double holes) {
    return test::patchOfHeights(
        width, height, [](double x, double y) { return 0.2 * x + 0.1 * y; }, holes);
}

/// Patches with maps of all kinds, one without.
std::vector<lod::Patch> ofAllKinds() {
    std::vector<lod::Patch> all;
    for (uint32_t density = 0; density <= 3; ++density) {
        lod::Patch& p = all.emplace_back(flat(23 + density, 18, 0.2));
        Rng rng(density);
        const auto texel = [&](double i, double j) {
            return static_cast<uint32_t>(120 + 100 * std::sin(i + j)) * 0x10101u + static_cast<uint32_t>(rng.below(8)) +
                   (static_cast<uint32_t>(rng.below(256)) << 24);
        };
        const auto normal = [](double i, double j) { return glm::vec3(std::sin(i), std::cos(j), 1.5); };
        if (density > 0)
            test::giveMap(p, density, texel, density > 1 ? normal : std::function<glm::vec3(double, double)>(),
                          density == 2);
    }
    return all;
}

/// The same, and some send light: beside colours, and alone.
std::vector<lod::Patch> ofAllKindsAndLight() {
    std::vector<lod::Patch> all = ofAllKinds();
    for (const size_t k : {size_t{0}, size_t{2}, size_t{3}}) {
        lod::Patch p = all[k];
        const lod::MapLevel level = lod::mapOf(p);
        Rng rng(k);
        p.map.light.assign(level.isKnown.size(), 0);
        for (size_t t = 0; t < level.isKnown.size(); ++t) {
            const float light = 9 * static_cast<float>(rng.uniform());
            if (level.isKnown[t] != 0 && rng.below(3) > 0)
                p.map.light[t] = lod::packLight({light, 0.1f * light, 0.5f}, rng.below(4) == 0);
        }
        all.push_back(p);
    }
    return all;
}

TEST(PatchMaps, LightComesBackExactlyAndCostsNothingWhereThereIsNone) {
    const std::vector<lod::Patch> all = ofAllKindsAndLight();
    const lod::PatchBytes encoded = lod::encodePatches(all);
    EXPECT_EQ(encoded.geometry + encoded.normals + encoded.colours + encoded.materials + encoded.mapColours +
                  encoded.mapNormals + encoded.mapMaterials + encoded.mapLight,
              encoded.bytes.size());
    EXPECT_GT(encoded.mapLight, 1000u);
    const auto decoded = lod::decodePatches(encoded.bytes, "here");
    ASSERT_TRUE(decoded) << decoded.error().line();
    ASSERT_EQ(decoded->size(), all.size());
    for (size_t k = 0; k < all.size(); ++k) {
        EXPECT_TRUE(all[k].map == (*decoded)[k].map) << k;
        EXPECT_EQ(all[k].colours, (*decoded)[k].colours) << k;
    }
    EXPECT_FALSE(lod::decodePatches(encoded.bytes, "here", {.map = 7})) << "the table tells of none";
    const lod::PatchBytes none = lod::encodePatches(ofAllKinds());
    EXPECT_EQ(none.mapLight, 0u);
    EXPECT_EQ(none.bytes.at(7), 1) << "as before there was light";
    // Alone it is the only map of its patch.
    const lod::PatchBlocks blocks = lod::blocksOf(all[4]);
    ASSERT_FALSE(blocks.blocks.empty());
    EXPECT_EQ(blocks.maps.size(), blocks.blocks.size() * shared::mapTexels(0));
}

TEST(PatchMaps, LightIsAsBrightAsItWas) {
    for (const float light : {0.0f, 0.004f, 0.3f, 1.0f, 1.01f, 2.0f, 77.7f, 30000.0f}) {
        const glm::vec3 back = lod::emissionOf(lod::packLight({light, 0.5f * light, 0}, false));
        EXPECT_NEAR(back.x, light, 0.01f * light + 2e-4f);
        EXPECT_NEAR(back.y, 0.5f * light, 0.01f * light + 2e-4f);
        EXPECT_EQ(back.z, 0);
    }
    EXPECT_EQ(lod::packLight({0, 0, 0}, false), 0u);
    EXPECT_TRUE(lod::keepsColour(lod::packLight({5, 5, 5}, true)));
    EXPECT_EQ(lod::emissionOf(lod::packLight({5, 5, 5}, true)), glm::vec3(0));
    for (const float odd : {HUGE_VALF, 1e30f, -1.0f})
        EXPECT_LE(lod::emissionOf(lod::packLight({odd, 0, 0}, false)).x, 32768);
}

TEST(PatchMaps, ComeBackExactly) {
    const std::vector<lod::Patch> all = ofAllKinds();
    const lod::PatchBytes encoded = lod::encodePatches(all);
    EXPECT_EQ(encoded.geometry + encoded.normals + encoded.colours + encoded.materials + encoded.mapColours +
                  encoded.mapNormals + encoded.mapMaterials,
              encoded.bytes.size());
    EXPECT_GT(std::min({encoded.mapColours, encoded.mapNormals, encoded.mapMaterials}), 0u);
    const auto decoded = lod::decodePatches(encoded.bytes, "here");
    ASSERT_TRUE(decoded) << decoded.error().line();
    ASSERT_EQ(decoded->size(), all.size());
    for (size_t k = 0; k < all.size(); ++k) {
        EXPECT_TRUE(all[k].map == (*decoded)[k].map) << k;
        EXPECT_EQ(all[k].colours, (*decoded)[k].colours) << k;
        EXPECT_EQ(all[k].heights, (*decoded)[k].heights) << k;
    }
    // What has no maps is as it was before there were any.
    EXPECT_EQ(lod::encodePatches(std::span(all).first(1)).bytes.at(7), 0);
}

TEST(PatchMaps, AreRefusedWhereTheyAreDamaged) {
    std::vector<lod::Patch> all = ofAllKindsAndLight();
    for (lod::Patch& p : all) ASSERT_EQ(lod::patchFault(p), "");
    const std::vector<uint8_t> whole = lod::encodePatches(all).bytes;
    for (size_t length = 0; length < whole.size(); length += 1 + length / 97) {
        const std::vector<uint8_t> part(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(length));
        EXPECT_FALSE(lod::decodePatches(part, "here")) << length;
    }
    Rng rng(1);
    size_t refused = 0;
    for (int k = 0; k < 1500; ++k) {
        std::vector<uint8_t> other = whole;
        other[rng.below(other.size())] ^= static_cast<uint8_t>(1u << rng.below(8));
        const auto decoded = lod::decodePatches(other, "here");
        refused += decoded ? 0 : 1;
        for (size_t p = 0; decoded && p < decoded->size(); ++p) EXPECT_EQ(lod::patchFault((*decoded)[p]), "");
    }
    EXPECT_GT(refused, 100u);
    // A map of another size than its patch.
    all[1].map.colours.pop_back();
    EXPECT_NE(lod::patchFault(all[1]), "");
    all[1].map.density = 4;
    EXPECT_NE(lod::patchFault(all[1]), "");
    all[4].map.light.pop_back();
    EXPECT_NE(lod::patchFault(all[4]), "");
}

/// As a store of one node has it, told to be of such maps.
Result<lod::Chunk> chunkOf(const lod::Patch& p, uint8_t told, lod::Hierarchy& h) {
    const std::vector<uint8_t> bytes = lod::encodePatches(std::span(&p, 1)).bytes;
    h.nodes.resize(1);
    setKind(h.nodes[0], lod::Kind::patches);
    h.nodes[0].records = lod::countBlocks(p);
    h.nodes[0].maps = told;
    return lod::traitsOf(lod::Codec::patches).decode(h, 0, bytes.data(), bytes.size(), "test", false);
}

TEST(PatchMaps, LargerThanTheTableSaysAreRefused) {
    const std::vector<lod::Patch> all = ofAllKindsAndLight();
    for (size_t k = 0; k < all.size(); ++k)
        for (uint8_t told = 0; told < 32; ++told) {
            if ((told & shared::kMapMaterials) != 0) continue;  // which tables do not tell
            lod::Hierarchy h;
            const auto chunk = chunkOf(all[k], told, h);
            const uint32_t density = all[k].map.density;
            const bool isEnough = told % 4u >= density && (density < 2 || (told & shared::kMapNormals) != 0) &&
                                  (all[k].map.light.empty() || (told & shared::kMapLight) != 0);
            ASSERT_EQ(chunk.has_value(), isEnough) << k << " " << int{told};
            if (chunk) EXPECT_LE(chunk->sizeBytes(), lod::decodedBytes(h, 0)) << "more than is counted on";
            if (chunk && told == lod::mapCodeOf(std::span(&all[k], 1)))
                EXPECT_EQ(chunk->sizeBytes(), lod::decodedBytes(h, 0));
        }
}

TEST(PatchMaps, OfMuchRoomForLittleAreRefused) {
    const auto ofSide = [](uint32_t side, size_t patches) {
        lod::Patch p;
        p.width = p.height = side;
        p.cells.assign(size_t{side - 1} * (side - 1), 0);
        p.heights.assign(size_t{side} * side, 0);
        p.normals = p.colours = std::vector<uint32_t>(p.heights.size(), 0);
        p.cells[0] = 1;
        for (const size_t s : {p.at(0, 0), p.at(1, 0), p.at(0, 1), p.at(1, 1)}) p.heights[s] = 7;
        test::giveMap(p, 3, [](double, double) { return 0x808080u; });
        return lod::encodePatches(std::vector<lod::Patch>(patches, p)).bytes;
    };
    EXPECT_TRUE(lod::decodePatches(ofSide(150, 1), "here"));
    EXPECT_FALSE(lod::decodePatches(ofSide(150, 5), "here")) << "7 million texels for 405";
}

/// Blocks of a patch, and where a place lies in them.
struct Blocks {
    lod::PatchBlocks of;
    /// What the map shows at a cell's place, a pixel of so many cells; nothing where no block has the cell.
    std::optional<reference::MapReader::Look> look(uint32_t i, uint32_t j, const glm::dvec2& in, double cells) const {
        for (const shared::PatchBlock& b : of.blocks) {
            const uint32_t u = i - b.place % 65536, v = j - b.place / 65536;
            if (u >= 16 || v >= 8) continue;
            return reference::MapReader(of.maps, b.map).look(glm::dvec2(u, v) + in, cells);
        }
        return {};
    }
};

// A white patch with holes is white wherever a drawn cell is looked at, however far away: nothing of what lies beside
// it is mixed in. Blocks agree where they meet.
TEST(PatchMaps, MixNothingThatIsNotThere) {
    for (const uint32_t density : {1u, 2u, 3u}) {
        lod::Patch p = flat(41, 29, 0.7);
        test::giveMap(p, density, [](double, double) { return 0xffffffu; });
        const Blocks blocks{lod::blocksOf(p)};
        Rng rng(density);
        double least = 1, leastBeside = 1;
        for (uint32_t j = 0; j + 1 < p.height; ++j)
            for (uint32_t i = 0; i + 1 < p.width; ++i)
                for (int n = 0; n < 6; ++n) {
                    const glm::dvec2 in = n < 4 ? glm::dvec2(n % 2, n / 2) : glm::dvec2(rng.uniform(), rng.uniform());
                    const auto look = blocks.look(i, j, in, std::exp2(6 * rng.uniform() - 4));
                    if (!look) continue;
                    double& to = p.hasCell(i, j) ? least : leastBeside;
                    to = std::min(to, look->colour.x);
                }
        EXPECT_GT(least, 1 - 1e-9) << density;
        EXPECT_LT(leastBeside, 0.5) << "the control: texels of cells that are not drawn are black";
    }
}

TEST(PatchMaps, MipsAreMeansOfLight) {
    lod::Patch p = flat(33, 17, 0);
    const auto isWhite = [](double i, double j) { return (std::lround(8 * i) + std::lround(8 * j)) % 2 == 0; };
    test::giveMap(p, 3, [&](double i, double j) { return isWhite(i, j) ? 0xffffffu : 0u; });
    // A checker of single texels is grey on every level above: half the light, 188 of 255.
    EXPECT_TRUE(std::all_of(p.colours.begin(), p.colours.end(),
                            [](uint32_t c) { return std::abs(static_cast<int>(c & 255u) - 188) <= 2; }));
    const Blocks blocks{lod::blocksOf(p)};
    for (const double cells : {0.25, 1.0, 8.0, 100.0})
        EXPECT_NEAR(blocks.look(19, 9, {0.3, 0.6}, cells)->colour.x, 0.5, 0.02) << cells;
    EXPECT_NEAR(blocks.look(19, 9, {0.25, 0.5}, 0.01)->colour.x, isWhite(19.25, 9.5) ? 1 : 0, 1e-9);
    // A slope stays that slope, whatever the level: means of neighbours do not shift.
    lod::Patch slope = flat(33, 17, 0);
    test::giveMap(slope, 3, [](double i, double) { return static_cast<uint32_t>(std::lround(40 + 5 * i)); });
    const Blocks of{lod::blocksOf(slope)};
    for (const double cells : {0.01, 0.5, 2.0, 4.0})
        EXPECT_NEAR(255 * shared::srgbFromLinear(static_cast<float>(of.look(15, 8, {0.5, 0.5}, cells)->colour.x)),
                    40 + 5 * 15.5, 1.5)
            << cells;
}

// The same by the formulas of the backends, which share none with the reader above.
TEST(PatchMaps, LevelsLieWhereTheFormatSays) {
    for (const uint32_t density : {0u, 1u, 2u, 3u}) {
        uint32_t first = 0;
        for (uint32_t l = 0; l < shared::mapLevels(density); ++l) {
            EXPECT_EQ(shared::mapLevelFirst(density, l), first) << density << ", level " << l;
            const double k = std::exp2(static_cast<double>(density) - l);
            first += static_cast<uint32_t>((16 * k + 1) * (8 * k + 1));
        }
        EXPECT_EQ(shared::mapTexels(density), first);
        const uint32_t colours = density > 0 ? first : 0;  // of none there are no normals either
        EXPECT_EQ(shared::mapWords(density | shared::kMapNormals), 2 * colours);
        EXPECT_EQ(shared::mapWords(density | shared::kMapLight), colours + first);
        EXPECT_EQ(shared::mapLightFirst(density | shared::kMapLight), colours);
        EXPECT_EQ(shared::mapLightFirst(density | shared::kMapNormals | shared::kMapLight), 2 * colours);
    }
    EXPECT_EQ(shared::mapWords(0), 0u);
}

}  // namespace
}  // namespace stipple
