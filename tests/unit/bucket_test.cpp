// How points travel to their bucket and come out of it: keys of many at once, records in each of their forms, and the
// order, which must not depend on the one in which they came.
#include "lod/builder/points/bucket.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <tuple>
#include <vector>

#include "lod/builder/points/sorted.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

/// A frame whose lattice spans 2^rootLog2, with as many levels of keys.
Frame frameOf(uint32_t rootLog2, uint32_t keyLevels) {
    Frame frame;
    frame.rootLog2 = rootLog2;
    frame.keyLevels = keyLevels;
    frame.errors = errorsOf(rootLog2);
    return frame;
}

Place somePlace(Rng& rng, uint32_t bits) {
    Place place{};
    for (uint64_t& v : place) v = static_cast<uint64_t>(rng.uniform() * std::exp2(bits));
    return place;
}
void append(Points& to, const Place& place, bool isWide) {
    to.x.push_back(static_cast<uint32_t>(place[0]));
    to.y.push_back(static_cast<uint32_t>(place[1]));
    to.z.push_back(static_cast<uint32_t>(place[2]));
    if (isWide) to.high.push_back(highOf(place));
}

/// Bit by bit, as nobody would who is in a hurry.
Key keyBitByBit(const Frame& frame, const Place& place) {
    Key key = 0;
    for (uint32_t level = 0; level < frame.keyLevels; ++level)
        for (size_t a = 0; a < 3; ++a)
            key |= Key{place.at(a) >> (frame.rootLog2 - frame.keyLevels + level) & 1u} << (3 * level + a);
    return key;
}

TEST(Keys, OfManyAtOnceAreThoseOfEach) {
    Rng rng(5);
    // (Exact ones, of which the root is as deep as a short key; shifted ones; long ones; ones of wide places.)
    for (const auto& [root, levels] :
         {std::pair{17u, 17u}, {21u, 21u}, {31u, 21u}, {32u, 21u}, {40u, 21u}, {31u, 30u}, {50u, 42u}}) {
        const Frame frame = frameOf(root, levels);
        for (const size_t count : {size_t{0}, size_t{1}, size_t{7}, kKeysAtOnce - 1, kKeysAtOnce, kKeysAtOnce + 3}) {
            Points points;
            for (size_t i = 0; i < count; ++i) append(points, somePlace(rng, root), root > 32);
            size_t seen = 0;
            forEachKey(frame, points.coordinates(), [&](size_t i, auto key) {
                ASSERT_EQ(i, seen++);
                ASSERT_TRUE(Key{key} == keyBitByBit(frame, points.place(i))) << root << " " << levels << " " << i;
            });
            ASSERT_EQ(seen, count);
        }
    }
}

TEST(Keys, HoldExactPlaces) {
    Rng rng(6);
    const Frame frame = frameOf(21, 21);
    std::array<uint64_t, 101> keys{};
    std::array<uint32_t, 101> x{}, y{}, z{};
    std::vector<Place> places;
    for (uint64_t& key : keys) key = static_cast<uint64_t>(frame.keyOf(places.emplace_back(somePlace(rng, 21))));
    placesOfShortKeys(keys.data(), keys.size(), x.data(), y.data(), z.data());
    for (size_t i = 0; i < keys.size(); ++i) ASSERT_EQ((Place{x[i], y[i], z[i]}), places[i]);
}

/// What a record holds, in the order that is promised within one place.
struct Record {
    Place place;
    uint32_t colour, normal;
    float radius;
    std::array<uint8_t, 3> attributes;
};

/// All of their bytes as they travel, so that equal keys have an order.
auto orderOf(const Frame& frame, const Record& r) {
    const auto bytesOf = [](uint64_t value) {  // the lowest first
        std::array<uint8_t, 8> bytes{};
        for (size_t k = 0; k < 8; ++k) bytes.at(k) = static_cast<uint8_t>(value >> (8 * k));
        return bytes;
    };
    const bool isWide = frame.rootLog2 > 32;
    const Place low{r.place[0] & 0xffffffffu, r.place[1] & 0xffffffffu, r.place[2] & 0xffffffffu};
    return std::tuple(keyBitByBit(frame, r.place), bytesOf(low[0]), bytesOf(low[1]), bytesOf(low[2]),
                      bytesOf(isWide ? highOf(r.place) : 0), bytesOf(r.colour), bytesOf(r.normal),
                      bytesOf(std::bit_cast<uint32_t>(r.radius)), r.attributes);
}

/// Some at one place or a step beside it, some alike in all.
std::vector<Record> someRecords(Rng& rng, uint32_t bits, size_t count) {
    std::vector<Record> records;
    for (size_t i = 0; i < count; ++i) {
        Record r{somePlace(rng, bits),
                 static_cast<uint32_t>(rng.uniform(0, 3)) << 8,
                 static_cast<uint32_t>(rng.uniform(0, 2)),
                 static_cast<float>(rng.uniform(0, 2)),
                 {static_cast<uint8_t>(rng.uniform(0, 2)), static_cast<uint8_t>(rng.uniform(0, 255)), 0}};
        if (i % 3 != 0) r.place = records[static_cast<size_t>(rng.uniform() * static_cast<double>(i))].place;
        if (i % 7 == 6) r = records[i / 2];
        if (i % 5 == 4) r.place[2] ^= 1;  // beside another, within one cell of keys that are none of lattice places
        records.push_back(r);
    }
    return records;
}

std::vector<AttributeInfo> twoAttributes() {
    std::vector<AttributeInfo> attributes(2);
    attributes[0].type = ScalarType::u8;
    attributes[1].type = ScalarType::u16;
    return attributes;
}

/// Sorts them as a bucket of that frame does, in pieces of `most`.
SortResult sortedBucket(const Frame& frame, const std::vector<Record>& records, bool mergeDuplicates, uint64_t most,
                        size_t wantedBytes) {
    RecordLayout layout(true, true, true, twoAttributes());
    layout.holdPlacesOf(frame);
    EXPECT_EQ(layout.bytes(), wantedBytes);
    Points points;
    points.attributes.resize(2);
    for (const Record& r : records) {
        append(points, r.place, layout.isWide());
        points.colour.push_back(r.colour);
        points.normal.push_back(r.normal);
        points.radius.push_back(r.radius);
        points.attributes[0].push_back(r.attributes[0]);
        points.attributes[1].insert(points.attributes[1].end(), r.attributes.begin() + 1, r.attributes.end());
    }
    std::vector<uint8_t> bytes(layout.bytes());
    Spill bucket{""};
    for (size_t i = 0; i < records.size(); ++i) {
        layout.write(points, i, static_cast<uint64_t>(frame.keyOf(records[i].place)), bytes.data());
        EXPECT_EQ(layout.placeAt(bytes.data()), records[i].place);
        EXPECT_TRUE(bucket.append(bytes));
    }
    Result<SortResult> result = sortBucket(frame, layout, bucket, mergeDuplicates, most);
    EXPECT_TRUE(result);
    return std::move(*result);
}

TEST(Buckets, GiveTheirPointsInOneOrderWhateverTheirPlacesAreHeldAs) {
    Rng rng(7);
    // (Exact keys of 64 bits hold places, those of 128 bits do not.)
    const std::array<std::tuple<uint32_t, uint32_t, size_t>, 6> frames{{{17, 17, 8 + 15},
                                                                        {21, 21, 8 + 15},
                                                                        {26, 26, 12 + 15},
                                                                        {31, 21, 12 + 15},
                                                                        {31, 30, 12 + 15},
                                                                        {45, 21, 20 + 15}}};
    for (const auto& [root, levels, wantedBytes] : frames)
        for (const size_t count : {size_t{1}, size_t{2}, size_t{300}, size_t{5000}})
            for (const uint64_t most : {uint64_t{1} << 20, uint64_t{1000}}) {
                const Frame frame = frameOf(root, levels);
                std::vector<Record> records = someRecords(rng, root, count);
                const SortedPoints sorted = sortedBucket(frame, records, false, most, wantedBytes).sorted;
                std::sort(records.begin(), records.end(),
                          [&](const Record& a, const Record& b) { return orderOf(frame, a) < orderOf(frame, b); });
                ASSERT_EQ(sorted.points.size(), count);
                for (size_t i = 0; i < count; ++i) {
                    const Record& r = records[i];
                    ASSERT_EQ(sorted.points.place(i), r.place) << root << " " << levels << " " << i << " of " << count;
                    ASSERT_TRUE(sorted.key[i] == keyBitByBit(frame, r.place));
                    ASSERT_EQ(sorted.points.colour[i], r.colour);
                    ASSERT_EQ(sorted.points.normal[i], r.normal);
                    ASSERT_EQ(sorted.points.radius[i], r.radius);
                    ASSERT_EQ(sorted.points.attributes[0][i], r.attributes[0]);
                    ASSERT_EQ(sorted.points.attributes[1][2 * i], r.attributes[1]);
                    ASSERT_EQ(sorted.points.attributes[1][2 * i + 1], r.attributes[2]);
                }
            }
}

TEST(Buckets, MergeWhatLiesAtOnePlaceAndKeepTheFirst) {
    Rng rng(8);
    for (const auto& [root, levels, wantedBytes] :
         {std::tuple{17u, 17u, size_t{8 + 15}}, {31u, 21u, size_t{12 + 15}}, {45u, 21u, size_t{20 + 15}}}) {
        const Frame frame = frameOf(root, levels);
        std::vector<Record> records = someRecords(rng, root, 2000);
        const SortResult result = sortedBucket(frame, records, true, uint64_t{1} << 20, wantedBytes);
        std::sort(records.begin(), records.end(),
                  [&](const Record& a, const Record& b) { return orderOf(frame, a) < orderOf(frame, b); });
        const auto end = std::unique(records.begin(), records.end(),
                                     [](const Record& a, const Record& b) { return a.place == b.place; });
        const auto kept = static_cast<size_t>(end - records.begin());
        ASSERT_LT(kept, size_t{1000});
        EXPECT_EQ(result.merged, 2000 - kept);
        ASSERT_EQ(result.sorted.points.size(), kept);
        for (size_t i = 0; i < kept; ++i) {
            ASSERT_EQ(result.sorted.points.place(i), records[i].place);
            ASSERT_EQ(result.sorted.points.colour[i], records[i].colour);
        }
    }
}

TEST(Buckets, ThinGhostsAsTheBucketsThatTheyComeFrom) {
    Rng rng(9);
    for (const auto& [root, levels] : {std::pair{17u, 17u}, {21u, 21u}, {26u, 26u}, {31u, 21u}, {45u, 21u}}) {
        const Frame frame = frameOf(root, levels);
        RecordLayout layout(true, false, false, {});
        layout.holdPlacesOf(frame);
        std::vector<Place> places;
        std::vector<uint8_t> bytes;
        for (size_t i = 0; i < 500; ++i) {
            places.push_back(i % 2 == 0 ? somePlace(rng, root) : places[i / 3]);
            if (i % 5 == 4) places.back()[2] ^= 1;
            bytes.resize(bytes.size() + layout.ghostBytes());
            layout.writePlace(places.back(), static_cast<uint64_t>(frame.keyOf(places.back())),
                              bytes.data() + bytes.size() - layout.ghostBytes());
        }
        const auto isLess = [&](const Place& a, const Place& b) {
            return orderOf(frame, {a, 0, 0, 0, {}}) < orderOf(frame, {b, 0, 0, 0, {}});
        };
        std::sort(places.begin(), places.end(), isLess);
        for (const bool isMerged : {false, true}) {
            if (isMerged) places.erase(std::unique(places.begin(), places.end()), places.end());
            const Places ghosts = sortGhosts(frame, layout, bytes, isMerged);
            ASSERT_EQ(ghosts.x.size(), places.size());
            for (size_t i = 0; i < places.size(); ++i) {
                const uint64_t high = ghosts.high.empty() ? 0 : ghosts.high[i];
                ASSERT_EQ(placeOf(ghosts.x[i], ghosts.y[i], ghosts.z[i], high), places[i]);
                ASSERT_TRUE(ghosts.key[i] == keyBitByBit(frame, places[i]));
            }
        }
    }
}

TEST(CellTree, CountsOnceWhatASampleOfFewPointsForetells) {
    // As full as a cell may be, one beside the other; a sample says that of some only roughly.
    Rng rng(10);
    constexpr size_t kCells = 64, kShare = 1000;
    const size_t count = kCells * kSubtreePoints * 21 / 20;
    const Frame frame = frameOf(20, 20);
    CellTree tree(frame, count);
    ASSERT_EQ(tree.firstLevel(), 5u);
    Points points, sample;
    for (size_t i = 0; i < count; ++i) {
        const Place place{static_cast<uint64_t>(rng.uniform() * 8 * (1u << 15)),
                          static_cast<uint64_t>(rng.uniform() * 8 * (1u << 15)), 5};
        append(points, place, false);
        if (i % kShare == 0) append(sample, place, false);
    }
    tree.expect(sample.coordinates(), kShare);
    tree.count(points.coordinates());
    EXPECT_FALSE(tree.split()) << "all points would be counted once more";
    tree.finish();
    size_t found = 0;
    for (const Cell& c : tree.cells()) {
        EXPECT_LE(c.count, kSubtreePoints);
        found += c.count;
    }
    EXPECT_EQ(found, count);
}

TEST(CellTree, ASampleOfWhichEachStandsForMuchSplitsNoDeeperThanItIsDense) {
    // 5 billion points, of which one in 76,000 is known: a grid of 256 x 256, whose places 8 levels tell apart.
    const Frame frame = frameOf(21, 21);
    constexpr uint64_t kShare = 76'000;
    CellTree tree(frame, kShare << 16);
    Points sample;
    for (uint64_t i = 0; i < 65'536; ++i) append(sample, {(i % 256) << 13, (i / 256) << 13, 7}, false);
    tree.expect(sample.coordinates(), kShare);
    EXPECT_LE(tree.deepestLevel(), 10u);
}

TEST(Distributor, SaysSoWhereAPointLiesWhereNoneWasCounted) {
    const Frame frame = frameOf(17, 17);
    Points counted, moved;
    for (uint32_t i = 0; i < 100'000; ++i) append(counted, {i % 1000, i / 1000, 0}, false);
    append(moved, {100'000, 100'000, 100'000}, false);
    for (Points* points : {&counted, &moved}) points->colour.resize(points->size());
    CellTree tree(frame, uint64_t{1} << 30);  // (a fine first level)
    tree.count(counted.coordinates());
    tree.finish();
    const BucketPlan plan = planBuckets(frame, tree, kSubtreePoints);
    Buckets buckets = makeBuckets(plan.buckets.size(), "");
    RecordLayout layout(true, false, false, {});
    layout.holdPlacesOf(frame);
    Distributor distributor(frame, tree, plan, layout, buckets, 1, uint64_t{1} << 20, false);
    EXPECT_TRUE(distributor.add(0, counted));
    const Result<void> result = distributor.add(0, moved);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().what, "changed while it was read");
}

}  // namespace
}  // namespace stipple::lod
