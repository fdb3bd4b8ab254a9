// The error of a record without a normal: no place of its ball is farther than that from one of the balls it stands
// for, whether those are measured one after the other or four sets at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "lod/builder/points/covered.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

/// Leaves around a place, some of them far smaller than others, and the record that reaches round all.
struct Scene {
    Points points;
    AggregateRecord record;
    Scene(Rng& rng, size_t count) {
        const double spread = std::exp2(rng.uniform(0, 8));
        record.place = glm::dvec3(1000, 2000, 3000) + glm::dvec3(rng.uniform(), rng.uniform(), rng.uniform());
        record.count = static_cast<uint32_t>(count);
        record.flags = shared::kFlagNoNormal;
        for (size_t k = 0; k < count; ++k) {
            const auto along = [&](double from) { return static_cast<uint32_t>(from + spread * rng.uniform(-1, 1)); };
            points.x.push_back(along(1000));
            points.y.push_back(along(2000));
            points.z.push_back(along(3000));
            points.radius.push_back(static_cast<float>(spread * rng.uniform(0.01, 0.5)));
            const double reach = glm::length(points.at(k) - record.place) + static_cast<double>(points.radius[k]);
            record.radius = std::max(record.radius, static_cast<float>(reach * (1 + 1e-6)));
        }
    }
    /// Of the leaves, or where they are records of one to three leaves each.
    double error(bool areLeaves) const {
        const std::vector<Key> keys(points.size(), 0);
        const Leaves leaves{points, keys, 0, {}, false};
        std::vector<AggregateRecord> parts(areLeaves ? 0 : points.size());
        for (size_t k = 0; k < parts.size(); ++k) {
            parts[k].mean = parts[k].place = points.at(k);
            parts[k].count = 1 + points.x[k] % 3;
            parts[k].radius = points.radius[k];
        }
        return coveringErrorOfBall(record, parts, areLeaves ? &leaves : nullptr);
    }
    /// Each leaf `times` times.
    Scene repeated(size_t times) const {
        Scene out = *this;
        for (size_t t = 1; t < times; ++t) {
            out.points.x.insert(out.points.x.end(), points.x.begin(), points.x.end());
            out.points.y.insert(out.points.y.end(), points.y.begin(), points.y.end());
            out.points.z.insert(out.points.z.end(), points.z.begin(), points.z.end());
            out.points.radius.insert(out.points.radius.end(), points.radius.begin(), points.radius.end());
        }
        out.record.count = static_cast<uint32_t>(out.points.size());
        return out;
    }
};

glm::dvec3 somePlaceOnASphere(Rng& rng) {
    const double z = rng.uniform(-1, 1), angle = rng.uniform(0, 6.283185307179586), r = std::sqrt(1 - z * z);
    return {r * std::cos(angle), r * std::sin(angle), z};
}

TEST(Balls, NoPlaceOfARecordsBallIsFartherFromALeafThanItsErrorSays) {
    Rng rng(21);
    double tightest = 0;
    for (int round = 0; round < 2000; ++round) {
        const Scene scene(rng, 2 + static_cast<size_t>(round) % 30);
        const double error = scene.error(true);
        double farthest = 0;
        for (int k = 0; k < 200; ++k) {
            const glm::dvec3 place = scene.record.place + static_cast<double>(scene.record.radius) *
                                                              (k % 4 == 0 ? std::cbrt(rng.uniform()) : 1.0) *
                                                              somePlaceOnASphere(rng);
            double nearest = 1e300;
            for (size_t i = 0; i < scene.points.size(); ++i)
                nearest = std::min(
                    nearest, glm::length(place - scene.points.at(i)) - static_cast<double>(scene.points.radius[i]));
            farthest = std::max(farthest, nearest);
        }
        ASSERT_LE(farthest, error * (1 + 1e-9)) << scene.points.size() << " leaves, round " << round;
        tightest = std::max(tightest, farthest / error);
    }
    EXPECT_GT(tightest, 0.9) << "a bound of nothing";
}

TEST(Balls, AreMeasuredAlikeWhetherTheyAreFewOrMany) {
    Rng rng(22);
    size_t apart = 0;
    for (int round = 0; round < 2000; ++round) {
        const Scene few(rng, 2 + static_cast<size_t>(round) % 10);
        for (const bool areLeaves : {false, true}) {
            // (Their mean and all distances stay; 13 and more are measured four sets at once.)
            const double once = few.error(areLeaves), often = few.repeated(7).error(areLeaves);
            ASSERT_NEAR(once, often, 1e-9 * once) << few.points.size() << " balls, leaves: " << areLeaves;
            apart += once > static_cast<double>(few.record.radius) * (1 + 1e-9) ? 1 : 0;
        }
    }
    EXPECT_GT(apart, size_t{1000}) << "hardly any error is more than the radius, which it is at least";
}

}  // namespace
}  // namespace stipple::lod
