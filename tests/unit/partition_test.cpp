// Graphs of clusters in groups: sizes, borders, and graphs that no surface has.
#include "lod/builder/mesh/partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <thread>

#include "engine/base/rng.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kSize = 8;

using Links = std::map<std::pair<uint32_t, uint32_t>, int32_t>;

ClusterGraph graphOf(uint32_t count, const Links& links) {
    std::map<uint32_t, std::map<uint32_t, int32_t>> both;
    for (const auto& [ends, weight] : links) {
        both[ends.first][ends.second] += weight;
        both[ends.second][ends.first] += weight;
    }
    ClusterGraph graph;
    for (uint32_t v = 0; v < count; ++v) {
        for (const auto& [n, weight] : both[v]) {
            graph.neighbour.push_back(n);
            graph.weight.push_back(weight);
        }
        graph.start.push_back(static_cast<uint32_t>(graph.neighbour.size()));
    }
    return graph;
}

/// A square of clusters, each with four neighbours, numbered in the order `number`.
Links square(uint32_t edge, const std::vector<uint32_t>& number) {
    Links links;
    for (uint32_t y = 0; y < edge; ++y)
        for (uint32_t x = 0; x < edge; ++x) {
            const uint32_t here = number[y * edge + x];
            if (x + 1 < edge) links[{here, number[y * edge + x + 1]}] = 16;
            if (y + 1 < edge) links[{here, number[(y + 1) * edge + x]}] = 16;
        }
    return links;
}
std::vector<uint32_t> inOrder(uint32_t count) {
    std::vector<uint32_t> number(count);
    for (uint32_t i = 0; i < count; ++i) number[i] = i;
    return number;
}

int64_t between(const Links& links, const std::vector<uint32_t>& part) {
    int64_t sum = 0;
    for (const auto& [ends, weight] : links) sum += part[ends.first] != part[ends.second] ? weight : 0;
    return sum;
}

/// Every part that there should be is there, and none is empty, too large or too small.
void expectSizes(const std::vector<uint32_t>& part, uint32_t count, uint32_t size = kSize) {
    ASSERT_EQ(part.size(), count);
    const uint32_t parts = (count + size - 1) / size;
    std::vector<uint32_t> sizes(parts);
    for (const uint32_t p : part) {
        ASSERT_LT(p, parts);
        ++sizes[p];
    }
    for (const uint32_t n : sizes) {
        EXPECT_GE(n, std::max(1u, std::min(count / parts, size * 5 / 8)));
        EXPECT_LE(n, std::max((count + parts - 1) / parts, (size * 5 + 3) / 4));
    }
}

TEST(Partition, ASquareHasBordersAlmostAsShortAsItsTiling) {
    // 2 x 4 clusters a group: of each two rows one border is between groups, of each four columns one.
    constexpr uint32_t kEdge = 32;
    constexpr int64_t kTiled = 16 * (kEdge * (kEdge / 2 - 1) + kEdge * (kEdge / 4 - 1));
    std::vector<uint32_t> number = inOrder(kEdge * kEdge);
    for (int shuffled = 0; shuffled < 2; ++shuffled) {
        const Links links = square(kEdge, number);
        const std::vector<uint32_t> part = partition(graphOf(kEdge * kEdge, links), kSize);
        expectSizes(part, kEdge * kEdge);
        EXPECT_LE(static_cast<double>(between(links, part)), 1.12 * kTiled) << "shuffled: " << shuffled;
        Rng rng(5);
        for (size_t i = number.size(); i > 1; --i) std::swap(number[i - 1], number[rng.below(i)]);
    }
}

TEST(Partition, GroupsThatHardlyTouchStayWhole) {
    // Eight that share much, all of them little: there is one best answer.
    constexpr uint32_t kGroups = 23;
    std::vector<uint32_t> number = inOrder(kGroups * kSize);
    Rng rng(7);
    for (size_t i = number.size(); i > 1; --i) std::swap(number[i - 1], number[rng.below(i)]);
    Links links;
    for (uint32_t g = 0; g < kGroups; ++g)
        for (uint32_t a = 0; a < kSize; ++a) {
            for (uint32_t b = a + 1; b < kSize; ++b) links[{number[g * kSize + a], number[g * kSize + b]}] = 100;
            if (g + 1 < kGroups) links[{number[g * kSize + a], number[(g + 1) * kSize + a]}] = 1;
        }
    const std::vector<uint32_t> part = partition(graphOf(kGroups * kSize, links), kSize);
    for (uint32_t g = 0; g < kGroups; ++g)
        for (uint32_t a = 1; a < kSize; ++a) EXPECT_EQ(part[number[g * kSize + a]], part[number[g * kSize]]) << g;
}

TEST(Partition, WhatTouchesNothingAndWhatTouchesAll) {
    for (const uint32_t count : {1u, 7u, 8u, 9u, 16u, 17u, 100u, 1001u}) {
        expectSizes(partition(graphOf(count, {}), kSize), count);
        Links star, chain;
        for (uint32_t v = 1; v < count; ++v) {
            star[{0, v}] = 3;
            chain[{v - 1, v}] = 1;
        }
        expectSizes(partition(graphOf(count, star), kSize), count);
        const std::vector<uint32_t> part = partition(graphOf(count, chain), kSize);
        expectSizes(part, count);
        EXPECT_LE(between(chain, part), static_cast<int64_t>((count + kSize - 1) / kSize) - 1);  // each part in one
    }
}

/// Twelve clusters are two groups of six: only an exchange can change them.
TEST(Partition, GroupsOfExactSizesAreExchanged) {
    Links links;
    const auto ofFirst = [](uint32_t v) { return v % 2 == 0; };
    for (uint32_t a = 0; a < 12; ++a)
        for (uint32_t b = a + 1; b < 12; ++b)
            if (ofFirst(a) == ofFirst(b)) links[{a, b}] = 1 + static_cast<int32_t>((a * 7 + b * 3) % 4);
    const std::vector<uint32_t> part = partition(graphOf(12, links), kSize);
    EXPECT_EQ(between(links, part), 0);
}

TEST(Partition, PartsOfOne) {
    const std::vector<uint32_t> part = partition(graphOf(16, {{{7, 8}, 1}}), 1);
    expectSizes(part, 16, 1);
}

TEST(Partition, RandomGraphsOfAllSizes) {
    Rng rng(11);
    for (uint32_t count = 1; count < 90; ++count)
        for (const uint32_t size : {1u, 2u, 3u, 8u, 20u}) {
            Links links;
            for (uint32_t k = 0; k < 3 * count && count > 1; ++k) {
                const auto a = static_cast<uint32_t>(rng.below(count)), b = static_cast<uint32_t>(rng.below(count));
                if (a < b) links[{a, b}] = 1 + static_cast<int32_t>(rng.below(50));
            }
            expectSizes(partition(graphOf(count, links), size), count, size);
        }
}

/// More than a set may have for its borders to be looked at: they still are, of its parts.
TEST(Partition, ManyMoreThanACellHas) {
    constexpr uint32_t kEdge = 110;
    const Links links = square(kEdge, inOrder(kEdge * kEdge));
    const std::vector<uint32_t> part = partition(graphOf(kEdge * kEdge, links), kSize);
    expectSizes(part, kEdge * kEdge);
    constexpr int64_t kTiled = 16 * (kEdge * (kEdge / 2) + kEdge * (kEdge / 4));
    EXPECT_LE(static_cast<double>(between(links, part)), 1.15 * kTiled);
}

TEST(Partition, IsTheSameOnManyThreadsAtOnce) {
    const ClusterGraph graph = graphOf(400, square(20, inOrder(400)));
    const std::vector<uint32_t> expected = partition(graph, kSize);
    std::vector<std::vector<uint32_t>> found(4);
    std::vector<std::thread> threads;
    for (auto& mine : found) threads.emplace_back([&] { mine = partition(graph, kSize); });
    for (std::thread& t : threads) t.join();
    for (const auto& mine : found) EXPECT_EQ(mine, expected);
}

}  // namespace
}  // namespace stipple::lod
