// What a fan of rays calls covered is covered, wherever one looks; and what lies in a box, and in a cell, is what
// looking at one after the other says.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "lod/builder/points/fan.h"
#include "lod/builder/points/inside.h"
#include "lod/builder/points/seen.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

constexpr double kTwoPi = 6.283185307179586;

/// Circles of all sizes around a disc, some beside it; of one kind in three those of even samples.
void fillCircles(Rng& rng, double radius, int kind, Circles& circles) {
    circles.count = 0;
    const auto count = static_cast<size_t>(rng.uniform(1, kind == 2 ? 120 : 40));
    const double most = kind == 0 ? 1.6 : kind == 1 ? 0.9 : 0.5;
    for (size_t k = 0; k < count; ++k)
        circles.add(static_cast<float>(radius * rng.uniform(-1.3, 1.3)),
                    static_cast<float>(radius * rng.uniform(-1.3, 1.3)),
                    static_cast<float>(radius * rng.uniform(0.05, most)));
}
/// Places of the disc, many on its rim, that no circle holds when each is wider by `wider`.
size_t openPlaces(Rng& rng, const Circles& circles, double radius, double wider) {
    size_t open = 0;
    for (int k = 0; k < 400; ++k) {
        const double angle = rng.uniform(0, kTwoPi), r = radius * (k % 2 == 0 ? 1 : std::sqrt(rng.uniform()));
        bool isHeld = false;
        for (size_t i = 0; i < circles.count && !isHeld; ++i) {
            const double u = r * std::cos(angle) - static_cast<double>(circles.u[i]),
                         v = r * std::sin(angle) - static_cast<double>(circles.v[i]);
            isHeld = std::hypot(u, v) <= (static_cast<double>(circles.radius[i]) + wider) * (1 + 1e-4) + 1e-5 * radius;
        }
        open += isHeld ? 0 : 1;
    }
    return open;
}

TEST(Covering, WhatIsHeldIsCovered) {
    Rng rng(31);
    const auto circles = std::make_unique<Circles>();
    size_t held = 0, closed = 0, widened = 0, cores = 0, covered = 0;
    for (int round = 0; round < 6000; ++round) {
        const double radius = std::exp2(rng.uniform(-10, 17));
        fillCircles(rng, radius, round % 3, *circles);
        const auto wanted = static_cast<float>(radius);
        const double core = std::min(static_cast<double>(Fan(wanted).addAll(*circles)), radius);
        if (core > 0) {
            ++cores;
            EXPECT_EQ(openPlaces(rng, *circles, core, 0), 0u) << "within the core, round " << round;
        }
        covered += openPlaces(rng, *circles, radius, 0) == 0 ? 1 : 0;
        Fan fan(wanted);
        if (fan.add(*circles)) {
            ++held;
            EXPECT_EQ(openPlaces(rng, *circles, radius, 0), 0u) << "held, round " << round;
            continue;
        }
        if (fan.close(*circles, [&](float, float) { return Circles::Range{0, circles->count}; })) {
            ++closed;
            EXPECT_EQ(openPlaces(rng, *circles, radius, 0), 0u) << "closed, round " << round;
            continue;
        }
        ++widened;
        const double wider = static_cast<double>(fan.missing(*circles));
        EXPECT_GT(wider, 0);
        EXPECT_EQ(openPlaces(rng, *circles, radius, wider), 0u) << "wider, round " << round;
    }
    EXPECT_GT(held, 400u);
    EXPECT_GT(closed, 20u);
    EXPECT_GT(widened, 1000u);
    EXPECT_GT(cores, 1000u);
    // (A rule that holds nothing would be right, too.)
    EXPECT_GT(held + closed, covered / 2) << "of those that are covered";
}

/// How far out a disc is held between rays, one circle, ray and corner at a time.
struct PlainFan {
    static constexpr size_t kRays = Fan::kRays;
    std::array<float, kRays + 1> c, s;
    std::array<float, kRays> held{};
    float radius, rim;

    explicit PlainFan(float r) : radius(r), rim(r / 0.99518f) {
        for (size_t k = 0; k <= kRays; ++k) {
            c.at(k) = static_cast<float>(std::cos(kTwoPi * static_cast<double>(k) / kRays));
            s.at(k) = static_cast<float>(std::sin(kTwoPi * static_cast<double>(k) / kRays));
        }
    }
    void add(float u, float v, float r) {
        const float c2 = u * u + v * v, power = r * r - c2;
        if (power > 0 && r > radius && c2 < (r - radius) * (r - radius)) return held.fill(rim);
        std::array<std::pair<float, float>, kRays + 1> span;
        for (size_t k = 0; k < kRays; ++k) {
            const float along = u * c.at(k) + v * s.at(k), half = std::sqrt(std::max(power + along * along, 0.0f));
            span.at(k) = {along - half, along + half};
        }
        span.at(kRays) = span.at(0);
        for (size_t k = 0; k < kRays; ++k)
            if (std::max(span.at(k).first, span.at(k + 1).first) <= held.at(k))
                held.at(k) = std::max(held.at(k), std::min(span.at(k).second, span.at(k + 1).second));
    }
    float least() const { return *std::min_element(held.begin(), held.end()); }
    float farthestSquared(size_t k, float u, float v) const {
        float most = 0;
        for (const size_t ray : {k, k + 1})
            for (const float out : {held.at(k), rim}) {
                const float du = out * c.at(ray) - u, dv = out * s.at(ray) - v;
                most = std::max(most, du * du + dv * dv);
            }
        return most;
    }
};

TEST(Covering, FansAreWhatOneCircleAfterTheOtherMakesOfThem) {
    Rng rng(35);
    const auto circles = std::make_unique<Circles>();
    size_t closed = 0, missed = 0;
    for (int round = 0; round < 6000; ++round) {
        const auto radius = static_cast<float>(std::exp2(rng.uniform(-10, 17)));
        fillCircles(rng, static_cast<double>(radius), round % 3, *circles);
        PlainFan plain(radius);
        for (size_t i = 0; i < circles->count; ++i) plain.add(circles->u[i], circles->v[i], circles->radius[i]);
        ASSERT_EQ(Fan(radius).addAll(*circles), plain.least() * 0.99518f) << round;
        Fan fan(radius);
        ASSERT_EQ(fan.add(*circles), plain.least() >= plain.rim) << round;
        if (plain.least() >= plain.rim) continue;
        // Each part between two rays is tried with a run of them that begins and ends anywhere.
        std::vector<Circles::Range> tried;
        const bool isClosed = fan.close(*circles, [&](float, float) {
            const size_t from = rng.below(circles->count + 1), to = from + rng.below(circles->count - from + 1);
            return tried.emplace_back(Circles::Range{from, to});
        });
        size_t next = 0;
        for (size_t k = 0; k < Fan::kRays; ++k) {
            if (plain.held.at(k) >= plain.rim) continue;
            ASSERT_LT(next, tried.size()) << "asked for once an open part";
            const Circles::Range range = tried[next++];
            const auto isHeldBy = [&](size_t i) {
                return plain.farthestSquared(k, circles->u[i], circles->v[i]) < circles->radius[i] * circles->radius[i];
            };
            for (size_t i = range.first; i < range.last; ++i)
                if (isHeldBy(i)) {
                    plain.held.at(k) = plain.rim;
                    ++closed;
                    break;
                }
        }
        ASSERT_EQ(next, tried.size()) << round;
        ASSERT_EQ(isClosed, plain.least() >= plain.rim) << round;
        float most = 0;
        for (size_t k = 0; k < Fan::kRays; ++k) {
            if (plain.held.at(k) >= plain.rim) continue;
            float least = 3e38f;
            for (size_t i = 0; i < circles->count; ++i)
                least = std::min(
                    least, std::sqrt(plain.farthestSquared(k, circles->u[i], circles->v[i])) - circles->radius[i]);
            most = std::max(most, least);
        }
        ASSERT_EQ(fan.missing(*circles), most) << round;
        missed += most > 0 ? 1 : 0;
    }
    EXPECT_GT(closed, 1000u);
    EXPECT_GT(missed, 1000u);
}

TEST(Covering, MoreCirclesThanThereIsRoomForAreLeftOut) {
    const auto circles = std::make_unique<Circles>();
    for (size_t k = 0; k < Circles::kMost + 5; ++k) circles->add(0, 0, 1);
    EXPECT_EQ(circles->count, Circles::kMost);
    circles->count = 0;
    circles->add(0, 0, 0);
    circles->add(0, 0, -1);
    EXPECT_EQ(circles->count, 0u);
    EXPECT_FALSE(Fan(1).add(*circles));
}

TEST(Inside, IsWhatLookingAtEachSays) {
    Rng rng(32);
    constexpr uint32_t kMost = UINT32_MAX;
    size_t all = 0, none = 0;
    for (int round = 0; round < 4000; ++round) {
        const auto count = static_cast<size_t>(rng.uniform(0, 700)), begin = std::min<size_t>(count, rng.below(20));
        std::array<std::vector<uint32_t>, 3> place;
        // Few different ones, all there are, and both ends of what 32 bits hold.
        const auto any = [&]() -> uint32_t {
            switch (round % 3) {
                case 0:
                    return static_cast<uint32_t>(rng.below(12));
                case 1:
                    return static_cast<uint32_t>(rng.below(uint64_t{1} << 32));
                default:
                    return rng.below(2) == 0 ? static_cast<uint32_t>(rng.below(9))
                                             : kMost - static_cast<uint32_t>(rng.below(9));
            }
        };
        for (auto& column : place)
            for (size_t k = 0; k < count; ++k) column.push_back(any());
        LatticeBox box;
        for (size_t a = 0; a < 3; ++a) {
            const int64_t from = any(), to = any();
            box.lo[a] = std::min(from, to) - (rng.below(4) == 0 ? int64_t{1} << 33 : 0);
            box.hi[a] = std::max(from, to) + (rng.below(4) == 0 ? int64_t{1} << 33 : 0);
            if (rng.below(30) == 0) box.lo[a] = box.hi[a] = rng.below(2) == 0 ? -5 : int64_t{1} << 34;  // holds nothing
        }
        std::vector<size_t> expected, found;
        for (size_t i = begin; i < count; ++i)
            if (box.holds(place[0][i], place[1][i], place[2][i])) expected.push_back(i);
        forInside({place[0].data(), place[1].data(), place[2].data()}, begin, count, box,
                  [&](size_t i) { found.push_back(i); });
        ASSERT_EQ(found, expected) << "round " << round;
        all += expected.size();
        none += expected.empty() ? 1 : 0;
    }
    EXPECT_GT(all, 50'000u);
    EXPECT_GT(none, 500u);
}

template <typename K>
void expectRanges(uint64_t seed, int bits) {
    Rng rng(seed);
    for (int round = 0; round < 60; ++round) {
        // Clumps far apart, as surfaces have them; sometimes one key, or none.
        std::vector<Key> keys;
        const auto clumps = rng.below(5);
        for (uint64_t c = 0; c < clumps; ++c) {
            const Key at = static_cast<Key>(rng.below(uint64_t{1} << 62)) << (bits - 62);
            const auto shift = round % 4 == 0 ? 0 : rng.below(30);  // (all equal)
            const auto count = round % 3 == 0 ? 1 : rng.below(4000);
            for (uint64_t k = 0; k < count; ++k) keys.push_back(at + static_cast<Key>(rng.below(1u << shift)));
        }
        std::sort(keys.begin(), keys.end());
        const SortedKeys<K> sorted{keys};
        ASSERT_EQ(sorted.all().size(), keys.size());
        for (int k = 0; k < 3000; ++k) {
            const auto shift = static_cast<uint32_t>(rng.below(static_cast<uint64_t>(bits) + 1));
            // Beside one that is there, or anywhere.
            K key = static_cast<K>(rng.below(uint64_t{1} << 62)) << (bits - 62);
            if (!keys.empty() && k % 4 != 0)
                key = static_cast<K>(keys[rng.below(keys.size())]) + static_cast<K>(rng.below(3)) - 1;
            const K lo = key >> shift << shift, last = lo | ((K{1} << shift) - 1);
            const auto first = std::lower_bound(sorted.all().begin(), sorted.all().end(), lo),
                       end = std::upper_bound(first, sorted.all().end(), last);
            const KeyRange range = sorted.range(key, shift);
            ASSERT_EQ(range.second - range.first, static_cast<size_t>(end - first)) << round << ", shift " << shift;
            if (first != end) ASSERT_EQ(range.first, static_cast<size_t>(first - sorted.all().begin()));
        }
    }
}
/// inverseExtents of all neighbours, one after the other.
std::array<float, kDirections> plainExtents(const std::vector<glm::vec3>& all, const glm::vec3& from,
                                            const glm::vec3& axis, const glm::vec3& across) {
    constexpr std::array<float, 8> kCosines{1, 0.92387953f,  0.70710678f,  0.38268343f,
                                            0, -0.38268343f, -0.70710678f, -0.92387953f},
        kSines{0, 0.38268343f, 0.70710678f, 0.92387953f, 1, 0.92387953f, 0.70710678f, 0.38268343f};
    std::array<float, kDirections> most{};
    for (const glm::vec3& p : all) {
        const glm::vec3 d = p - from;
        const float squared = glm::dot(d, d), u = glm::dot(d, axis), v = glm::dot(d, across), flat = u * u + v * v;
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
        std::vector<glm::vec3> all;
        Neighbourhood neighbours;
        const auto count = 1 + rng.below(120);
        const float thickness = round % 2 == 0 ? 0.02f : 0.6f;
        for (uint64_t k = 0; k < count; ++k) {
            const auto any = [&] { return static_cast<float>(rng.uniform(-1.5, 1.5)); };
            all.emplace_back(any(), any(), thickness * any());
            if (k > 0 && rng.below(20) == 0) all.back() = all[rng.below(k)];  // a copy
            neighbours.add(all.back());
        }
        const glm::vec3 from = all[rng.below(count)], axis(1, 0, 0), across(0, 1, 0);
        const auto most = static_cast<float>(std::exp2(rng.uniform(-3, 2)));
        const auto found = inverseExtents(neighbours.neighbours(), {from.x, from.y, from.z}, axis, across, most);
        const auto expected = plainExtents(all, from, axis, across);
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

TEST(SortedKeys, RangesAreThoseOfASearchAmongAll) {
    expectRanges<uint64_t>(33, 63);
    expectRanges<Key>(34, 96);
}

}  // namespace
}  // namespace stipple::lod
