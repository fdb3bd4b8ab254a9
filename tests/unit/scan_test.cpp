// The simulated scan: its points are what rays meet, says a search through everything, and the same on any machine.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "apps/grow/grow.h"
#include "apps/grow/scan_scene.h"
#include "engine/base/hash.h"
#include "engine/base/rng.h"

namespace stipple {
namespace {

using glm::dvec3;
using grow::scan::Scene;

constexpr double kNearest = 0.3;  ///< of rocks and plants
constexpr double kFarthest = 60;

/// The first t beyond `least` where a quadratic function comes down to 0, given by three of its values.
template <typename Function>
double firstRoot(const Function& f, double least) {
    const double at0 = f(0.0), at1 = f(1.0), at2 = f(2.0);
    const double a = 0.5 * (at2 - 2 * at1 + at0), b = at1 - at0 - a, q = b * b - 4 * a * at0;
    if (!(q >= 0) || a == 0) return INFINITY;
    const double t = (-b - std::sqrt(q)) / (2 * a);
    return t > least ? t : INFINITY;
}

double sphereAlong(const grow::scan::Sphere& s, const dvec3& o, const dvec3& d) {
    return firstRoot(
        [&](double t) { return glm::dot(o + t * d - s.centre, o + t * d - s.centre) - s.radius * s.radius; }, kNearest);
}
double coneAlong(const grow::scan::Cone& k, const dvec3& o, const dvec3& d) {
    const auto along = [&](double t) { return glm::dot(o + t * d - k.a, k.b - k.a) / glm::dot(k.b - k.a, k.b - k.a); };
    const double t = firstRoot(
        [&](double at) {
            const dvec3 off = o + at * d - glm::mix(k.a, k.b, along(at));
            return glm::dot(off, off) - std::pow(glm::mix(k.ra, k.rb, along(at)), 2);
        },
        kNearest);
    return along(t) > 0 && along(t) < 1 ? t : INFINITY;
}
double leafAlong(const grow::scan::Leaf& l, const dvec3& o, const dvec3& d) {
    const double t = glm::dot(l.centre - o, l.normal) / glm::dot(d, l.normal);
    return t > kNearest && glm::distance(o + t * d, l.centre) < l.radius ? t : INFINITY;
}
/// Walls, gables and two slopes of roof.
double houseAlong(const dvec3& o, const dvec3& d) {
    double first = INFINITY;
    const auto offer = [&](double t, bool isMet) { first = isMet && t > 0 && t < first ? t : first; };
    for (const double x : {4.0, 13.0}) {
        const double t = (x - o.x) / d.x;
        const dvec3 p = o + t * d;
        const bool isOutside = (x < 8) == (d.x > 0);
        offer(t, p.y > 4 && p.y < 11 && p.z > -2 && p.z < 3.4 && isOutside);
        offer(t, p.z >= 3.4 && p.z < 6.6 - std::abs(p.y - 7.5) / 1.1);
    }
    for (const double y : {4.0, 11.0}) {
        const double t = (y - o.y) / d.y;
        const dvec3 p = o + t * d;
        offer(t, p.x > 4 && p.x < 13 && p.z > -2 && p.z < 3.4 && (y < 8) == (d.y > 0));
    }
    for (const double side : {-1.0, 1.0}) {  // 1.1 across for 1 down
        const double t = (6.6 - side * (o.y - 7.5) / 1.1 - o.z) / (d.z + side * d.y / 1.1);
        const dvec3 p = o + t * d;
        offer(t, p.x > 3.6 && p.x < 13.4 && (p.y - 7.5) * side > 0 && (p.y - 7.5) * side < 3.9);
    }
    return first;
}
/// Of all that is no ground, without a tree of boxes; kFarthest: nothing.
double thingsAlong(const Scene& scene, const dvec3& o, const dvec3& d) {
    double t = std::min(kFarthest, houseAlong(o, d));
    for (const auto& s : scene.spheres()) t = std::min(t, sphereAlong(s, o, d));
    for (const auto& k : scene.cones()) t = std::min(t, coneAlong(k, o, d));
    for (const auto& l : scene.leaves()) t = std::min(t, leafAlong(l, o, d));
    return t;
}

TEST(Scan, RaysMeetWhatASearchThroughEverythingFinds) {
    const Scene scene(1);
    Rng rng(7);
    std::set<int> met;
    for (int i = 0; i < 1200; ++i) {
        const dvec3 o = scene.scanner(i % 4, 4);
        const dvec3 d = glm::normalize(dvec3(rng.normal(), rng.normal(), 0.4 * rng.normal() + 0.1));
        const grow::scan::Hit hit = scene.traceThings(o, d);
        ASSERT_NEAR(hit.t, thingsAlong(scene, o, d), 1e-8) << "ray " << i << " meets " << hit.material;
        met.insert(hit.material);
    }
    EXPECT_EQ(met, (std::set<int>{-1, 1, 2, 3, 4, 5})) << "nothing, rocks, bark, leaves, walls and roofs";
}

TEST(Scan, PointsWithoutNoiseLieWhereTheirRaysMeetSomething) {
    grow::ScanOptions options;
    options.points = 20000;
    options.positions = 1;
    options.noiseMetres = 0;
    const Scene scene(options.seed);
    const dvec3 o = scene.scanner(0, 1);
    const auto points = grow::growScan(options);
    ASSERT_EQ(points.size(), options.points);
    int onGround = 0, onThings = 0;
    for (size_t i = 0; i < points.size(); i += 47) {
        const dvec3 p{points[i].position[0], points[i].position[1], points[i].position[2]};
        const double t = glm::distance(o, p);
        const dvec3 d = (p - o) / t;
        const double things = thingsAlong(scene, o, d);
        const auto above = [&](double at) { return o.z + at * d.z - scene.ground(o.x + at * d.x, o.y + at * d.y); };
        if (std::abs(things - t) < 1e-8) {
            ++onThings;
        } else {
            ++onGround;
            EXPECT_LT(std::abs(above(t)), 1e-4) << "point " << i << " is nowhere";
            EXPECT_GT(things, t) << "point " << i << " is behind something";
        }
        // (A search in steps may pass through a tuft.)
        for (double at = 0.5; at < t; at += 0.003)
            ASSERT_GT(above(at), -0.02) << "point " << i << " is below the ground";
    }
    EXPECT_GT(onGround, 100);
    EXPECT_GT(onThings, 50);
}

/// Of places to a tenth of a millimetre and colours: sines differ by their last bits from library to library.
uint64_t hashOf(const std::vector<grow::ScanPoint>& points) {
    std::vector<int32_t> numbers;
    for (const auto& p : points)
        for (size_t c = 0; c < 3; ++c) {
            numbers.push_back(static_cast<int32_t>(std::lround(p.position[c] * 1e4)));
            numbers.push_back(p.colour[c]);
        }
    return hashBytes(numbers.data(), numbers.size() * sizeof(int32_t));
}
bool areSame(const grow::ScanPoint& a, const grow::ScanPoint& b) {
    return a.position == b.position && a.colour == b.colour;
}

TEST(Scan, IsTheSamePointsByEveryInstructionSetAndOnAnyThreads) {
    grow::ScanOptions options;
    options.points = 20000;
    options.threads = 1;
    options.vectorBytes = 16;
    const auto wanted = grow::growScan(options);
    EXPECT_EQ(hashOf(wanted), 0xcf8c37d7926e3930u) << std::hex << hashOf(wanted);
    for (const int bytes : {16, 32, 64})
        for (const int threads : {1, 2, 5}) {
            options.vectorBytes = bytes;
            options.threads = threads;
            const auto points = grow::growScan(options);
            EXPECT_TRUE(std::equal(points.begin(), points.end(), wanted.begin(), wanted.end(), areSame))
                << bytes << " bytes, " << threads << " threads";
        }
}

}  // namespace
}  // namespace stipple
