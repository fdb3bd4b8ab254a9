// What is estimated from neighbours and normals: hard cases 22 (normals of no length), 27 (covariances as differences
// of means), 28 (eigenvectors by angles), 29 (angles by acos), 30 (opposing normals). Each with its naive formula.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <bit>
#include <cmath>
#include <numeric>

#include "apps/study/metrics/masks.h"
#include "engine/base/lanes.h"
#include "engine/base/rng.h"
#include "engine/reference/decode.h"
#include "lod/builder/points/aggregate.h"
#include "lod/builder/points/covered.h"
#include "lod/builder/points/select.h"
#include "lod/builder/points/surface_fit.h"
#include "lod/cut/view.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

dvec3 anyDirection(Rng& rng) {
    dvec3 d;
    do d = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
    while (glm::length(d) < 0.1 || glm::length(d) > 1);
    return glm::normalize(d);
}
struct Axes {
    dvec3 n, s, t;
    explicit Axes(Rng& rng) : n(anyDirection(rng)) {
        s = glm::normalize(glm::cross(n, std::abs(n.x) < 0.7 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
        t = glm::cross(n, s);
    }
};
double angleBetween(const dvec3& a, const dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}
/// Of lines: whatever their signs.
double lineAngle(const dvec3& a, const dvec3& b) { return std::min(angleBetween(a, b), angleBetween(-a, b)); }

/// A slab of the given thicknesses along three axes.
std::vector<dvec3> slab(Rng& rng, const Axes& axes, const dvec3& sizes, size_t count) {
    std::vector<dvec3> out;
    for (size_t i = 0; i < count; ++i)
        out.push_back(sizes.x * rng.uniform(-1, 1) * axes.s + sizes.y * rng.uniform(-1, 1) * axes.t +
                      sizes.z * rng.uniform(-1, 1) * axes.n);
    return out;
}
lod::Spread spreadOf(const std::vector<dvec3>& points, const dvec3& origin) {
    lod::Neighbourhood near;
    for (const dvec3& p : points) near.add(glm::vec3(p - origin));
    std::vector<int32_t> squared(near.count + kLanes, lod::kNothing);
    const float from[3] = {0, 0, 0};
    lod::squaredDistances(near.x.data(), near.y.data(), near.z.data(), near.count, from, squared.data());
    return lod::spreadOf(near.neighbours(), from, squared.data(), 3e38f);
}
using Matrix = Eigen::Matrix<long double, 3, 3>;
Matrix covariance(const std::vector<dvec3>& points) {
    Eigen::Matrix<long double, 3, 1> mean = Eigen::Matrix<long double, 3, 1>::Zero();
    for (const dvec3& p : points) mean += Eigen::Matrix<long double, 3, 1>(p.x, p.y, p.z);
    mean /= static_cast<long double>(points.size());
    Matrix sum = Matrix::Zero();
    for (const dvec3& p : points) {
        const Eigen::Matrix<long double, 3, 1> d = Eigen::Matrix<long double, 3, 1>(p.x, p.y, p.z) - mean;
        sum += d * d.transpose();
    }
    return sum / static_cast<long double>(points.size());
}

/// Neighbourhoods of a scan at the earth's centre. (Counted from their own middle, as the builder counts them.)
TEST(Estimates, CovariancesAtTheEarthsCentreAreThoseAtTheOrigin) {
    Rng rng(1);
    double worst = 0, naive = 1e300;
    const dvec3 earth(4.1e6, 5.2e5, 4.9e6);
    for (int k = 0; k < 500; ++k) {
        const Axes axes(rng);
        std::vector<dvec3> points = slab(rng, axes, {0.02, 0.02, 5e-4}, 40);
        for (dvec3& p : points) p += earth;  // rounded to 1e-9 m, which the oracle sees as well
        Eigen::SelfAdjointEigenSolver<Matrix> truth(covariance(points));
        const lod::Spread found = spreadOf(points, points[0]);
        const auto off = [](double v, long double t) { return std::abs(v - static_cast<double>(t)); };
        const double most = static_cast<double>(truth.eigenvalues()[2]);
        worst = std::max({worst, off(found.most, truth.eigenvalues()[2]) / most,
                          off(found.middle, truth.eigenvalues()[1]) / most,
                          off(found.least, truth.eigenvalues()[0]) / most});
        // E[x^2] - E[x]^2, in fp64.
        dvec3 mean(0), square(0);
        for (const dvec3& p : points) {
            mean += p / static_cast<double>(points.size());
            square += p * p / static_cast<double>(points.size());
        }
        const dvec3 variance = square - mean * mean;
        const Matrix c = covariance(points);
        naive = std::min(
            naive, std::max({off(variance.x, c(0, 0)), off(variance.y, c(1, 1)), off(variance.z, c(2, 2))}) / most);
    }
    std::printf("variances %.1e of the largest off; as differences of means at least %.1e\n", worst, naive);
    EXPECT_LE(worst, 1e-6);
    EXPECT_GT(naive, 0.1);
}

/// Normals of sheets, noise and all, at the earth's centre, through a build.
TEST(Estimates, NormalsOfAFineScanAtTheEarthsCentreAreThoseOfItsPlane) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    Rng rng(2);
    const Axes axes(rng);
    std::vector<test::TestPoint> points;
    for (int i = 0; i < 4000; ++i) {
        test::TestPoint p;
        p.position = dvec3(4.1e6, 5.2e5, 4.9e6) + rng.uniform(-0.1, 0.1) * axes.s + rng.uniform(-0.1, 0.1) * axes.t +
                     rng.uniform(-1e-5, 1e-5) * axes.n;
        points.push_back(p);
    }
    test::writePly(folder / "a.ply", points, false);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    size_t wrong = 0;
    const auto discs = test::leafDiscs(*store);
    for (const reference::Disc& d : discs) wrong += !(lineAngle(d.normal, axes.n) < 0.02);
    EXPECT_EQ(discs.size(), points.size());
    EXPECT_LE(wrong, points.size() / 500);  // neighbourhoods at corners are small
}

TEST(Estimates, NormalsOfThinSheetsAreTheirsDownToWhatFloatsHold) {
    Rng rng(3);
    double worst = 0, thickness = 0, naive = 0;
    for (int k = 0; k < 2000; ++k) {
        const Axes axes(rng);
        // Round sheets, whose two larger variances are nearly tied, and long ones; down to 1e-3 of their width.
        const double thin = std::exp2(rng.uniform(-10, -4));
        const auto points = slab(rng, axes, {1, k % 2 == 0 ? 1.0 : 0.3, thin}, 48);
        const Matrix c = covariance(points);
        Eigen::SelfAdjointEigenSolver<Matrix> truth(c);
        const auto e = truth.eigenvectors().col(0);
        const dvec3 n(static_cast<double>(e[0]), static_cast<double>(e[1]), static_cast<double>(e[2]));
        const lod::Spread found = spreadOf(points, dvec3(0));
        worst = std::max(worst, lineAngle(dvec3(found.normal), n));
        const double least = static_cast<double>(truth.eigenvalues()[0]),
                     most = static_cast<double>(truth.eigenvalues()[2]);
        thickness = std::max(thickness, std::abs(found.least - least) / most);
        // Eigenvalues by angles, in fp32 as a shader would have it (Smith 1961).
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> direct;
        direct.computeDirect(c.cast<float>());
        naive = std::max(naive, std::abs(static_cast<double>(direct.eigenvalues()[0]) - least) / most);
    }
    // Exact planes across the axes, as floors and walls are: rows of their covariances are nothing.
    for (int a = 0; a < 3; ++a) {
        Axes flat(rng);
        flat.n = flat.s = flat.t = dvec3(0);
        flat.n[a] = flat.s[(a + 1) % 3] = flat.t[(a + 2) % 3] = 1;
        const lod::Spread found = spreadOf(slab(rng, flat, {1, 0.7, 0}, 48), dvec3(0));
        EXPECT_NEAR(std::abs(double{found.normal[a]}), 1, 1e-6) << "axis " << a;
    }
    std::printf("normals %.1e radians, least variances %.1e of the largest off; by angles in fp32 %.1e\n", worst,
                thickness, naive);
    // Products are sums of 48 floats: 48 ulps of the largest at most, and what turns a normal is as much over the gap
    // between the variances (at least 0.09 of the largest, less what thickness takes).
    EXPECT_LE(thickness, 48 * 0x1p-24);
    EXPECT_LE(worst, 48 * 0x1p-24 / 0.05);
    EXPECT_GT(naive, 2e-7);
}

/// Eigenvectors as a textbook has them: by the angles of Smith (1961), each as the cross product of two rows of
/// A - lambda. Returns the greatest |v . w| of two of them.
double apartByAngles(const Eigen::Matrix3d& a) {
    const double q = a.trace() / 3;
    const Eigen::Matrix3d b = a - q * Eigen::Matrix3d::Identity();
    const double p = std::sqrt(b.squaredNorm() / 6);
    const double angle = std::acos(std::clamp((b / p).determinant() / 2, -1.0, 1.0)) / 3;
    std::array<Eigen::Vector3d, 3> v;
    for (int i = 0; i < 3; ++i) {
        const double lambda = q + 2 * p * std::cos(angle + 2 * M_PI * i / 3);
        const Eigen::Matrix3d m = a - lambda * Eigen::Matrix3d::Identity();
        v.at(static_cast<size_t>(i)) = Eigen::Vector3d(m.row(0)).cross(Eigen::Vector3d(m.row(1))).normalized();
    }
    return std::max({std::abs(v[0].dot(v[1])), std::abs(v[1].dot(v[2])), std::abs(v[2].dot(v[0]))});
}

/// |A v - lambda v| and |V' V - 1| of the solver that estimates use (Eigen's direct one, which takes the best parted
/// eigenvalue first), on what they are given: fp64, trace 1. They are kept as floats: an eighth of a float's rounding
/// is nothing to them.
TEST(Estimates, EigenvectorsOfNearlyTiedAndSingularMatricesAreWhatTheySay) {
    Rng rng(4);
    double residual = 0, apart = 0, naive = 0, off = 0;
    for (int k = 0; k < 10'000; ++k) {
        const Axes axes(rng);
        const double thin = std::exp2(rng.uniform(-60, -2)), tie = k % 3 == 0 ? 0 : std::exp2(rng.uniform(-50, -1));
        const auto column = [](const dvec3& v) { return Eigen::Vector3d(v.x, v.y, v.z); };
        const Eigen::Matrix3d a = thin * column(axes.n) * column(axes.n).transpose() +
                                  column(axes.s) * column(axes.s).transpose() +
                                  (1 - tie) * column(axes.t) * column(axes.t).transpose();
        const Eigen::Matrix3d m = a / a.trace();
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
        solver.computeDirect(m);
        const Eigen::Matrix3d& v = solver.eigenvectors();
        for (int i = 0; i < 3; ++i)
            residual = std::max(residual, (m * v.col(i) - solver.eigenvalues()[i] * v.col(i)).norm());
        apart = std::max(apart, (v.transpose() * v - Eigen::Matrix3d::Identity()).norm());
        off = std::max(off, std::abs(solver.eigenvalues()[0] - thin / a.trace()));
        naive = std::max(naive, apartByAngles(m));
    }
    std::printf("residual %.1e, V'V - 1 %.1e, least %.1e off; as a textbook has it %.1e\n", residual, apart, off,
                naive);
    EXPECT_LE(residual, 0x1p-27);
    EXPECT_LE(apart, 0x1p-24);
    EXPECT_LE(off, 1e-14);
    EXPECT_GT(naive, 0.5);
}

/// Angles between the normals of two pictures, as studies state them.
TEST(Estimates, AnglesBetweenNormalsAreTheirsHoweverSmall) {
    Rng rng(5);
    double worst = 0, naive = 0;
    for (int k = 0; k < 4000; ++k) {
        const double angle = std::min(std::exp2(rng.uniform(-23, 1.7)), M_PI);
        const Axes axes(rng);
        const glm::vec3 a(axes.n), b(std::cos(angle) * axes.n + std::sin(angle) * axes.s);
        render::Image first, second;
        first.width = first.height = second.width = second.height = 1;
        first.rgba = second.rgba = {0xffffffffu};
        first.depth = second.depth = {1};
        first.normal = {a.x, a.y, a.z};
        second.normal = {b.x, b.y, b.z};
        const double found = study::compareMasks(first, second).normalMean / 57.29577951308232;
        worst = std::max(worst, std::abs(found - angle));
        if (angle < 1e-3)
            naive = std::max(naive, std::abs(double{std::acos(std::min(glm::dot(a, b), 1.0f))} - angle) / angle);
    }
    std::printf("%.1e radians; by acos in fp32 small ones %.0f %%\n", worst, 100 * naive);
    EXPECT_LE(worst, 4 * 0x1p-24 + 0x1p-22);
    EXPECT_GT(naive, 0.9);
}

/// Culling by acos of a cosine near 1: what it loses (8 of 1e8 radians in fp64, 3e-4 of the stored fp32 cosine) has to
/// be within the margin that cones have.
TEST(Estimates, AnglesOfConesThatAreCulledByAreWithinTheirMargin) {
    Rng rng(6);
    double worst = 0;
    for (int k = 0; k < 100'000; ++k) {
        const double angle = std::exp2(rng.uniform(-23, 0.6));
        // As nodes keep it, rounded down; as facesAway reads it.
        const auto cosine = std::nextafter(static_cast<float>(std::cos(angle)), -1.0f);
        const double read = std::acos(std::min(double{cosine}, 1.0));
        worst = std::max(worst, std::abs(read - angle));
    }
    std::printf("%.1e radians of %.1e\n", worst, lod::kConeMargin);
    EXPECT_LE(worst, lod::kConeMargin / 20);  // room for 20 generations
}

lod::AggregateRecord recordAt(const dvec3& place, const glm::vec3& normal, uint8_t flags) {
    lod::AggregateRecord r;
    r.count = 1;
    r.mean = r.place = place;
    r.normal = r.meanNormal = normal;
    r.radius = r.inner = 40;
    r.flags = flags;
    return r;
}

/// Pairs of opposite normals in a cell: they split into two records, or the first stands for all; never a normal
/// without length, of any weights.
TEST(Estimates, OpposingNormalsLeaveARecordWithANormal) {
    Rng rng(7);
    size_t split = 0, cancelled = 0;
    for (int k = 0; k < 10'000; ++k) {
        const Axes axes(rng);
        const bool isTwoSided = k % 2 == 0;
        const auto flags = static_cast<uint8_t>(isTwoSided ? shared::kFlagTwoSided : 0u);
        std::vector<lod::AggregateRecord> parts;
        const auto pairs = 1 + rng.below(4);
        for (uint64_t i = 0; i < pairs; ++i) {
            const dvec3 at(rng.uniform(100, 900), rng.uniform(100, 900), rng.uniform(100, 900));
            parts.push_back(recordAt(at, glm::vec3(axes.n), flags));
            parts.push_back(recordAt(at + axes.n, glm::vec3(-axes.n), flags));
        }
        std::vector<uint8_t> side;
        const bool isSplit = lod::splitByNormals(parts, side);
        if (!isTwoSided) {
            ASSERT_TRUE(isSplit) << "two cones";
            for (size_t i = 0; i < parts.size(); ++i) ASSERT_EQ(side[i], side[i % 2]);
            ASSERT_NE(side[0], side[1]);
            ++split;
        }
        glm::vec3 mean(0);
        for (const lod::AggregateRecord& p : parts) mean += p.normal;
        cancelled += glm::length(mean) < 1e-3f;
        lod::RecordGrid grid;
        grid.edge = 65536;
        grid.cellSteps = 1024;
        const lod::Around around(grid, 0, 48, nullptr, {});
        lod::AggregateRecord one;
        lod::mergeAggregates(grid, parts, nullptr, around, one);
        ASSERT_NEAR(glm::length(one.normal), 1, 1e-5);
        ASSERT_LT(lineAngle(dvec3(one.normal), axes.n), 0.01);
        ASSERT_TRUE(std::isfinite(one.radius) && std::isfinite(one.above) && std::isfinite(one.below));
    }
    EXPECT_EQ(split, 5'000u);
    EXPECT_EQ(cancelled, 10'000u);  // the naive mean has no direction, of any of them
}

/// A point without a normal among those that have one gets that of its neighbours, and says so; alone, it says that it
/// has none. Exactly so many.
TEST(Estimates, NormalsOfNoLengthAreEstimatedAndCounted) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    Rng rng(8);
    std::vector<test::TestPoint> points;
    size_t without = 0;
    for (int i = 0; i < 6000; ++i) {
        test::TestPoint p;
        p.position = {rng.uniform(-1, 1), rng.uniform(-1, 1), 0};
        p.normal = {0, 0, 1};
        if (rng.below(10) == 0) {
            p.normal = rng.below(2) == 0 ? glm::vec3(0) : glm::vec3(NAN, 0, 1);
            ++without;
        }
        points.push_back(p);
    }
    test::TestPoint alone;
    alone.position = {0, 0, 40};
    points.push_back(alone);
    test::writePly(folder / "a.ply", points);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    size_t estimated = 0, none = 0, wrong = 0;
    const auto discs = test::leafDiscs(*store);
    for (const reference::Disc& d : discs) {
        const bool isNone = (d.flags & shared::kFlagNoNormal) != 0;
        none += isNone;
        estimated += !isNone && (d.flags & shared::kFlagEstimatedNormal) != 0;
        wrong += !isNone && !(lineAngle(d.normal, {0, 0, 1}) < 0.01);
    }
    EXPECT_EQ(discs.size(), points.size());
    EXPECT_EQ(estimated, without);
    EXPECT_EQ(none, 1u);
    EXPECT_EQ(wrong, 0u);
    // No number that is none in any picture.
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor))
        for (const render::Reconstruction& r : render::reconstructions()) {
            SCOPED_TRACE(name + " " + r.name);
            const lod::View view = [] {
                lod::View v = test::viewFromAbove({0, 0, 0});
                v.width = v.height = 96;
                v.focalPixels = 120;
                return v;
            }();
            const render::Image image = test::renderView(store, *backend, *executor, view, test::drawnAs(r.mode));
            for (const float z : image.depth) ASSERT_TRUE(std::isfinite(z));
            for (const float n : image.normal) ASSERT_TRUE(std::isfinite(n));
        }
}

}  // namespace
}  // namespace stipple
