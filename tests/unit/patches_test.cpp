// Elevation patches: how far they are from what they stand for, whatever order it comes in, and their bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "lod/builder/patches/cone.h"
#include "lod/builder/patches/moving_least_squares.h"
#include "lod/primitives/octahedral.h"
#include "lod/store/patch_bytes.h"
#include "tests/support/patch_shapes.h"

namespace stipple {
namespace {

using test::patchesOf;
using test::Triangle;

/// Bumps on a ball, all of it seen: points with colours.
lod::PointBlock ball(size_t count, uint64_t seed) {
    lod::PointBlock block;
    for (const test::TestPoint& p : test::bumpySphere(count, seed)) {
        block.position.push_back(p.position);
        block.colour.push_back(p.colour);
    }
    return block;
}

glm::dvec3 somewhereOn(const Triangle& t, Rng& rng) {
    double u = rng.uniform(), v = rng.uniform();
    if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
    }
    return t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
}
double distance(const std::vector<Triangle>& to, const glm::dvec3& p) {
    double least = 1e300;
    for (const Triangle& t : to) least = std::min(least, glm::distance(p, test::closestPlace(t, p)));
    return least;
}

TEST(PatchCone, IsTheSmallestThatHoldsAll) {
    Rng rng(1);
    for (int round = 0; round < 200; ++round) {
        std::vector<glm::vec3> normals;
        std::vector<uint32_t> all;
        const double spread = rng.uniform(0.01, 1.2);
        for (uint32_t k = 0; k < 3 + rng.below(40); ++k) {
            normals.push_back(glm::vec3(glm::normalize(glm::dvec3(spread * rng.normal(), spread * rng.normal(), 1))));
            all.push_back(k);
        }
        const lod::NormalCone cone = lod::coneOf(normals, all);
        if (cone.cosine <= 0) continue;
        const auto leastAlong = [&](const glm::dvec3& axis) {
            double least = 1;
            for (const glm::vec3& n : normals) least = std::min(least, glm::dot(glm::dvec3(n), axis));
            return least;
        };
        EXPECT_GE(leastAlong(cone.axis), cone.cosine - 1e-7);
        for (int k = 0; k < 200; ++k) {
            const glm::dvec3 other =
                glm::normalize(cone.axis + 0.05 * glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
            EXPECT_LE(leastAlong(other), cone.cosine + 1e-6) << "another axis does better";
        }
    }
    const std::vector<glm::vec3> opposite{{0, 0, 1}, {0, 0, -1}};
    EXPECT_LE(lod::coneOf(opposite, std::vector<uint32_t>{0, 1}).cosine, 0);
}

/// No place of a patch is farther from the source than it says, nor the other way; and that is not said lightly.
void expectBounds(const lod::TriangleMesh& mesh, const lod::PatchSet& set, size_t samples) {
    const std::vector<Triangle> source = test::trianglesOf(mesh), all = test::trianglesOf(set);
    Rng rng(7);
    double measured = 0;
    for (const lod::Patch& patch : set.patches) {
        ASSERT_EQ(lod::patchFault(patch), "");
        const std::vector<Triangle> own = test::trianglesOf(patch, set.middle);
        double most = 0;
        for (size_t k = 0; k < samples / set.patches.size() + 1; ++k)
            most = std::max(most, distance(source, somewhereOn(own[rng.below(own.size())], rng)));
        EXPECT_LE(most, patch.errorToSource * (1 + 1e-9) + 1e-12);
        measured = std::max(measured, most);
    }
    if (set.gaps.empty()) EXPECT_GT(measured, 0.2 * set.toSource.bound) << "a bound that says too little";
    double back = 0;
    for (size_t k = 0; k < samples; ++k)
        back = std::max(back, distance(all, somewhereOn(source[rng.below(source.size())], rng)));
    EXPECT_LE(back, set.fromSource.bound * (1 + 1e-9) + 1e-12);
    EXPECT_GT(set.fromSource.bound, 0);
    EXPECT_LE(set.toSource.rms, set.toSource.bound);
    EXPECT_LE(set.fromSource.rms, set.fromSource.bound);
}

TEST(Patches, OfMeshesAreWithinTheirBounds) {
    for (const lod::TriangleMesh& mesh : {test::torusMesh(60, 24), test::boxMesh(12)}) {
        lod::PatchSettings settings;
        settings.samples = 2000;
        for (const auto closing : {lod::PatchClosing::overlap, lod::PatchClosing::open}) {
            settings.closing = closing;
            const lod::PatchSet set = patchesOf(mesh, settings);
            ASSERT_GE(set.patches.size(), 6u);
            EXPECT_EQ(set.pointsLeft, 0u);
            if (closing == lod::PatchClosing::overlap) {
                expectBounds(mesh, set, 1500);
                continue;
            }
            // The control: where patches end before their border, the source is farther from them.
            const std::vector<Triangle> all = test::trianglesOf(set);
            Rng rng(3);
            double back = 0;
            for (const Triangle& t : test::trianglesOf(mesh)) back = std::max(back, distance(all, somewhereOn(t, rng)));
            EXPECT_LE(back, set.fromSource.bound);
            EXPECT_GT(back, 0.25 * double{set.patches[0].step});
        }
    }
}

TEST(Patches, HoldTheirCones) {
    const lod::TriangleMesh mesh = test::torusMesh(80, 32);
    size_t before = 0;
    for (const double degrees : {60.0, 40.0, 20.0}) {
        lod::PatchSettings settings;
        settings.coneDegrees = degrees;
        settings.closing = lod::PatchClosing::open;  // (what overlaps bends on)
        const lod::PatchSet set = patchesOf(mesh, settings);
        EXPECT_GT(set.patches.size(), before) << "narrower cones are more patches";
        before = set.patches.size();
        for (const lod::Patch& patch : set.patches) {
            const glm::dvec3 axis = patch.frame()[2];
            for (const Triangle& t : test::trianglesOf(patch, set.middle)) {
                const glm::dvec3 n = glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0]));
                EXPECT_GT(glm::dot(n, axis), std::cos((degrees + 3) * 3.14159265 / 180));
            }
        }
    }
}

TEST(Patches, AreTheSameForAnyOrderAndThreads) {
    const lod::TriangleMesh mesh = test::torusMesh(50, 20);
    const lod::PointBlock points = ball(6000, 5);
    lod::PatchSettings settings;
    settings.samples = 3000;
    const auto bytes = [](const lod::PatchSet& set) { return lod::encodePatches(set.patches).bytes; };
    const auto ofMesh = bytes(patchesOf(mesh, settings, 1)), ofPoints = bytes(patchesOf(points, settings, 1));
    const lod::PatchSet first = patchesOf(points, settings, 1);
    for (const int threads : {1, 2, 4}) {
        const auto seed = static_cast<uint64_t>(threads);
        EXPECT_EQ(bytes(patchesOf(test::shuffled(mesh, seed), settings, threads)), ofMesh);
        const lod::PatchSet again = patchesOf(test::shuffled(points, seed), settings, threads);
        EXPECT_EQ(bytes(again), ofPoints);
        EXPECT_EQ(again.left.position, first.left.position);
    }
    lod::TriangleMesh moved = mesh;  // the control
    moved.position[100].z += 0.01;
    EXPECT_NE(bytes(patchesOf(moved, settings, 1)), ofMesh);
}

TEST(Patches, SplitWhereASheetWindsOverItself) {
    // A ramp in three turns: every normal is near z, and every line along z meets it three times.
    const lod::TriangleMesh ramp = test::sheet(240, 8, [](double u, double v) {
        const double a = 3 * 6.283185307179586 * u, r = 1 + v;
        return glm::dvec3(r * std::cos(a), r * std::sin(a), u);
    });
    lod::PatchSettings settings;
    settings.samples = 6000;
    const lod::PatchSet set = patchesOf(ramp, settings);
    EXPECT_GE(set.patches.size(), 3u);
    expectBounds(ramp, set, 1500);
    // One turn of it is one height field.
    const lod::TriangleMesh turn = test::sheet(80, 8, [](double u, double v) {
        const double a = 6 * u, r = 1 + v;
        return glm::dvec3(r * std::cos(a), r * std::sin(a), 0.33 * u);
    });
    EXPECT_EQ(patchesOf(turn, settings).patches.size(), 1u);
}

TEST(Patches, SteepPlanesAndOneTriangleAreOnePatch) {
    // A roof of two planes, each 40 degrees from the patch's own: cells' diagonals rise by sqrt(2) step tan(40).
    const double rise = std::tan(40 * 3.14159265 / 180);
    lod::PointBlock roof;
    Rng rng(4);
    for (int k = 0; k < 4000; ++k) {
        const double x = rng.uniform(-1, 1), y = rng.uniform(-1, 1);
        roof.position.emplace_back(x, y, -rise * std::abs(x + y) / std::sqrt(2.0));
    }
    const lod::PatchSet set = patchesOf(roof);
    ASSERT_GE(set.patches.size(), 1u);
    EXPECT_LE(set.patches.size(), 2u);
    EXPECT_LT(set.pointsLeft, 200u);
    lod::TriangleMesh one;
    one.position = {{0, 0, 5}, {1, 0, 5}, {0, 1, 5}};
    one.indices = {0, 1, 2};
    lod::PatchSettings few;
    few.samples = 1;
    const lod::PatchSet single = patchesOf(one, few);
    ASSERT_EQ(single.patches.size(), 1u);
    expectBounds(one, single, 300);
}

TEST(Patches, OfPointsAreWithinTheirBounds) {
    const lod::PointBlock points = ball(8000, 2);
    const lod::PatchSet set = patchesOf(points);
    ASSERT_GE(set.patches.size(), 4u);
    EXPECT_LT(set.pointsLeft, points.position.size() / 50);
    const std::vector<Triangle> all = test::trianglesOf(set);
    Rng rng(6);
    double measured = 0;
    for (const lod::Patch& patch : set.patches) {
        const std::vector<Triangle> own = test::trianglesOf(patch, set.middle);
        double most = 0;
        for (int k = 0; k < 60; ++k) {
            const glm::dvec3 p = somewhereOn(own[rng.below(own.size())], rng);
            double least = 1e300;
            for (const glm::dvec3& q : points.position) least = std::min(least, glm::distance(p, q));
            most = std::max(most, least);
        }
        EXPECT_LE(most, patch.errorToSource);
        measured = std::max(measured, most / patch.errorToSource);
    }
    EXPECT_GT(measured, 0.3);
    double farthest = 0;
    for (size_t k = 0; k < points.position.size(); k += 7) {
        const glm::dvec3& p = points.position[k];
        bool isLeft = false;
        for (const glm::dvec3& q : set.left.position) isLeft = isLeft || glm::distance(q + set.middle, p) < 1e-12;
        if (!isLeft) farthest = std::max(farthest, distance(all, p));
    }
    EXPECT_LE(farthest, set.fromSource.bound);
    EXPECT_GT(farthest, 0.02 * set.fromSource.bound);
}

TEST(Patches, KeepTwoSheetsApart) {
    // Two noisy sheets, two widths h of the fit from each other; nothing between them.
    Rng rng(9);
    lod::PointBlock points;
    const double spacing = 0.02, gap = 2 * 1.5 * spacing;
    for (int sheet = 0; sheet < 2; ++sheet)
        for (int k = 0; k < 2500; ++k)
            points.position.emplace_back(rng.uniform(), rng.uniform(), gap * sheet + 0.1 * spacing * rng.normal());
    const lod::PatchSet set = patchesOf(points);
    ASSERT_GE(set.patches.size(), 2u);
    size_t samples = 0;
    for (const lod::Patch& patch : set.patches) {
        const lod::PatchSurface surface(patch);
        for (size_t s = 0; s < patch.heights.size(); ++s) {
            if (patch.heights[s] == 0) continue;
            const double z = (surface.position(s) + set.middle).z;
            EXPECT_LT(std::min(std::abs(z), std::abs(z - gap)), 0.35 * gap);
            ++samples;
        }
    }
    EXPECT_GT(samples, 4000u);
    EXPECT_LT(set.pointsLeft, 500u);
}

/// Directed edges without their other side, among the triangles of patches and gaps; `twice`: those that are there
/// more than once.
size_t openEdges(const lod::PatchSet& set, size_t& twice) {
    std::map<std::pair<lod::PatchCorner, lod::PatchCorner>, int> edges;
    const auto add = [&](const std::array<lod::PatchCorner, 3>& t) {
        for (size_t k = 0; k < 3; ++k) ++edges[{t.at(k), t.at((k + 1) % 3)}];
    };
    for (uint32_t p = 0; p < set.patches.size(); ++p)
        lod::PatchSurface(set.patches[p]).triangles([&](size_t a, size_t b, size_t c) {
            add({lod::PatchCorner{p, uint32_t(a)}, {p, uint32_t(b)}, {p, uint32_t(c)}});
        });
    for (const auto& gap : set.gaps) add(gap);
    size_t open = 0;
    twice = 0;
    for (const auto& [edge, count] : edges) {
        twice += count > 1 ? 1 : 0;
        open += edges.contains({edge.second, edge.first}) ? 0 : 1;
    }
    return open;
}

TEST(PatchGaps, AreClosedByWhatNeitherFoldsNorCovers) {
    const lod::TriangleMesh mesh = test::torusMesh(120, 50);
    lod::PatchSettings settings;
    settings.samples = 12000;
    size_t twice = 0;
    settings.closing = lod::PatchClosing::open;
    EXPECT_GT(openEdges(patchesOf(mesh, settings), twice), 500u) << "the control: they are open";
    settings.closing = lod::PatchClosing::gaps;
    const lod::PatchSet set = patchesOf(mesh, settings);
    EXPECT_EQ(openEdges(set, twice), 0u);
    EXPECT_EQ(twice, 0u);
    EXPECT_EQ(set.openEdges, 0u);
    EXPECT_GT(set.gaps.size(), 500u);
    // What lies over others, or through the body, has area and volume of its own.
    double area = 0, volume = 0, sourceArea = 0, sourceVolume = 0;
    const auto addUp = [](const std::vector<Triangle>& all, double& itsArea, double& itsVolume) {
        for (const Triangle& t : all) {
            itsArea += 0.5 * glm::length(glm::cross(t[1] - t[0], t[2] - t[0]));
            itsVolume += glm::dot(t[0], glm::cross(t[1], t[2])) / 6;
        }
    };
    addUp(test::trianglesOf(set), area, volume);
    addUp(test::trianglesOf(mesh), sourceArea, sourceVolume);
    EXPECT_NEAR(area, sourceArea, 0.003 * sourceArea);
    EXPECT_NEAR(volume, sourceVolume, 0.003 * sourceVolume);
    settings.closing = lod::PatchClosing::overlap;  // the control of that
    double overlapArea = 0, overlapVolume = 0;
    addUp(test::trianglesOf(patchesOf(mesh, settings)), overlapArea, overlapVolume);
    EXPECT_GT(overlapArea, 1.02 * sourceArea);
    expectBounds(mesh, set, 1500);
    const std::vector<Triangle> source = test::trianglesOf(mesh), all = test::trianglesOf(set);
    Rng rng(8);
    for (size_t k = 0; k < 300; ++k)  // gaps stand last
        EXPECT_LE(distance(source, somewhereOn(all[all.size() - 1 - rng.below(set.gaps.size())], rng)),
                  set.toSource.bound);
}

TEST(PatchGaps, StayOpenWhereTheSourceEnds) {
    const lod::TriangleMesh mesh = test::sheet(60, 60, [](double u, double v) {
        const double a = 2.6 * u;
        return glm::dvec3(std::cos(a), v, std::sin(a));
    });
    lod::PatchSettings settings;
    settings.samples = 4000;
    settings.closing = lod::PatchClosing::gaps;
    const lod::PatchSet set = patchesOf(mesh, settings);
    ASSERT_GE(set.patches.size(), 2u);
    size_t twice = 0;
    const size_t open = openEdges(set, twice);
    EXPECT_EQ(open, set.openEdges);
    EXPECT_EQ(twice, 0u);
    // Its outline, 2 * (2.6 + 1) long; cells along it are about 1/63 wide.
    EXPECT_GT(open, 200u);
    EXPECT_LT(open, 700u);
}

/// Numbers of materials on samples, so many, in stripes; of every other patch.
lod::PatchSet withMaterials(lod::PatchSet set, size_t count) {
    for (size_t k = 0; k < set.patches.size(); k += 2) {
        lod::Patch& p = set.patches[k];
        p.materials.assign(p.heights.size(), 0);
        for (size_t s = 0; s < p.heights.size(); ++s)
            if (p.heights[s] != 0) p.materials[s] = static_cast<uint8_t>(s / 5 % count);
    }
    return set;
}

class PatchBytes : public testing::TestWithParam<size_t> {};
INSTANTIATE_TEST_SUITE_P(WithMaterials, PatchBytes, testing::Values(1, 2, 256),
                         [](const auto& of) { return std::to_string(of.param); });

TEST_P(PatchBytes, ComeBackExactly) {
    const lod::PatchSet set = withMaterials(patchesOf(ball(5000, 3)), GetParam());
    const lod::PatchBytes encoded = lod::encodePatches(set.patches);
    EXPECT_EQ(encoded.geometry + encoded.normals + encoded.colours + encoded.materials, encoded.bytes.size());
    EXPECT_EQ(encoded.materials == 0, GetParam() == 1) << "what all have takes no room";
    const auto decoded = lod::decodePatches(encoded.bytes, "here");
    ASSERT_TRUE(decoded) << decoded.error().line();
    ASSERT_EQ(decoded->size(), set.patches.size());
    for (size_t k = 0; k < set.patches.size(); ++k) {
        const lod::Patch &a = set.patches[k], &b = (*decoded)[k];
        EXPECT_EQ(a.cells, b.cells);
        EXPECT_EQ(a.heights, b.heights);
        EXPECT_EQ(a.normals, b.normals);
        EXPECT_EQ(a.colours, b.colours);
        for (size_t s = 0; s < a.heights.size(); ++s)
            ASSERT_EQ(a.materials.empty() ? 0 : a.materials[s], b.materials.empty() ? 0 : b.materials[s]);
        EXPECT_EQ(a.origin, b.origin);
        EXPECT_EQ(a.turn, b.turn);
        EXPECT_EQ(a.step, b.step);
        EXPECT_EQ(a.quantumExponent, b.quantumExponent);
        EXPECT_EQ(a.errorToSource, b.errorToSource);
    }
    EXPECT_TRUE(lod::decodePatches(lod::encodePatches({}).bytes, "here")->empty());
}

TEST_P(PatchBytes, AreRefusedWhereTheyAreDamaged) {
    const lod::PatchSet set = withMaterials(patchesOf(ball(600, 3)), GetParam());
    ASSERT_FALSE(set.patches.empty());
    const std::vector<uint8_t> whole = lod::encodePatches(set.patches).bytes;
    for (size_t length = 0; length < whole.size(); ++length) {
        const std::vector<uint8_t> part(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(length));
        EXPECT_FALSE(lod::decodePatches(part, "here")) << length;
    }
    Rng rng(1);
    size_t refused = 0;
    for (int k = 0; k < 3000; ++k) {
        std::vector<uint8_t> other = whole;
        other[rng.below(other.size())] ^= static_cast<uint8_t>(1u << rng.below(8));
        const auto decoded = lod::decodePatches(other, "here");
        refused += decoded ? 0 : 1;
        if (!decoded) continue;
        for (const lod::Patch& p : *decoded) EXPECT_EQ(lod::patchFault(p), "");
    }
    EXPECT_GT(refused, 0u);
}

// What encodes well and draws nothing sane: each is refused, where the same without it comes back.
TEST(PatchHeads, OfHostileNumbersAreRefused) {
    const lod::PatchSet set = patchesOf(ball(600, 3));
    ASSERT_FALSE(set.patches.empty());
    const auto comesBack = [&](const std::function<void(lod::Patch&)>& spoil) {
        std::vector<lod::Patch> patches = set.patches;
        spoil(patches.back());
        return lod::decodePatches(lod::encodePatches(patches).bytes, "here").has_value();
    };
    EXPECT_TRUE(comesBack([](lod::Patch&) {}));
    const float nan = std::nanf(""), inf = HUGE_VALF;
    for (const float odd : {nan, inf, -inf}) {
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.origin.y = odd; })) << odd;
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.turn.x = odd; })) << odd;
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.step = odd; })) << odd;
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.errorToSource = odd; })) << odd;
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.errorFromSource = odd; })) << odd;
    }
    EXPECT_FALSE(comesBack([](lod::Patch& p) { p.origin.x = 1e300; }));
    EXPECT_FALSE(comesBack([](lod::Patch& p) { p.turn = {0, 0, 0, 0}; }));
    for (const float step : {0.0f, -1.0f, 1e-30f, 1e30f})
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.step = step; })) << step;
    for (const int32_t exponent : {-2000, 2000, INT32_MIN, INT32_MAX})
        EXPECT_FALSE(comesBack([&](lod::Patch& p) { p.quantumExponent = exponent; })) << exponent;
    EXPECT_FALSE(comesBack([](lod::Patch& p) { p.errorToSource = -1; }));
    EXPECT_FALSE(comesBack([](lod::Patch& p) {  // a drawn cell without its samples
        for (uint16_t& code : p.heights) code = 0;
    }));
    // Of more than the blocks that the store names: nothing is unpacked.
    EXPECT_FALSE(lod::decodePatches(lod::encodePatches(set.patches).bytes, "here", {.blocks = 0}));
}

// Also those that are finer than usual, as mirrors have them, and any.
TEST(PatchNormals, ComeBackHoweverFine) {
    for (const int bits : {11, 12, 13, 16}) {
        lod::PatchSet set = patchesOf(ball(3000, 3));
        Rng rng(static_cast<uint64_t>(bits));
        for (lod::Patch& p : set.patches)
            for (uint32_t& n : p.normals) {
                if (n == 0) continue;
                const glm::vec3 normal(rng.normal(), rng.normal(), 0.1 + std::abs(rng.normal()));
                n = bits == 11   ? lod::roundedNormal(normal)
                    : bits == 12 ? lod::roundedNormal<16>(normal)
                    : bits == 13 ? lod::roundedNormal<8>(normal)
                                 : lod::octEncode(normal) & ~0x10001u;
            }
        const auto decoded = lod::decodePatches(lod::encodePatches(set.patches).bytes, "here");
        ASSERT_TRUE(decoded);
        size_t off = 0;
        for (size_t k = 0; k < set.patches.size(); ++k)
            for (size_t s = 0; s < set.patches[k].normals.size(); ++s)
                off += set.patches[k].heights[s] != 0 && set.patches[k].normals[s] != (*decoded)[k].normals[s] ? 1 : 0;
        if (bits < 16) EXPECT_EQ(off, 0u) << bits;
        if (bits == 16) EXPECT_GT(off, 0u) << "the control: no more than 15 bits are kept";
    }
}

TEST(PatchHeads, OfMuchRoomForLittleAreRefused) {
    // A head takes 72 bytes and may name 16 million samples: nothing is made for those that nobody draws.
    const auto ofSide = [](uint32_t side, size_t patches = 1) {
        lod::Patch p;
        p.width = p.height = side;
        p.cells.assign(size_t{side - 1} * (side - 1), 0);
        p.heights.assign(size_t{side} * side, 0);
        p.normals.assign(p.heights.size(), 0);
        p.colours.assign(p.heights.size(), 0);
        p.cells[0] = 1;
        for (const size_t s : {p.at(0, 0), p.at(1, 0), p.at(0, 1), p.at(1, 1)}) p.heights[s] = 7;
        return lod::encodePatches(std::vector<lod::Patch>(patches, p)).bytes;
    };
    EXPECT_TRUE(lod::decodePatches(ofSide(200), "here"));
    EXPECT_FALSE(lod::decodePatches(ofSide(2000), "here"));
    // Nor for many that are just small enough each.
    EXPECT_FALSE(lod::decodePatches(ofSide(200, 100), "here"));
}

}  // namespace
}  // namespace stipple
