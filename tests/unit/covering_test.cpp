// What a fan of rays calls covered is covered, wherever one looks, and how far it reaches is what one circle, ray and
// corner after the other says.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "engine/base/lanes.h"
#include "engine/base/rng.h"
#include "lod/builder/points/fan.h"

namespace stipple::lod {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr float kNarrowest = 0.99518f;  ///< cosine of half the angle between two rays, cut off

void addCircle(Rng& rng, double radius, double most, Circles& circles) {
    const auto any = [&](double from, double to) { return static_cast<float>(radius * rng.uniform(from, to)); };
    const float u = any(-1.3, 1.3), v = any(-1.3, 1.3);
    circles.add(u, v, any(0.05, most));
}
/// Circles of all sizes around a disc, some beside it; of one kind in three those of even samples.
void fillCircles(Rng& rng, double radius, int kind, Circles& circles) {
    circles.count = 0;
    const auto count = static_cast<size_t>(rng.uniform(1, kind == 2 ? 120 : 40));
    const double most = kind == 0 ? 1.6 : kind == 1 ? 0.9 : 0.5;
    for (size_t k = 0; k < count; ++k) addCircle(rng, radius, most, circles);
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

    explicit PlainFan(float r) : radius(r), rim(r / kNarrowest) {
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
    bool isHeldBetween(size_t k, const Circles& circles, size_t i) const {
        return farthestSquared(k, circles.u[i], circles.v[i]) < circles.radius[i] * circles.radius[i];
    }
    float missing(const Circles& circles) const {
        float most = 0;
        for (size_t k = 0; k < kRays; ++k) {
            if (held.at(k) >= rim) continue;
            float lacks = 3e38f;
            for (size_t i = 0; i < circles.count; ++i)
                lacks = std::min(lacks, std::sqrt(farthestSquared(k, circles.u[i], circles.v[i])) - circles.radius[i]);
            most = std::max(most, lacks);
        }
        return most;
    }
};
/// Between rays k and k + 1, in the middle of the rim's chord.
void expectBetween(size_t k, float u, float v, float radius) {
    const double half = 0.5 * kTwoPi / Fan::kRays, angle = (2 * static_cast<double>(k) + 1) * half,
                 out = static_cast<double>(radius) * std::cos(half), most = 1e-6 * static_cast<double>(radius);
    EXPECT_NEAR(static_cast<double>(u), out * std::cos(angle), most) << "between rays, the " << k << "th";
    EXPECT_NEAR(static_cast<double>(v), out * std::sin(angle), most) << "between rays, the " << k << "th";
}

TEST(Covering, FansAreWhatOneCircleAfterTheOtherMakesOfThem) {
    Rng rng(35);
    const auto circles = std::make_unique<Circles>();
    size_t closed = 0, missed = 0;
    for (int round = 0; round < 6000; ++round) {
        const auto radius = static_cast<float>(std::exp2(rng.uniform(-10, 17)));
        fillCircles(rng, static_cast<double>(radius), round % 3, *circles);
        PlainFan plain(radius);
        for (size_t i = 0; i < circles->count; ++i) plain.add(circles->u[i], circles->v[i], circles->radius[i]);
        ASSERT_EQ(Fan(radius).addAll(*circles), plain.least() * kNarrowest) << round;
        Fan fan(radius);
        ASSERT_EQ(fan.add(*circles), plain.least() >= plain.rim) << round;
        if (plain.least() >= plain.rim) continue;
        // Each part between two rays is tried with a run of them that begins and ends anywhere, or is new.
        struct Tried {
            float u, v;
            Circles::Range range;
        };
        std::vector<Tried> tried;
        const bool isClosed = fan.close(*circles, [&](float u, float v) {
            const bool isNew = rng.below(4) == 0;
            const size_t from = isNew ? circles->count : rng.below(circles->count + 1);
            for (uint64_t more = isNew ? 1 + rng.below(3) : 0; more > 0; --more)
                addCircle(rng, static_cast<double>(radius), 1.6, *circles);
            const size_t to = isNew ? circles->count : from + rng.below(circles->count - from + 1);
            return tried.emplace_back(Tried{u, v, {from, to}}).range;
        });
        size_t next = 0;
        for (size_t k = 0; k < Fan::kRays; ++k) {
            if (plain.held.at(k) >= plain.rim) continue;
            ASSERT_LT(next, tried.size()) << "asked for once an open part";
            const auto& [u, v, range] = tried[next++];
            expectBetween(k, u, v, radius);
            for (size_t i = range.first; i < range.last; ++i) {
                if (!plain.isHeldBetween(k, *circles, i)) continue;
                plain.held.at(k) = plain.rim;
                ++closed;
                break;
            }
        }
        ASSERT_EQ(next, tried.size()) << round;
        ASSERT_EQ(isClosed, plain.least() >= plain.rim) << round;
        const float most = plain.missing(*circles);
        ASSERT_EQ(fan.missing(*circles), most) << round;
        missed += most > 0 ? 1 : 0;
    }
    EXPECT_GT(closed, 1000u);
    EXPECT_GT(missed, 1000u);
}

TEST(Covering, CirclesAreAskedForWhereTheyAreWanted) {
    Rng rng(38);
    const auto circles = std::make_unique<Circles>();
    for (int round = 0; round < 200; ++round) {
        const auto radius = static_cast<float>(std::exp2(rng.uniform(-10, 17)));
        // Around those places, each of circles that just reach the centre holds all between its rays.
        for (const float share : {1.001f, 0.99f}) {
            circles->count = 0;
            Fan fan(radius);
            EXPECT_EQ(share > 1, fan.close(*circles, [&](float u, float v) {
                circles->add(u, v, share * radius);
                return Circles::Range{circles->count - 1, circles->count};
            })) << round;
            EXPECT_EQ(circles->count, Fan::kRays) << "an open part each";
            EXPECT_EQ(share > 1, fan.missing(*circles) == 0) << round;
        }
    }
}

TEST(Covering, TheLastOfAsManyAsThereIsRoomForCounts) {
    constexpr size_t kMost = Circles::kMost;
    static_assert(std::tuple_size_v<Circles::Column> >= kMost + kLanes - 1, "a vector may begin at the last of them");
    const auto circles = std::make_unique<Circles>();
    for (size_t k = 0; k < kMost; ++k) circles->add(5, 5, 0.01f);  // beside the disc
    for (size_t k = kMost; k < circles->u.size(); ++k) {           // what lies there is none of them
        circles->u.at(k) = circles->v.at(k) = 0;
        circles->radius.at(k) = 100;
    }
    Fan open(1);
    ASSERT_FALSE(open.add(*circles));
    const auto closes = [&](size_t first, size_t last) {
        return Fan(1).close(*circles, [&](float, float) { return Circles::Range{first, last}; });
    };
    for (size_t first = kMost - 2 * kLanes; first <= kMost; ++first) EXPECT_FALSE(closes(first, kMost)) << first;
    EXPECT_EQ(open.missing(*circles), PlainFan(1).missing(*circles));
    circles->u.at(kMost - 1) = circles->v.at(kMost - 1) = 0;
    circles->radius.at(kMost - 1) = 2;
    for (size_t first = kMost - 2 * kLanes; first < kMost; ++first) {
        EXPECT_TRUE(closes(first, kMost)) << first;
        EXPECT_FALSE(closes(first, kMost - 1)) << first;
    }
    EXPECT_EQ(open.missing(*circles), 0);
    EXPECT_TRUE(open.add(*circles));
}

TEST(Covering, MoreCirclesThanThereIsRoomForAreLeftOut) {
    const auto circles = std::make_unique<Circles>();
    for (size_t k = 0; k < Circles::kMost + 5; ++k) circles->add(0, 0, 1);
    EXPECT_EQ(circles->count, Circles::kMost);
    circles->count = 0;
    circles->add(0, 0, 0);
    circles->add(0, 0, -1);
    circles->add(0, 0, std::numeric_limits<float>::quiet_NaN());
    EXPECT_EQ(circles->count, 0u);
    EXPECT_FALSE(Fan(1).add(*circles));
}

}  // namespace
}  // namespace stipple::lod
