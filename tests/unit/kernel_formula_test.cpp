// The kernels of every instruction set against the scalar formulas of shaders/shared, value by value. Where a kernel
// calls the formula itself nothing may differ; where it writes it out again (GCC turns only that into SIMD), units in
// the last place.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "engine/cpu/pyramid.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/shade.h"
#include "shaders/shared/shadow.h"
#include "shaders/shared/splat_disc.h"
#include "shaders/shared/splat_size.h"
#include "shaders/shared/surface.h"
#include "tests/unit/kernel_formulas.h"

namespace stipple {
namespace {

using namespace shared;
using namespace test;

PointRecord randomRecord(Rng& rng) {
    const auto word = [&] { return static_cast<uint32_t>(rng.below(uint64_t{1} << 32)); };
    PointRecord r{word(), word(), word(), word()};
    r.normal = std::min(r.normal & 0xffffu, 65534u) | std::min(r.normal >> 16, 65534u) << 16;
    return r;
}

TEST(KernelFormulas, DiscsAreThoseOfSplatDisc) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(1);
        const auto block = std::make_unique<cpu::SplatBlock>();
        std::vector<PointRecord> records(kRecordsPerBlock);
        const Lens lens = frameLens(f);
        const float scattered = largestSplat(kFlagScattered, f.focal, f.height);
        double worst = 0;
        size_t drawn = 0, refused = 0;
        for (int round = 0; round < 200; ++round) {
            const DrawNode node = randomNode(rng);
            for (PointRecord& r : records) r = randomRecord(rng);
            k.placeSplats(f, node, records.data(), kRecordsPerBlock, {}, *block);
            for (uint32_t i = 0; i < kRecordsPerBlock; ++i) {
                const WideDisc d = splatDisc(node, records[i], f.supportScale, scattered, i, lens);
                // Sums of four terms: units in the last place of the largest of them.
                const double size = std::max(
                    {1.0, std::abs(double{node.base.x}), std::abs(double{node.base.y}), std::abs(double{node.base.z})});
                const auto off = [&](float a, float b) { return std::abs(double{a} - double{b}) / size / 0x1p-23; };
                worst = std::max({worst, off(block->cx[i], d.centre.x), off(block->cy[i], d.centre.y),
                                  off(block->cz[i], d.centre.z), off(block->nx[i], d.normal.x) * size,
                                  off(block->ny[i], d.normal.y) * size, off(block->nz[i], d.normal.z) * size,
                                  ulpsBetween(block->radius[i], d.radius)});
                // What the formulas draw, the kernel keeps, and the pixels that it may cover.
                const float edgeOn = std::abs(dot(d.normal, sightTo(lens, d.centre)));
                if (edgeOn < 1e-4f * std::sqrt(dot(sightTo(lens, d.centre), sightTo(lens, d.centre)))) continue;
                const bool isSeen = isSplatSeen(node, records[i], d, f.nearPlane, lens) > 0.5f;
                if (!isSeen) {
                    EXPECT_EQ(block->keep[i], 0u);
                    ++refused;
                    continue;
                }
                const CentrePixel c = centrePixel(d, f);
                const DiscBox box = discBox(d, f);
                const bool hasBox = box.x.last >= box.x.first && box.y.last >= box.y.first;
                if (c.x < 0 && !(hasBox && reachesPicture(d, f) > 0.5f)) continue;
                const bool isKept = block->keep[i] != 0u;
                if (isKept) ++drawn;
                if (c.x >= 0) ASSERT_TRUE(isKept);
                // The box of the formula is wider, but nothing of the disc lies beside the kernel's; nowhere, if it has
                // none.
                for (int y = box.y.first; y <= box.y.last && hasBox; ++y)
                    for (int x = box.x.first; x <= box.x.last; ++x) {
                        const bool isIn = isKept && x >= block->firstX[i] && x <= block->lastX[i] &&
                                          y >= block->firstY[i] && y <= block->lastY[i];
                        if (isIn || (isKept && box.x.last - box.x.first > 100 && x % 7 != 0)) continue;
                        const vec2 at((float(x) + 0.5f - f.centre.x) / f.focal,
                                      (float(y) + 0.5f - f.centre.y) / f.focal);
                        const float hit = discHit(d, pixelRay(lens, at.x, at.y), f.nearPlane).depth;
                        ASSERT_FALSE(hit < kNoDisc) << x << ", " << y;
                    }
            }
        }
        EXPECT_LE(worst, 4);
        EXPECT_GT(drawn, 500u);
        EXPECT_GT(refused, 500u);
        RecordProperty("worst ulps of " + std::string(k.name), std::to_string(worst));
    });
}

/// Discs whose planes hold the eye, along diagonals of pixels, so that rays of pixels' centres lie in them but for
/// rounding: where one meets its disc nothing of the plane is known, and the depth is one of the disc all the same.
TEST(KernelFormulas, DiscsSeenEdgeOnAreNoFartherThanTheirRims) {
    size_t drawn = 0;
    forKernels([&](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(9);
        std::vector<uint64_t> keys(size_t{f.width} * f.height, kNoKey);
        std::vector<uint8_t> runs(keys.size() / cpu::Visibility::kRun + 1);
        const uint32_t place = 0;
        for (int round = 0; round < 3'000; ++round) {
            const uint32_t left = 32 * static_cast<uint32_t>(rng.below(20)),
                           top = 16 * static_cast<uint32_t>(rng.below(30));
            // The tile's own diagonal: y is x + beside, px from the principal point.
            const double x0 = static_cast<double>(left) - double{f.centre.x},
                         beside = static_cast<double>(top) - double{f.centre.y} - x0, x = x0 + rng.uniform(8, 16),
                         z = std::exp2(rng.uniform(-4, 8)), focal = double{f.focal},
                         perPixel = (f.orthographic == 0 ? z : 1) / focal;
            const auto n = glm::vec3(glm::normalize(glm::dvec3(focal, -focal, f.orthographic == 0 ? beside : 0)));
            const auto c = glm::vec3(glm::dvec3(x * perPixel, (x + beside) * perPixel, z));
            const cpu::PlacedSplat disc{c.x, c.y, c.z, n.x, n.y, n.z, uniform(rng, 2, 8) * static_cast<float>(perPixel),
                                        0};
            k.splatTile(f, &disc, &place, 1, {left, top, 32, 16}, {keys.data(), runs.data()});
            const float reach = disc.radius * std::sqrt(n.x * n.x + n.y * n.y);
            for (uint32_t i = 0; i < 32 * 16; ++i) {
                uint64_t& key = keys[(top + i / 32) * f.width + left + i % 32];
                if (key != kNoKey) {
                    ++drawn;
                    // Depths are one over what is linear on the image: rounded twice; reaches are a little wider.
                    EXPECT_NEAR(keyDepth(key), c.z, 1.0002f * reach + 0x1p-22f * c.z);
                }
                key = kNoKey;
            }
        }
    });
    EXPECT_GT(drawn, 1'000u);
}

TEST(KernelFormulas, PixelsAreThoseOfProjection) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(2);
        std::vector<PointRecord> records(kRecordsPerBlock);
        cpu::ProjectedBlock block;
        const Lens lens = frameLens(f);
        size_t drawn = 0, apart = 0;
        for (int round = 0; round < 200; ++round) {
            const DrawNode node = randomNode(rng);
            for (PointRecord& r : records) r = randomRecord(rng);
            k.projectBlock(f, node, records.data(), kRecordsPerBlock, false, block);
            int firstX = 640, lastX = -1, firstY = 480, lastY = -1;
            for (uint32_t i = 0; i < kRecordsPerBlock; ++i) {
                const PointRecord r = records[i];
                const vec3 c = recordPlace(node, r);
                const float scale = f.focal / lensDepth(lens, c.z);
                const float x = c.x * scale + f.centre.x, y = c.y * scale + f.centre.y;
                const bool isFine =
                    recordErrorCode(r) <= node.errorCode || (node.octantMask >> recordOctant(r) & 1u) != 0u;
                const bool isIn = c.z > f.nearPlane && x >= 0 && y >= 0 && x < 640 && y < 480;
                const bool isSeen = (recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) != 0u ||
                                    dot(nodeNormal(node, octDirection(r.normal)), sightTo(lens, c)) < 0.0f;
                const uint32_t expected =
                    isFine && isIn && isSeen ? uint32_t(int(y)) * f.width + uint32_t(int(x)) : ~0u;
                apart += block.pixel[i] != expected;
                if (block.pixel[i] != ~0u) {
                    const int column = static_cast<int>(block.pixel[i] % f.width),
                              line = static_cast<int>(block.pixel[i] / f.width);
                    firstX = std::min(firstX, column);
                    lastX = std::max(lastX, column);
                    firstY = std::min(firstY, line);
                    lastY = std::max(lastY, line);
                }
                if (block.pixel[i] == ~0u || expected == ~0u) continue;
                ++drawn;
                EXPECT_LE(ulpsBetween(std::bit_cast<float>(block.depth[i]), c.z), 2);
            }
            if (lastX < 0) {
                EXPECT_LT(block.lastX, block.firstX);
                continue;
            }
            EXPECT_EQ(block.firstX, firstX);
            EXPECT_EQ(block.lastX, lastX);
            EXPECT_EQ(block.firstY, firstY);
            EXPECT_EQ(block.lastY, lastY);
        }
        EXPECT_GT(drawn, 1000u);
        EXPECT_LE(apart, drawn / 2000) << "at the edges of pixels and seen edge-on one rounding decides";
    });
}

TEST(KernelFormulas, NoPixelIsClaimedBesideTheBoxOfItsBlock) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(12);
        std::vector<PointRecord> records(kRecordsPerBlock);
        cpu::ProjectedBlock block;
        const auto claims = std::make_unique<cpu::Claims>();
        size_t claimed = 0, wide = 0;
        for (int round = 0; round < 200; ++round) {
            DrawNode node = randomNode(rng);
            if (round % 2 == 1) node.octantMask |= kNodeWide;
            for (PointRecord& r : records) r = randomRecord(rng);
            const uint32_t count = round % 3 == 0 ? kRecordsPerBlock : static_cast<uint32_t>(round) % kRecordsPerBlock;
            k.projectBlock(f, node, records.data(), count, true, block);
            std::fill(std::begin(claims->pixel), std::end(claims->pixel), ~0u);
            k.findClaims(block, count, *claims);
            uint32_t found = 0;
            for (uint32_t i = 0; i < count; ++i) {
                wide += block.pixel[i] == cpu::kWidePixel;
                if (block.pixel[i] >= cpu::kWidePixel) continue;
                ++claimed;
                const int x = static_cast<int>(block.pixel[i] % f.width),
                          y = static_cast<int>(block.pixel[i] / f.width);
                ASSERT_TRUE(block.firstX <= x && x <= block.lastX && block.firstY <= y && y <= block.lastY);
                ASSERT_EQ(claims->lane[found], i);
                ASSERT_EQ(claims->pixel[found], block.pixel[i]);
                ASSERT_EQ(claims->depth[found++], block.depth[i]);
            }
            ASSERT_EQ(claims->count, found);
            for (uint32_t ahead = 0; found > 0 && ahead < cpu::Claims::kAhead; ++ahead)
                ASSERT_EQ(claims->pixel[found + ahead], claims->pixel[0]) << "is asked for, too";
        }
        EXPECT_GT(claimed, 1'000u);
        EXPECT_GT(wide, 0u);
    });
}

TEST(KernelFormulas, TexelsArePackedAndUnpackedAsOne) {
    forKernels([](const cpu::Kernels& k, const FrameConstants&) {
        Rng rng(3);
        constexpr uint32_t n = cpu::kTile;
        const auto row = std::make_unique<cpu::TexelRow>(), back = std::make_unique<cpu::TexelRow>(),
                   plain = std::make_unique<cpu::TexelRow>();
        Texel nobody{};
        nobody.depth = nobody.radius = nobody.thickness = -1;
        nobody.colour = {-1, -1, -1};
        nobody.offset = nobody.normalPerp = {-1, -1};
        row->hasTubes = back->hasTubes = false;
        std::vector<float> depth(n);
        std::vector<uint32_t> size(n), offset(n), normal(n), colour(n);
        const cpu::Planes planes{depth.data(), size.data(), offset.data(), normal.data(), colour.data(), nullptr};
        for (int round = 0; round < 100; ++round) {
            std::vector<Texel> texels;
            for (uint32_t i = 0; i < n; ++i) put(*row, cpu::kPad + i, texels.emplace_back(randomTexel(rng, true)));
            k.packRow(*row, n, planes);
            k.unpackRow(planes, cpu::kPad, n, ~0u, true, *back);
            for (size_t i = 0; i < cpu::TexelRow::kSize; ++i) put(*plain, i, nobody);
            k.unpackRow(planes, cpu::kPad, n, ~0u, false, *plain);
            for (uint32_t i = 0; i < n; ++i) {
                const PackedTexel p = packTexel(texels[i]);
                Texel withoutNormal = unpackTexel(p);
                withoutNormal.normalPerp = {plain->perpX[cpu::kPad + i], plain->perpY[cpu::kPad + i]};
                EXPECT_LE(farthest(*plain, cpu::kPad + i, withoutNormal), 1);
                ASSERT_EQ(p.size, size[i]);
                ASSERT_EQ(p.offset, offset[i]);
                ASSERT_EQ(p.normal, normal[i]);
                ASSERT_EQ(p.colour, colour[i]);
                EXPECT_LE(farthest(*back, cpu::kPad + i, unpackTexel(p)), 1);
            }
        }
    });
}

TEST(KernelFormulas, PulledAndPushedTexelsAreThoseOfTheFormulas) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(4);
        constexpr uint32_t n = cpu::kTile / 2;
        const Lens lens = frameLens(f);
        const auto upper = std::make_unique<cpu::TexelRow>(), lower = std::make_unique<cpu::TexelRow>(),
                   out = std::make_unique<cpu::TexelRow>(), colours = std::make_unique<cpu::TexelRow>();
        double worstPull = 0, worstPush = 0;
        size_t pulled = 0, pushed = 0;
        for (int round = 0; round < 100; ++round) {
            *upper = *lower = *out = {};
            std::vector<Texel> a, b;
            for (uint32_t i = 0; i < 2 * n; ++i)
                for (const auto& [row, texels] : {std::pair{upper.get(), &a}, std::pair{lower.get(), &b}}) {
                    Texel t = randomTexel(rng, true);
                    if (round % 2 == 0 && i < 2 * cpu::kTexelGroup) t.depth = 0;  // of a whole group of their parents
                    put(*row, cpu::kPad + i, texels->emplace_back(t));
                }
            k.pullRow(*upper, *lower, n, 1, f.focal, *out);
            for (uint32_t i = 0; i < n; ++i) {
                const Texel t = pullTexels(a[2 * i], a[2 * i + 1], b[2 * i], b[2 * i + 1], 1, lens);
                worstPull = std::max(worstPull, farthest(*out, cpu::kPad + i, t));
                pulled += t.depth > 0;
            }
            // The push: `upper` is the fine row, two coarse rows around it.
            const auto nearRow = std::make_unique<cpu::CoarseRow>(), farRow = std::make_unique<cpu::CoarseRow>();
            std::array<std::vector<Texel>, 2> rows;
            const float x = -100.5f, y = 37.5f, size = 2;
            for (size_t r = 0; r < 2; ++r) {
                cpu::CoarseRow& to = r == 0 ? *nearRow : *farRow;
                for (uint32_t i = 0; i < n + 2; ++i) {
                    Texel t = randomTexel(rng, true);
                    t.radius *= 2;
                    if (round % 2 == 0 && i < cpu::kTexelGroup + 2)
                        t.depth = 0;  // of the first group of parents, and one on either side
                    put(to.texels, cpu::kPad - 1 + i, rows.at(r).emplace_back(t));
                }
                k.coarseDiscs(to, 2 * n, x + 0.5f, y + (r == 0 ? 0.5f : 2.5f), size, f.focal);
            }
            k.pushRow(*upper, *nearRow, *farRow, 1, x, y, 2 * n, ~0u, 1, f.focal, false, *out);
            k.pushRow(*upper, *nearRow, *farRow, 1, x, y, 2 * n, ~0u, 1, f.focal, true, *colours);
            for (uint32_t i = 0; i < 2 * n; ++i) {
                const uint32_t at = i / 2 + 1, side = i % 2 == 0 ? at - 1 : at + 1;
                const float sx = i % 2 == 0 ? -1.0f : 1.0f;
                const auto disc = [&](size_t r, uint32_t c) {
                    return coarseDisc(rows.at(r)[c], x + 0.5f + (float(int(c)) - 1.0f) * size,
                                      y + (r == 0 ? 0.5f : 2.5f), lens);
                };
                const Texel t =
                    pushTexel(a[i], rows[0][at], rows[0][side], rows[1][at], rows[1][side], disc(0, at), disc(0, side),
                              disc(1, at), disc(1, side), sx, 1, x + float(int(i)), y, 1, lens);
                worstPush = std::max(worstPush, farthest(*out, cpu::kPad + i, t));
                Texel coloured = t;
                const size_t to = cpu::kPad + i;
                coloured.radius = colours->radius[to];
                coloured.thickness = colours->thickness[to];
                coloured.offset = {colours->x[to], colours->y[to]};
                coloured.normalPerp = {colours->perpX[to], colours->perpY[to]};
                worstPush = std::max(worstPush, farthest(*colours, to, coloured));
                pushed += t.depth > 0;
            }
        }
        EXPECT_EQ(worstPull, 0) << "the formula itself, without fused multiplications";
        EXPECT_EQ(worstPush, 0);
        EXPECT_GT(pulled, 1000u);
        EXPECT_GT(pushed, 1000u);
    });
}

/// Rows of any length, at the border of the picture, of any level, with tubes.
TEST(KernelFormulas, PushedTexelsOfAnyRowAreThoseOfTheFormulas) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(11);
        const Lens lens = frameLens(f);
        const auto fine = std::make_unique<cpu::TexelRow>(), out = std::make_unique<cpu::TexelRow>();
        std::array<cpu::CoarseRow, 2> rows{};  // the parents', and the one beyond
        double worst = 0;
        size_t replaced = 0;
        const auto texelOf = [&](bool hasTubes, bool mayBeOutside, float scale) {
            Texel t = randomTexel(rng, true);
            if (mayBeOutside && rng.below(5) == 0) t.depth = cpu::kOutside;
            t.radius *= scale;
            t.thickness *= scale;
            t.isRound = hasTubes && rng.below(2) == 0 ? 1.0f : 0.0f;
            if (t.isRound > 0) t.axis = {uniform(rng, -0.7, 0.7), uniform(rng, -0.7, 0.7)};
            return t;
        };
        const auto putAny = [](cpu::TexelRow& row, size_t i, const Texel& t) {
            put(row, i, t);
            row.isRound[i] = t.isRound;
            row.axisX[i] = t.axis.x;
            row.axisY[i] = t.axis.y;
        };
        for (const uint32_t n : {1u, 5u, 31u, 33u, 127u, 128u})
            for (const float sy : {-1.0f, 1.0f})
                for (const float fineSize : {1.0f, 16.0f})
                    for (const bool hasTubes : {false, true})
                        for (int round = 0; round < 20; ++round) {
                            std::vector<Texel> own;
                            std::array<std::vector<Texel>, 2> coarse;
                            for (uint32_t i = 0; i < n; ++i)
                                putAny(*fine, cpu::kPad + i, own.emplace_back(texelOf(hasTubes, false, fineSize)));
                            const float x = -100.5f, y = 37.5f, size = 2 * fineSize;
                            for (size_t r = 0; r < 2; ++r) {
                                for (uint32_t i = 0; i < (n + 1) / 2 + 2; ++i)
                                    putAny(rows.at(r).texels, cpu::kPad - 1 + i,
                                           coarse.at(r).emplace_back(texelOf(hasTubes, true, size)));
                                rows.at(r).texels.hasTubes = hasTubes;
                                k.coarseDiscs(rows.at(r), n, x, y + float(r) * sy * size, size, f.focal);
                            }
                            fine->hasTubes = out->hasTubes = hasTubes;
                            k.pushRow(*fine, rows[0], rows[1], sy, x, y, n, ~0u, fineSize, f.focal, false, *out);
                            for (uint32_t i = 0; i < n; ++i) {
                                const uint32_t at = i / 2 + 1, side = i % 2 == 0 ? at - 1 : at + 1;
                                const auto disc = [&](size_t r, uint32_t c) {
                                    return coarseDisc(coarse.at(r)[c], x + (float(int(c)) - 1.0f) * size,
                                                      y + float(r) * sy * size, lens);
                                };
                                const Texel t = pushTexel(own[i], coarse[0][at], coarse[0][side], coarse[1][at],
                                                          coarse[1][side], disc(0, at), disc(0, side), disc(1, at),
                                                          disc(1, side), i % 2 == 0 ? -1.0f : 1.0f, sy,
                                                          x + float(int(i)) * fineSize, y, fineSize, lens);
                                worst = std::max(worst, farthest(*out, cpu::kPad + i, t));
                                if (hasTubes && t.depth > 0) {
                                    ASSERT_EQ(out->isRound[cpu::kPad + i], t.isRound);
                                    ASSERT_EQ(out->axisX[cpu::kPad + i], t.axis.x);
                                    ASSERT_EQ(out->axisY[cpu::kPad + i], t.axis.y);
                                }
                                replaced += t.depth > 0 && t.depth != own[i].depth;
                            }
                        }
        EXPECT_EQ(worst, 0);
        EXPECT_GT(replaced, 10'000u);
    });
}

TEST(KernelFormulas, OutputIsTheNearestByte) {
    const cpu::Tables tables = cpu::makeTables();
    forKernels([&](const cpu::Kernels& k, const FrameConstants& f) {
        Rng rng(5);
        const auto row = std::make_unique<cpu::SurfaceRow>();
        std::vector<uint32_t> rgba(cpu::kTile);
        int worst = 0;
        for (int round = 0; round < 400; ++round) {
            for (size_t i = 0; i < cpu::kTile; ++i) {
                row->depth[i] = 1;
                row->red[i] = uniform(rng, -0.1, 1.1);
                row->green[i] = uniform(rng, 0, 0.01);
                row->blue[i] = uniform(rng, 0, 1);
            }
            k.outputRow(f, tables, cpu::kTile, *row, {rgba.data(), nullptr, nullptr, nullptr});
            for (size_t i = 0; i < cpu::kTile; ++i)
                for (const auto& [value, shift] :
                     {std::pair{row->red[i], 0u}, {row->green[i], 8u}, {row->blue[i], 16u}}) {
                    const float clamped = std::clamp(value, 0.0f, 1.0f);
                    const int exact = static_cast<int>(srgbFromLinear(clamped) * 255.0f + 0.5f);
                    worst = std::max(worst, std::abs(exact - static_cast<int>(rgba[i] >> shift & 255u)));
                }
        }
        EXPECT_LE(worst, 1) << "of a table of 2,048 roots";
    });
}

TEST(KernelFormulas, LightIsThatOfTheFormulas) {
    forKernels([](const cpu::Kernels& k, FrameConstants f) {
        Rng rng(6);
        f.shade = kShadeLit;
        f.sunDirection = glm::normalize(glm::vec3(-0.45f, -0.55f, -0.7f));
        f.skyDirection = {0, -1, 0};
        const auto row = std::make_unique<cpu::SurfaceRow>();
        row->hasTriangles = row->hasEmission = false;
        double worst = 0;
        for (int round = 0; round < 100; ++round) {
            std::vector<vec3> expected;
            for (size_t i = 0; i < cpu::kTile; ++i) {
                const auto n =
                    glm::normalize(glm::vec3(uniform(rng, -1, 1), uniform(rng, -1, 1), uniform(rng, -1, -0.1)));
                row->depth[i] = 5;
                row->nx[i] = n.x;
                row->ny[i] = n.y;
                row->nz[i] = n.z;
                row->leaf[i] = rng.below(2) == 0 ? 0.0f : 1.0f;
                row->material[i] = kPlainSurface;
                const vec3 c(uniform(rng, 0, 1), uniform(rng, 0, 1), uniform(rng, 0, 1));
                row->red[i] = c.x;
                row->green[i] = c.y;
                row->blue[i] = c.z;
                const float light = irradiance(n, f.sunDirection, f.skyDirection, row->leaf[i], 1);
                expected.emplace_back(c.x * light, c.y * light, c.z * light);
            }
            k.lightRow(f, cpu::LightInput{}, 0, 3, cpu::kTile, *row);
            for (size_t i = 0; i < cpu::kTile; ++i)
                worst = std::max({worst, ulpsBetween(row->red[i], expected[i].x),
                                  ulpsBetween(row->green[i], expected[i].y), ulpsBetween(row->blue[i], expected[i].z)});
        }
        // 1 + share (light - 1): a light of little is rounded at the size of 1.
        EXPECT_LE(worst, 16);
    });
}

// Rows whose pixels are all lit are lit where they lie, others closed up first: the same to the bit.
TEST(KernelFormulas, LightOfAPixelIsTheSameWhateverIsBesideIt) {
    forKernels([](const cpu::Kernels& k, FrameConstants f) {
        Rng rng(8);
        f.shade = kShadeTriangles;
        f.lightCount = 2;
        f.ambient = 0.3f;
        f.skyDirection = {0, -1, 0};
        LightSource lights[2]{};
        lights[0].position = glm::normalize(glm::vec3(-0.4f, -0.5f, -0.7f));
        lights[0].kind = kLightDirectional;
        lights[0].colour = {2, 1.9f, 1.7f};
        lights[1].position = {0.5f, -1, 3};
        lights[1].kind = kLightPoint;
        lights[1].colour = {3, 3, 4};
        const std::array<uint32_t, 2> slots{1, 0};
        const cpu::LightInput input{lights, nullptr, slots.data()};
        const auto all = std::make_unique<cpu::SurfaceRow>();
        all->hasTriangles = all->hasEmission = true;
        all->shadowSlots = 1;
        all->isShadowed[0] = true;
        for (size_t i = 0; i < cpu::kTile; ++i) {
            const auto n = glm::normalize(glm::vec3(uniform(rng, -1, 1), uniform(rng, -1, 1), uniform(rng, -1, -0.1)));
            all->depth[i] = uniform(rng, 2, 6);
            all->nx[i] = n.x;
            all->ny[i] = n.y;
            all->nz[i] = n.z;
            all->leaf[i] = rng.below(4) == 0 ? 1.0f : 0.0f;
            all->material[i] = kPixelTriangle | (static_cast<uint32_t>(rng.below(0x10000)) | 0xff0000u);
            all->emission[i] = packColour(uniform(rng, 0, 1), uniform(rng, 0, 1), uniform(rng, 0, 1));
            all->shadow[0][i] = packLight(vec3(uniform(rng, 0, 1), uniform(rng, 0, 1), uniform(rng, 0, 1)));
            all->red[i] = uniform(rng, 0, 1);
            all->green[i] = uniform(rng, 0, 1);
            all->blue[i] = uniform(rng, 0, 1);
        }
        const auto some = std::make_unique<cpu::SurfaceRow>(*all);
        const auto isLit = [](size_t i) { return i % 7 != 0 && i % 11 != 3; };
        for (size_t i = 0; i < cpu::kTile; ++i)
            if (!isLit(i)) some->material[i] |= kPixelUnlit;
        const cpu::SurfaceRow before = *some;
        k.lightRow(f, input, 64, 3, cpu::kTile, *all);
        k.lightRow(f, input, 64, 3, cpu::kTile, *some);
        for (size_t i = 0; i < cpu::kTile; ++i) {
            const cpu::SurfaceRow& expected = isLit(i) ? *all : before;
            EXPECT_EQ(some->red[i], expected.red[i]) << i;
            EXPECT_EQ(some->green[i], expected.green[i]) << i;
            EXPECT_EQ(some->blue[i], expected.blue[i]) << i;
            EXPECT_NE(all->red[i], before.red[i]) << i;
        }
    });
}

}  // namespace
}  // namespace stipple
