// How far leaves reach from a record's disc: what one after the other says, to the last bit, however many there are.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "engine/base/rng.h"
#include "lod/builder/points/aggregate.h"

namespace stipple::lod {
namespace {

constexpr size_t kAround = 16;  ///< directions of a disc's plane

Extent plainExtent(const Leaves& leaves, size_t begin, size_t end, const AggregateRecord& record) {
    const glm::vec3 n = record.normal,
                    t1 = glm::normalize(std::abs(n.x) < 0.7f ? glm::vec3(0, -n.z, n.y) : glm::vec3(-n.z, 0, n.x)),
                    t2 = glm::cross(n, t1);
    Extent e;
    e.above = e.below = -1e30f;
    std::array<float, kAround> most;
    most.fill(-1e30f);
    for (size_t i = begin; i < end; ++i) {
        const glm::vec3 d(leaves.points.at(i) - record.place);
        const float u = glm::dot(d, t1), v = glm::dot(d, t2), w = glm::dot(d, n), radius = leaves.points.radius[i];
        const float along = glm::dot(n, leaves.normalOf(i)),
                    rise = radius * std::sqrt(std::max(0.0f, 1 - along * along));
        e.above = std::max(e.above, w + rise);
        e.below = std::max(e.below, rise - w);
        e.reach = std::max(e.reach, std::sqrt(u * u + v * v) + radius);
        for (size_t k = 0; k < kAround; ++k) {
            const double angle = 6.283185307179586 * static_cast<double>(k) / kAround;
            const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
            most.at(k) = std::max(most.at(k), u * c + v * s + radius * std::abs(along));
        }
    }
    e.inner = *std::min_element(most.begin(), most.end());
    return e;
}
float plainReach(const Leaves& leaves, size_t begin, size_t end, const AggregateRecord& record) {
    float reach = 0;
    for (size_t i = begin; i < end; ++i)
        reach = std::max(reach, glm::length(glm::vec3(leaves.points.at(i) - record.place)) + leaves.points.radius[i]);
    return reach;
}

std::array<uint32_t, 4> bitsOf(const Extent& e) {
    return std::bit_cast<std::array<uint32_t, 4>>(std::array<float, 4>{e.reach, e.inner, e.above, e.below});
}
glm::vec3 anyDirection(Rng& rng) {
    return glm::vec3(glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())));
}

TEST(LeafExtent, IsWhatOneLeafAfterTheOtherSays) {
    constexpr size_t kFirst = 3, kBefore = 5, kBehind = 9;  // leaves beside those that are asked for
    Rng rng(39);
    for (int round = 0; round < 400; ++round)
        for (const size_t count : {1u, 2u, 7u, 8u, 9u, 63u, 64u, 65u, 72u, 127u, 128u, 200u}) {
            const size_t begin = kFirst + kBefore, end = begin + count;
            AggregateRecord record;
            record.place = glm::dvec3(1e6) + 100.0 * glm::dvec3(anyDirection(rng));
            record.normal = round % 10 == 0 ? glm::vec3(0, 0, 1) : anyDirection(rng);
            Points points;
            Leaves leaves{points, {}, kFirst, {}, true};
            const double wide = std::exp2(rng.uniform(0, 15));
            for (size_t i = 0; i < end + kBehind; ++i) {
                // Those beside are farther out: with one of them it would be another extent.
                const double far = (i < begin || i >= end ? 20 : 1) * wide;
                const auto any = [&] { return static_cast<uint32_t>(1e6 + rng.uniform(-far, far)); };
                for (auto* axis : {&points.x, &points.y, &points.z}) axis->push_back(any());
                points.radius.push_back(static_cast<float>(far * rng.uniform(0.01, 0.5)));
                // As the record's, none, or any.
                const glm::vec3 normal = rng.below(8) == 0   ? record.normal
                                         : rng.below(8) == 0 ? glm::vec3(0)
                                                             : anyDirection(rng);
                if (i >= kFirst) leaves.normal.push_back(normal);
            }
            ASSERT_EQ(bitsOf(extentOfLeaves(leaves, begin, end, record)),
                      bitsOf(plainExtent(leaves, begin, end, record)))
                << count << " leaves, round " << round;
            record.flags = shared::kFlagNoNormal;
            const Extent ball{plainReach(leaves, begin, end, record)};
            ASSERT_EQ(bitsOf(extentOfLeaves(leaves, begin, end, record)), bitsOf(ball)) << count << ", round " << round;
        }
}

}  // namespace
}  // namespace stipple::lod
