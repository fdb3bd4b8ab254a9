// What patches of points stand on: the nearest of many, and a height fitted to a few.
#include "lod/builder/patches/near_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "engine/base/rng.h"
#include "lod/builder/patches/sheet_fit.h"
#include "lod/builder/points/spacing.h"

namespace stipple::lod {
namespace {

using Order = std::vector<std::pair<float, uint32_t>>;

Order bruteForce(const std::vector<glm::dvec3>& points, const glm::vec3& p, size_t most, float limit) {
    Order all;
    for (uint32_t i = 0; i < points.size(); ++i) {
        const glm::vec3 d = glm::vec3(points[i]) - p;
        const float squared = d.x * d.x + d.y * d.y + d.z * d.z;
        if (squared <= limit) all.emplace_back(squared, i);
    }
    std::sort(all.begin(), all.end());
    all.resize(std::min(all.size(), most));
    return all;
}
Order orderOf(const NearPoints::Found& found) {
    Order out;
    for (size_t k = 0; k < found.count; ++k) out.emplace_back(found.squared.at(k), found.index.at(k));
    return out;
}

/// Row by row, as good as any order for a tree over runs; half of them on a lattice, where many are equally far.
std::vector<glm::dvec3> cloud(Rng& rng) {
    std::vector<glm::dvec3> points;
    for (int k = 0; k < 1200; ++k)
        if (k % 2 == 0)
            points.emplace_back(rng.below(12), k / 100, rng.below(3));
        else
            points.emplace_back(12 * rng.uniform(), k / 100.0, 3 * rng.uniform());
    return points;
}

TEST(NearPoints, OfManyPlacesAreThoseOfEachWhateverTheLimit) {
    Rng rng(3);
    const std::vector<glm::dvec3> points = cloud(rng);
    const NearPoints near(points);
    size_t whole = 0, full = 0, crowded = 0;
    for (int round = 0; round < 300; ++round) {
        const glm::dvec3 lo(12 * rng.uniform(), 12 * rng.uniform(), 3 * rng.uniform());
        const glm::dvec3 size(rng.uniform(), rng.uniform(), rng.uniform());
        const auto limit = static_cast<float>(std::exp2(rng.uniform(-4, 7)));
        NearPoints::Runs runs;
        near.runsNear(lo, lo + size, limit, runs);
        whole += runs.isWhole ? 1 : 0;
        for (int k = 0; k < 8; ++k) {
            const glm::dvec3 p = lo + size * glm::dvec3(rng.uniform(), rng.uniform(), rng.uniform());
            const size_t most = 1 + rng.below(NearPoints::kMost);
            const float own = limit * static_cast<float>(rng.uniform());
            const Order truth = bruteForce(points, glm::vec3(p), most, own);
            NearPoints::Found among, alone;
            near.find(runs, p, most, own, among);
            near.find(p, most, own, alone);
            ASSERT_EQ(orderOf(among), truth) << "of " << most << " within " << own;
            ASSERT_EQ(orderOf(alone), truth);
            full += truth.size() == most ? 1 : 0;
            crowded += bruteForce(points, glm::vec3(p), points.size(), own).size() > 64 ? 1 : 0;
        }
    }
    EXPECT_GT(whole, 100u);  // either way is taken
    EXPECT_LT(whole, 290u);
    EXPECT_GT(full, 500u);
    EXPECT_GT(crowded, 100u);
}

FitPoints pointsOf(Rng& rng, size_t n, const std::function<double(double, double)>& height) {
    FitPoints f;
    for (f.n = 0; f.n < n; ++f.n) {
        const double x = f.x[f.n] = rng.uniform(-1.2, 1.2), y = f.y[f.n] = rng.uniform(-1.2, 1.2);
        f.z[f.n] = height(x, y);
        f.squared[f.n] = x * x + y * y;
    }
    return f;
}

TEST(SheetFit, OfAParaboloidIsThat) {
    Rng rng(5);
    for (size_t n = 10; n <= FitPoints::kRoom; ++n) {
        const auto height = [](double x, double y) { return 0.1 + 0.3 * x - 0.2 * y + 0.15 * x * x - 0.1 * x * y; };
        FitPoints f = pointsOf(rng, n, height);
        SheetFit fit;
        ASSERT_TRUE(fitSheet(f, true, fit));
        const FitTerms truth{0.1, 0.3, -0.2, 0.15, -0.1, 0};
        for (size_t k = 0; k < 6; ++k) EXPECT_NEAR(fit.terms.at(k), truth.at(k), 1e-9) << n;
        EXPECT_LT(fit.loose, 1e-9);
        SheetFit plane;
        if (fitSheet(f, false, plane)) EXPECT_GT(plane.loose, 1e-3);  // it bends
    }
}

/// The first unknown of six equations, by elimination with the largest pivots.
double firstOf(std::array<std::array<double, 7>, 6> m) {
    for (size_t c = 6; c-- > 0;) {
        size_t best = 0;
        for (size_t r = 1; r <= c; ++r)
            if (std::abs(m.at(r).at(c)) > std::abs(m.at(best).at(c))) best = r;
        std::swap(m.at(best), m.at(c));
        for (size_t r = 0; r < c; ++r) {
            const double share = m.at(r).at(c) / m.at(c).at(c);
            for (size_t k = 0; k < 7; ++k) m.at(r).at(k) -= share * m.at(c).at(k);
        }
    }
    return m[0][6] / m[0][0];
}

/// As the definition has it: weights of the distance from the fit itself, by another solver.
TEST(SheetFit, RestsWhereItsWeightsAreThoseOfItsHeight) {
    Rng rng(6);
    int rested = 0;
    for (int round = 0; round < 200; ++round) {
        FitPoints f = pointsOf(rng, 10 + rng.below(15),
                               [&](double x, double y) { return 0.2 * rng.normal() + 0.2 * x - 0.3 * y * y + 0.2; });
        SheetFit fit;
        if (!fitSheet(f, true, fit)) continue;
        std::array<std::array<double, 7>, 6> m{};  // the right side last
        for (size_t k = 0; k < f.n; ++k) {
            const double x = f.x[k], y = f.y[k], d = f.z[k] - fit.height;
            const std::array<double, 7> t{1, x, y, x * x, x * y, y * y, f.z[k]};
            const double w = std::exp(-(f.squared[k] + d * d));
            for (size_t i = 0; i < 6; ++i)
                for (size_t j = 0; j < 7; ++j) m.at(i).at(j) += w * t.at(i) * t.at(j);
        }
        // (One move more of what has moved by less than 1e-4 last.)
        EXPECT_NEAR(firstOf(m), fit.height, 1e-4);
        ++rested;
    }
    EXPECT_GT(rested, 100);
}

TEST(SheetFit, OfPointsAlongALineThereIsNone) {
    FitPoints f;
    for (f.n = 0; f.n < 12; ++f.n) {
        f.x[f.n] = 0.1 * static_cast<double>(f.n) - 0.6;
        f.y[f.n] = f.z[f.n] = 0;
        f.squared[f.n] = f.x[f.n] * f.x[f.n];
    }
    SheetFit fit;
    EXPECT_FALSE(fitSheet(f, true, fit));
}

/// A ball of sines has poles of as many vertices as it has meridians, 1e-16 radii apart.
TEST(DenseSpacing, PlacesThatRoundingAloneTellsApartAreOne) {
    std::vector<glm::dvec3> places;
    constexpr int kAcross = 128;
    for (int i = 0; i <= kAcross / 2; ++i)
        for (int j = 0; j <= kAcross; ++j) {
            const double t = 3.14159265358979323846 * i / (kAcross / 2), p = 2 * 3.14159265358979323846 * j / kAcross;
            places.emplace_back(std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t));
        }
    EXPECT_GT(denseSpacing(places, 1), 1e-4);
    for (glm::dvec3& p : places) p *= 1e-3;  // as near to each other beside a place far away
    places.emplace_back(1e9, 0, 0);
    EXPECT_GT(denseSpacing(places, 1), 1e-7);
    for (glm::dvec3& p : places) p = 1e6 * p + glm::dvec3(1e9, 0, 0);  // what is told apart stays so
    const double spacing = denseSpacing(places, 1);
    EXPECT_GT(spacing, 0.1);
    EXPECT_LT(spacing, 100);
}

}  // namespace
}  // namespace stipple::lod
