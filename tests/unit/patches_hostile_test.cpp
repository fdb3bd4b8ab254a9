// Surfaces that are none, or hardly: each ends as patches within their bound or as points, and nothing is lost on the
// way.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "lod/builder/patches/deviation.h"
#include "tests/support/patch_shapes.h"

namespace stipple {
namespace {

using test::patchesOf;
using test::Triangle;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

double nearest(const std::vector<Triangle>& to, const glm::dvec3& p) {
    double least = 1e300;
    for (const Triangle& t : to) least = std::min(least, glm::distance(p, test::closestPlace(t, p)));
    return least;
}

/// Every finite place is among those left, or no farther from a patch than it says; patches are near the points.
void expectKept(const lod::PointBlock& points, lod::PatchClosing closing) {
    lod::PatchSettings settings;
    settings.closing = closing;
    SCOPED_TRACE(static_cast<int>(closing));
    const lod::PatchSet set = patchesOf(points, settings);
    const std::vector<Triangle> all = test::trianglesOf(set);
    for (const lod::Patch& p : set.patches) EXPECT_EQ(lod::patchFault(p), "");
    std::vector<std::array<double, 3>> left;
    for (const glm::dvec3& q : set.left.position) left.push_back({q.x, q.y, q.z});
    std::sort(left.begin(), left.end());
    uint64_t dropped = 0;
    for (const auto& [reason, count] : set.dropped) dropped += count;
    EXPECT_LE(set.pointsLeft + dropped, points.position.size());
    if (set.patches.empty()) EXPECT_EQ(set.pointsLeft + dropped, points.position.size());
    for (const glm::dvec3& p : points.position) {
        if (!std::isfinite(p.x + p.y + p.z)) continue;
        const glm::dvec3 q = p - set.middle;
        if (std::binary_search(left.begin(), left.end(), std::array{q.x, q.y, q.z})) continue;
        EXPECT_LE(nearest(all, p), set.fromSource.bound * (1 + 1e-9)) << p.x << " " << p.y << " " << p.z;
    }
    for (const lod::Patch& patch : set.patches) {
        const lod::PatchSurface surface(patch);
        for (size_t s = 0; s < patch.heights.size(); s += 3) {
            if (patch.heights[s] == 0) continue;
            double least = 1e300;
            for (const glm::dvec3& p : points.position)
                if (std::isfinite(p.x + p.y + p.z))
                    least = std::min(least, glm::distance(p, set.middle + surface.position(s)));
            EXPECT_LE(least, patch.errorToSource);
        }
    }
}

constexpr std::array kClosings{lod::PatchClosing::overlap, lod::PatchClosing::gaps, lod::PatchClosing::open};
void expectKept(const lod::PointBlock& points) {
    for (const lod::PatchClosing closing : kClosings) expectKept(points, closing);
}

lod::PointBlock block(std::vector<glm::dvec3> places) {
    lod::PointBlock out;
    out.position = std::move(places);
    return out;
}

TEST(PatchesOfAnything, FewPointsStayPoints) {
    for (size_t count = 0; count < 24; ++count) {
        std::vector<glm::dvec3> places;
        for (size_t k = 0; k < count; ++k) places.emplace_back(double(k % 5), double(k / 5), 0);
        const lod::PatchSet set = patchesOf(block(places));
        EXPECT_EQ(set.patches.size(), 0u);
        EXPECT_EQ(set.pointsLeft, count);
    }
}

TEST(PatchesOfAnything, CoincidentPointsAndThoseThatAreNone) {
    std::vector<glm::dvec3> places(500, glm::dvec3(3, 4, 5));
    lod::PatchSet set = patchesOf(block(places));
    EXPECT_EQ(set.pointsLeft, 1u);
    EXPECT_EQ(set.dropped.at("at the place of another"), 499u);
    Rng rng(1);
    for (int k = 0; k < 2000; ++k) places.emplace_back(rng.uniform(), rng.uniform(), 0);
    for (int k = 0; k < 40; ++k) places.emplace_back(kNan, 0, 0);
    places.emplace_back(0, std::numeric_limits<double>::infinity(), 0);
    expectKept(block(places));
    EXPECT_EQ(patchesOf(block(places)).dropped.at("not finite"), 41u);
    expectKept(block({{kNan, kNan, kNan}}));
}

TEST(PatchesOfAnything, NoiseLinesAndVolumes) {
    Rng rng(2);
    std::vector<glm::dvec3> volume, line, noisy, thin, steep;
    for (int k = 0; k < 3000; ++k) {
        volume.emplace_back(rng.uniform(), rng.uniform(), rng.uniform());
        line.emplace_back(rng.uniform(), 1e-4 * rng.normal(), 1e-4 * rng.normal());
        noisy.emplace_back(rng.uniform(), rng.uniform(), 2.0 / 55 * rng.normal());  // two spacings
        const double a = 6.28 * rng.uniform();
        thin.emplace_back(rng.uniform(), 0.003 * std::cos(a), 0.003 * std::sin(a));  // a tube of half a spacing
        steep.emplace_back(rng.uniform(), rng.uniform(), 1e6 * rng.uniform());
    }
    for (const auto& places : {volume, line, noisy, thin, steep}) expectKept(block(places));
    EXPECT_GT(patchesOf(block(volume)).pointsLeft, 1500u) << "a volume is no surface";
    EXPECT_EQ(patchesOf(block(line)).patches.size(), 0u);
}

TEST(PatchesOfAnything, SheetsAHairApartAndWithoutASide) {
    Rng rng(3);
    std::vector<glm::dvec3> sheets, half;
    for (int k = 0; k < 4000; ++k) sheets.emplace_back(rng.uniform(), rng.uniform(), k % 2 == 0 ? 0 : 1e-6);
    expectKept(block(sheets));
    for (int k = 0; k < 4000; ++k) {  // a band with half a turn
        const double a = 6.283185307179586 * rng.uniform(), b = rng.uniform(-0.3, 0.3), r = 1 + b * std::cos(a / 2);
        half.emplace_back(r * std::cos(a), r * std::sin(a), b * std::sin(a / 2));
    }
    expectKept(block(half));
    EXPECT_GE(patchesOf(block(half)).patches.size(), 2u);
    // Normals on any side.
    lod::PointBlock sides = block(half);
    for (size_t k = 0; k < sides.position.size(); ++k) sides.normal.emplace_back(0, 0, k % 3 == 0 ? 1 : -1);
    expectKept(sides);
    sides.normal.assign(sides.position.size(), glm::vec3(std::numeric_limits<float>::quiet_NaN()));
    expectKept(sides);
}

TEST(PatchesOfAnything, BeyondWhatSinglesHold) {
    Rng rng(6);
    std::vector<glm::dvec3> places;
    for (int k = 0; k < 500; ++k) places.emplace_back(1e300 * rng.uniform(), 1e300 * rng.uniform(), 0);
    for (const lod::PatchClosing closing : kClosings) {
        lod::PatchSettings settings;
        settings.closing = closing;
        const lod::PatchSet set = patchesOf(block(places), settings);
        EXPECT_EQ(set.pointsLeft, 500u);
    }
}

TEST(PatchesOfAnything, FarAndLarge) {
    Rng rng(4);
    for (const double scale : {1e-12, 1.0, 1e9}) {
        std::vector<glm::dvec3> places;
        for (int k = 0; k < 1500; ++k)
            places.emplace_back(glm::dvec3(4e6, 5e6, -3e6) * scale +
                                scale * glm::dvec3(10 * rng.uniform(), 10 * rng.uniform(), 0.02 * rng.normal()));
        expectKept(block(places));
        EXPECT_GE(patchesOf(block(places)).patches.size(), 1u);
    }
}

/// Of a mesh: what patches say of themselves holds, and every triangle is near one, or its corners are left.
void expectKept(const lod::TriangleMesh& mesh, lod::PatchClosing closing, uint64_t aimed, size_t samples) {
    lod::PatchSettings settings;
    settings.samples = aimed;
    settings.closing = closing;
    SCOPED_TRACE(static_cast<int>(closing));
    const lod::PatchSet set = patchesOf(mesh, settings);
    const std::vector<Triangle> all = test::trianglesOf(set);
    std::vector<Triangle> source;
    for (const Triangle& t : test::trianglesOf(mesh))
        if (std::isfinite(glm::length(t[0]) + glm::length(t[1]) + glm::length(t[2])) &&
            glm::length(glm::cross(t[1] - t[0], t[2] - t[0])) > 0)
            source.push_back(t);
    for (const lod::Patch& p : set.patches) {
        EXPECT_EQ(lod::patchFault(p), "");
        const std::vector<Triangle> own = test::trianglesOf(p, set.middle);
        for (size_t k = 0; k < own.size(); k += own.size() / 20 + 1)
            for (const glm::dvec3& at : {own[k][0], (own[k][0] + own[k][1] + own[k][2]) / 3.0})
                EXPECT_LE(nearest(source, at), p.errorToSource * (1 + 1e-6) + 1e-12);
    }
    Rng rng(5);
    for (size_t k = 0; k < samples && !source.empty(); ++k) {
        const Triangle& t = source[rng.below(source.size())];
        const double u = rng.uniform(), v = (1 - u) * rng.uniform();
        const glm::dvec3 p = t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
        double least = nearest(all, p);
        if (least <= set.fromSource.bound * (1 + 1e-6)) continue;
        for (const glm::dvec3& q : set.left.position)
            if (glm::distance(q + set.middle, t[0]) < 1e-9) least = 0;
        EXPECT_EQ(least, 0) << "neither near a patch nor left as a point";
    }
}

void expectKept(const lod::TriangleMesh& mesh, uint64_t aimed = 1500, size_t samples = 400) {
    for (const lod::PatchClosing closing : kClosings) expectKept(mesh, closing, aimed, samples);
}

void add(lod::TriangleMesh& mesh, const std::array<glm::dvec3, 3>& corners) {
    for (const glm::dvec3& p : corners) {
        mesh.indices.push_back(static_cast<uint32_t>(mesh.position.size()));
        mesh.position.push_back(p);
    }
}

TEST(PatchesOfAnything, LinesAlongAnEdgeAreThoseOfTheGrid) {
    std::vector<double> at;
    for (const double far : {1e2, 1e7, 1e18, 1e300}) {
        lod::linesAlong({3.5, 2.5}, {far, 0.25 * far}, 20, 10, at);
        EXPECT_LE(at.size(), 32u);
        EXPECT_GE(at.size(), 16u + 2u) << "4 to 19 lie on the way";
        EXPECT_TRUE(std::is_sorted(at.begin(), at.end()));
        lod::linesAlong({-far, -far}, {-3, -2}, 20, 10, at);
        EXPECT_EQ(at.size(), 2u) << "beside the grid";
    }
    // What lies between two neighbours lies in one cell.
    Rng rng(7);
    for (int k = 0; k < 200; ++k) {
        const glm::dvec2 a(rng.uniform(-40, 60), rng.uniform(-40, 60)), b(rng.uniform(-40, 60), rng.uniform(-40, 60));
        lod::linesAlong(a, b, 20, 10, at);
        for (size_t i = 0; i + 1 < at.size(); ++i) {
            const double gap = at[i + 1] - at[i];
            if (gap < 1e-9) continue;
            const glm::dvec2 p = a + (at[i] + 1e-3 * gap) * (b - a), q = a + (at[i + 1] - 1e-3 * gap) * (b - a);
            const glm::dvec2 m = 0.5 * (p + q);
            if (m.x < 0 || m.y < 0 || m.x > 19 || m.y > 9) continue;
            EXPECT_EQ(glm::floor(p), glm::floor(q));
        }
    }
}

TEST(PatchesOfAnything, FineDetailBesideLargeTriangles) {
    lod::TriangleMesh mesh = test::sheet(20, 20, [](double u, double v) {
        return glm::dvec3(1e-8 * u, 1e-8 * v, 1e-10 * std::sin(40 * u) * std::sin(30 * v));
    });
    for (size_t k = 0; k < 20; ++k)  // from one border
        add(mesh, {mesh.position[k + 1], mesh.position[k], glm::dvec3(double(k), -100, 0)});
    expectKept(mesh);  // it would take days, line by line
}

TEST(PatchesOfAnything, SpikesBeyondTheBorder) {
    lod::TriangleMesh mesh = test::sheet(30, 30, [](double u, double v) { return glm::dvec3(u, v, 0); });
    add(mesh, {mesh.position[930], mesh.position[929], glm::dvec3(1, 5, 0)});
    add(mesh, {mesh.position[0], mesh.position[1], glm::dvec3(0, -0.5, 3)});
    expectKept(mesh, 1500, 40000);
    lod::TriangleMesh leaning;  // a row of needles that hang together
    for (int k = 0; k < 60; ++k)
        add(leaning, {glm::dvec3(k, 0, 0), glm::dvec3(k + 1, 0, 0), glm::dvec3(k + 0.5, 8, 20 + k % 3)});
    for (int k = 0; k < 60; ++k)
        add(leaning, {glm::dvec3(k + 1, 0, 0), glm::dvec3(k, 0, 0), glm::dvec3(k + 0.5, -4, -10)});
    expectKept(leaning, 300, 3000);
}

TEST(PatchesOfAnything, SheetsLessThanAStepApart) {
    for (const double turn : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.5}) {
        const double level = turn < 2.5 ? -0.07 : 0.07;  // which one the patch follows hangs on the order
        const auto at = [&](double r, double k, double z) {
            const double a = turn + 2 * k * 3.14159265358979 / 3;
            return glm::dvec3(r * std::cos(a), r * std::sin(a), z);
        };
        lod::TriangleMesh mesh;  // a plateau on a plate, in a rim: three triangles at each edge, so no side is turned
        add(mesh, {at(1, 0, 0), at(1, 1, 0), at(1, 2, 0)});
        add(mesh, {at(0.75, 0, level), at(0.75, 1, level), at(0.75, 2, level)});
        for (int k = 0; k < 3; ++k) {
            add(mesh, {at(1, k, 0), at(1, k + 1, 0), at(0.75, k, level)});
            add(mesh, {at(0.75, k, level), at(1, k + 1, 0), at(0.75, k + 1, level)});
            add(mesh, {at(1, k + 1, 0), at(1, k, 0), at(1.2, k + 0.5, 0)});
        }
        expectKept(mesh, 350, 2000);
    }
}

TEST(PatchesOfAnything, MeshesThatAreNoManifolds) {
    lod::TriangleMesh fins;  // seven half planes on one line
    for (int k = 0; k < 7; ++k) {
        const double a = 0.9 * k;
        const lod::TriangleMesh fin =
            test::sheet(6, 6, [&](double u, double v) { return glm::dvec3(u * std::cos(a), u * std::sin(a), v); });
        const auto first = static_cast<uint32_t>(fins.position.size());
        fins.position.insert(fins.position.end(), fin.position.begin(), fin.position.end());
        for (const uint32_t i : fin.indices) fins.indices.push_back(first + i);
    }
    expectKept(fins);
    const auto band = [](double u, double v) {
        const double a = 6.283185307179586 * u, b = 0.6 * v - 0.3, r = 1 + b * std::cos(a / 2);
        return glm::dvec3(r * std::cos(a), r * std::sin(a), b * std::sin(a / 2));
    };
    lod::TriangleMesh half = test::sheet(60, 4, band);
    expectKept(half);
    for (size_t t = 0; t + 5 < half.indices.size(); t += 6) std::swap(half.indices[t], half.indices[t + 1]);
    expectKept(half);  // every other triangle the other way round
    EXPECT_TRUE(patchesOf(half).isTwoSided);
    EXPECT_LT(patchesOf(half).patches.size(), 30u) << "sides are made to agree";
}

TEST(PatchesOfAnything, ThinTubesNeedlesAndHairlineSheets) {
    const lod::TriangleMesh tube = test::sheet(300, 6, [](double u, double v) {
        const double a = 6.283185307179586 * (v == 1 ? 0 : v);
        return glm::dvec3(10 * u, 0.01 * std::cos(a), 0.01 * std::sin(a));
    });
    expectKept(tube);
    lod::TriangleMesh twice = test::sheet(20, 20, [](double u, double v) { return glm::dvec3(u, v, 0); });
    const lod::TriangleMesh above = test::sheet(20, 20, [](double u, double v) { return glm::dvec3(u, v, 1e-6); });
    for (const uint32_t i : above.indices) twice.indices.push_back(i + static_cast<uint32_t>(twice.position.size()));
    twice.position.insert(twice.position.end(), above.position.begin(), above.position.end());
    expectKept(twice);
    lod::TriangleMesh needles;
    for (uint32_t k = 0; k < 40; ++k) {
        const double x = k;
        needles.position.insert(needles.position.end(), {{x, 0, 0}, {x + 1e-5, 0, 0}, {x, 3, 1}});
        needles.indices.insert(needles.indices.end(), {3 * k, 3 * k + 1, 3 * k + 2});
    }
    expectKept(needles);
}

TEST(PatchesOfAnything, TrianglesThatAreNone) {
    lod::TriangleMesh mesh = test::sheet(10, 10, [](double u, double v) { return glm::dvec3(u, v, u * v); });
    mesh.indices.insert(mesh.indices.end(), {0, 0, 5, 0, 1, 2, 1, 12, 13});  // no area, no area, there already?
    mesh.position.push_back({kNan, 0, 0});
    mesh.indices.insert(mesh.indices.end(), {0, 1, static_cast<uint32_t>(mesh.position.size() - 1)});
    expectKept(mesh);
    const lod::PatchSet set = patchesOf(mesh);
    EXPECT_EQ(set.dropped.at("not finite"), 1u);
    EXPECT_EQ(set.dropped.at("no area"), 2u);
    const lod::PatchSet none = patchesOf(lod::TriangleMesh{});
    EXPECT_TRUE(none.patches.empty());
    EXPECT_TRUE(none.left.position.empty());
}

}  // namespace
}  // namespace stipple
