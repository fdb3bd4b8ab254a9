// How far a plane belongs to a point, and from where on to its neighbours: what each of them says, one after the other,
// and where places of the plane are nearer to which.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/base/rng.h"
#include "lod/builder/points/surface_fit.h"

namespace stipple::lod {
namespace {

/// Unit vectors, each across the others.
struct Axes {
    glm::vec3 axis, across, normal;
    explicit Axes(Rng& rng) {
        const auto any = [&] { return glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())); };
        const glm::dvec3 n = any(), a = glm::normalize(glm::cross(n, any()));
        axis = a;
        across = glm::cross(n, a);
        normal = n;
    }
};
/// Places about a plane, some of them twice.
std::vector<glm::vec3> anyNear(Rng& rng, const Axes& axes, double thickness) {
    std::vector<glm::vec3> all;
    const auto count = 1 + rng.below(120);
    const auto any = [&](double most) { return static_cast<float>(rng.uniform(-most, most)); };
    for (uint64_t k = 0; k < count; ++k) {
        const float u = any(1.5), v = any(1.5), w = any(1.5 * thickness);
        all.push_back(u * axes.axis + v * axes.across + w * axes.normal);
        if (k > 0 && rng.below(20) == 0) all.back() = all[rng.below(k)];
    }
    return all;
}
std::array<float, kDirections> extentsOf(const std::vector<glm::vec3>& all, const glm::vec3& from, const Axes& axes,
                                         float most) {
    Neighbourhood neighbours;
    for (const glm::vec3& p : all) neighbours.add(p);
    return inverseExtents(neighbours.neighbours(), {from.x, from.y, from.z}, axes.axis, axes.across, most);
}
/// inverseExtents of all neighbours, one after the other.
std::array<float, kDirections> plainExtents(const std::vector<glm::vec3>& all, const glm::vec3& from,
                                            const Axes& axes) {
    constexpr std::array<float, 8> kCosines{1, 0.92387953f,  0.70710678f,  0.38268343f,
                                            0, -0.38268343f, -0.70710678f, -0.92387953f},
        kSines{0, 0.38268343f, 0.70710678f, 0.92387953f, 1, 0.92387953f, 0.70710678f, 0.38268343f};
    std::array<float, kDirections> most{};
    for (const glm::vec3& p : all) {
        const glm::vec3 d = p - from;
        const float squared = glm::dot(d, d), u = glm::dot(d, axes.axis), v = glm::dot(d, axes.across),
                    flat = u * u + v * v;
        if (!(squared > 0) || !(flat > 0) || flat < 0.5f * squared) continue;
        const float inverse = 1 / std::sqrt(flat * squared);
        for (size_t k = 0; k < 8; ++k) {
            const float along = kCosines.at(k) * (u * inverse) + kSines.at(k) * (v * inverse);
            most.at(k) = std::max(most.at(k), along);
            most.at(k + 8) = std::max(most.at(k + 8), -along);
        }
    }
    return most;
}

TEST(SurfaceFit, ExtentsAreThoseOfAllNeighboursAsFarAsTheyCount) {
    Rng rng(36);
    size_t counted = 0, farOnes = 0;
    for (int round = 0; round < 20'000; ++round) {
        const Axes axes(rng);
        const auto all = anyNear(rng, axes, round % 2 == 0 ? 0.02 : 0.6);
        const glm::vec3 from = all[rng.below(all.size())];
        const auto most = static_cast<float>(std::exp2(rng.uniform(-3, 2)));
        const auto found = extentsOf(all, from, axes, most);
        const auto expected = plainExtents(all, from, axes);
        const float floor = 0.499f / most;
        for (size_t k = 0; k < kDirections; ++k) {
            if (expected.at(k) >= floor) {
                ++counted;
                ASSERT_EQ(found.at(k), expected.at(k)) << round << ", direction " << k;
            } else {
                ++farOnes;
                ASSERT_LT(found.at(k), floor) << round << ", direction " << k;
            }
        }
    }
    EXPECT_GT(counted, 50'000u);
    EXPECT_GT(farOnes, 10'000u);
}

/// Beside `from`: those that count, turned into the plane. Of places that lie in it: as they are.
std::vector<glm::dvec3> turned(const std::vector<glm::vec3>& all, const glm::vec3& from, const Axes& axes, bool areIn) {
    std::vector<glm::dvec3> beside;
    for (const glm::vec3& p : all) {
        const glm::dvec3 d = glm::dvec3(p) - glm::dvec3(from), n = axes.normal, foot = d - glm::dot(d, n) * n;
        const double squared = glm::dot(d, d), cosine = glm::dot(foot, foot) / squared;
        if (!(squared > 0) || (!areIn && cosine < 0.5)) continue;
        beside.push_back(areIn ? d : glm::length(d) * glm::normalize(foot));
    }
    return beside;
}

TEST(SurfaceFit, ExtentsReachToWhereThePlaneIsNearerToANeighbour) {
    constexpr double kAlmost = 1e-3;
    Rng rng(37);
    size_t ends = 0, open = 0;
    for (int round = 0; round < 4000; ++round) {
        const bool areIn = round % 2 == 0;
        const Axes axes(rng);
        const auto all = anyNear(rng, axes, areIn ? 0 : 0.6);
        const glm::vec3 from = all[rng.below(all.size())];
        const auto most = static_cast<float>(std::exp2(rng.uniform(-3, 2)));
        const auto found = extentsOf(all, from, axes, most);
        const auto beside = turned(all, from, axes, areIn);
        for (size_t k = 0; k < kDirections; ++k) {
            const double angle = 6.283185307179586 * static_cast<double>(k) / kDirections;
            const glm::dvec3 direction =
                std::cos(angle) * glm::dvec3(axes.axis) + std::sin(angle) * glm::dvec3(axes.across);
            const double reach = 0.5 / static_cast<double>(found.at(k));
            // By how much a place so far on is nearer to some neighbour.
            const auto nearerAt = [&](double far) {
                double nearer = -std::numeric_limits<double>::infinity();
                for (const glm::dvec3& d : beside) nearer = std::max(nearer, far - glm::length(far * direction - d));
                return nearer;
            };
            const bool isOpen = reach > static_cast<double>(most);
            ++(isOpen ? open : ends);
            ASSERT_LT(nearerAt((1 - kAlmost) * (isOpen ? static_cast<double>(most) : reach)), 0) << round << ", " << k;
            if (!isOpen) ASSERT_GT(nearerAt((1 + kAlmost) * reach), 0) << round << ", " << k;
        }
    }
    EXPECT_GT(ends, 10'000u);
    EXPECT_GT(open, 5'000u);
}

}  // namespace
}  // namespace stipple::lod
