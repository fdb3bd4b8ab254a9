// What a build makes of inputs that are odd: named twice, far apart, black, with points that are none.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

#include "engine/base/rng.h"
#include "lod/builder/build.h"
#include "lod/builder/points/outliers.h"
#include "lod/builder/points/separation.h"
#include "lod/import/import.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// A hilly square of 100 m, in centimetres.
std::vector<glm::ivec3> hills(size_t count, uint64_t seed) {
    Rng rng(seed);
    std::vector<glm::ivec3> points;
    for (size_t i = 0; i < count; ++i) {
        const auto x = static_cast<int>(rng.below(10000)), y = static_cast<int>(rng.below(10000));
        points.emplace_back(x, y, static_cast<int>(500 * std::sin(x * 0.002)) + static_cast<int>(rng.below(20)));
    }
    return points;
}

const glm::dvec3 kUtm(500000, 5400000, 300);

/// LAS files have a colour in tests; here it is 0.
void blacken(const std::string& path) {
    std::string bytes = test::slurp(path);
    for (size_t at = 227; at < bytes.size(); at += 26) std::memset(bytes.data() + at + 20, 0, 6);
    test::spit(path, bytes);
}

bool says(const lod::BuildReport& report, const std::string& text) {
    return std::any_of(report.notes.begin(), report.notes.end(),
                       [&](const std::string& note) { return note.find(text) != std::string::npos; });
}

lod::BuildSettings dropping() {
    lod::BuildSettings settings;
    settings.dropOutliers = true;
    return settings;
}

TEST(Inputs, AFileThatIsNamedTwiceIsTakenOnce) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    std::filesystem::create_directory(folder / "tiles");
    test::writeLas(folder / "tiles/a.las", hills(3000, 1), 0.01, kUtm);
    test::writeLas(folder / "tiles/b.las", hills(3000, 2), 0.01, kUtm);
    std::filesystem::create_symlink("tiles/a.las", folder / "link.las");
    const auto once = test::build({folder / "tiles"}, folder / "once.stipple", *executor);
    EXPECT_EQ(once.pointsIn, 6000u);
    EXPECT_TRUE(once.notes.empty());
    for (const std::vector<std::string>& inputs :
         {std::vector{folder / "tiles", folder / "tiles"}, std::vector{folder / "tiles", folder / "tiles/b.las"},
          std::vector{folder / "tiles/*.las", folder / "link.las"},
          std::vector{folder / "link.las", folder / "tiles/../tiles"}}) {
        const auto again = test::build(inputs, folder / "again.stipple", *executor);
        EXPECT_EQ(again.pointsIn, 6000u);
        EXPECT_TRUE(says(again, "taken once"));
    }
    std::filesystem::copy_file(folder / "tiles/a.las", folder / "copy.las");
    EXPECT_EQ(test::build({folder / "tiles", folder / "copy.las"}, folder / "c.stipple", *executor).pointsIn, 9000u)
        << "a copy is another file";
}

TEST(Inputs, WhatMayNotBelongTogetherIsSaid) {
    lod::SourceInfo named, unnamed, other;
    named.path = "town.las";
    named.crs.epsg = 32633;
    unnamed.path = "hall.las";
    other.path = "shed.las";
    const auto at = [](const glm::dvec3& p) { return lod::Bounds{p, p + glm::dvec3(100)}; };
    const auto notes = [&](const lod::SourceInfo& a, const glm::dvec3& pa, const lod::SourceInfo& b,
                           const glm::dvec3& pb) {
        return lod::separationNotes({{&a, at(pa)}, {&b, at(pb)}}, named.crs, "town.las");
    };
    const auto far = notes(named, kUtm, unnamed, glm::dvec3(0));
    ASSERT_EQ(far.size(), 1u);
    for (const char* word : {"hall.las", "EPSG:32633", "town.las", "5423 km"})
        EXPECT_NE(far[0].find(word), std::string::npos) << far[0];
    const auto near = notes(named, kUtm, unnamed, kUtm);
    ASSERT_EQ(near.size(), 1u);
    EXPECT_NE(near[0].find("among the others"), std::string::npos) << near[0];
    const auto both = lod::separationNotes({{&unnamed, at(kUtm)}, {&other, at(glm::dvec3(0))}}, {}, "");
    ASSERT_EQ(both.size(), 1u);
    EXPECT_NE(both[0].find("5400 km"), std::string::npos) << both[0];
    EXPECT_TRUE(lod::separationNotes({{&unnamed, at(kUtm)}, {&other, at(kUtm + glm::dvec3(9e5))}}, {}, "").empty());
    EXPECT_TRUE(notes(named, kUtm, named, glm::dvec3(0)).size() == 1) << "whatever they say of themselves";
}

TEST(Inputs, ColoursThatAreAllZeroAreNone) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writeLas(folder / "black.las", hills(3000, 1), 0.01, kUtm);
    test::writeLas(folder / "coloured.las", hills(3000, 2), 0.01, kUtm);
    test::writeLas(folder / "black2.las", hills(3000, 3), 0.01, kUtm);
    blacken(folder / "black.las");
    blacken(folder / "black2.las");
    const auto colourOf = [&](const std::vector<std::string>& inputs, bool isNoted) {
        const auto report = test::build(inputs, folder / "o.stipple", *executor);
        EXPECT_EQ(says(report, "colours of all points are 0"), isNoted);
        const auto store = lod::openStore(folder / "o.stipple");
        EXPECT_TRUE(store.has_value());
        const auto chunk = lod::readChunk(*store, 0);
        EXPECT_TRUE(chunk.has_value());
        return std::pair{store->description.hasColour, chunk->records.front().colour & 0xffffffu};
    };
    EXPECT_EQ(colourOf({folder / "black.las"}, true), std::pair(false, lod::kPlainColour));
    EXPECT_EQ(colourOf({folder / "black.las", folder / "black2.las"}, true), std::pair(false, lod::kPlainColour));
    EXPECT_TRUE(colourOf({folder / "black.las", folder / "coloured.las"}, false).first) << "of the whole input";
    EXPECT_TRUE(colourOf({folder / "coloured.las", folder / "black.las"}, false).first);
}

/// Hills at UTM coordinates, `zeros` returns at (0, 0, 0), a few flying points, and a tower far away.
std::vector<glm::ivec3> withOutliers(size_t zeros) {
    std::vector<glm::ivec3> points = hills(60000, 4);
    const glm::ivec3 origin(glm::round(-kUtm / 0.01));
    for (size_t i = 0; i < zeros; ++i) points.insert(points.begin() + static_cast<ptrdiff_t>(7 * i), origin);
    for (int i = 0; i < 5; ++i) points.emplace_back(1000 * i, 5000, 90000 + 40000 * i);
    Rng rng(5);
    for (int i = 0; i < 200; ++i)  // a kilometre off, but plainly there
        points.emplace_back(100000 + static_cast<int>(rng.below(300)), static_cast<int>(rng.below(300)),
                            static_cast<int>(rng.below(3000)));
    return points;
}

TEST(Inputs, OutliersAreCountedAndLeftOutIfAsked) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writeLas(folder / "a.las", withOutliers(3000), 0.01, kUtm);
    const auto kept = test::build({folder / "a.las"}, folder / "kept.stipple", *executor);
    EXPECT_EQ(kept.pointsOut, 63205u);
    EXPECT_TRUE(kept.dropped.empty());
    ASSERT_FALSE(kept.notes.empty());
    EXPECT_NE(kept.notes[0].find("OUTLIERS: 3005 of 63205"), std::string::npos) << kept.notes[0];
    EXPECT_NE(kept.notes[0].find("--drop-outliers"), std::string::npos);

    const auto whole = lod::openStore(folder / "kept.stipple");
    ASSERT_TRUE(whole.has_value());
    EXPECT_LT(whole->description.boundsMin.x, 1);
    EXPECT_GT(whole->description.focusMin.x, kUtm.x - 200) << "cameras look at what is dense";
    EXPECT_LT(whole->description.focusMax.x, kUtm.x + 300);

    const auto left = test::build({folder / "a.las"}, folder / "left.stipple", *executor, dropping());
    EXPECT_EQ(left.pointsIn, 63205u);
    EXPECT_EQ(left.pointsOut, 60200u) << "the tower stays";
    EXPECT_EQ(left.dropped, (std::map<std::string, uint64_t>{{"outlier_at_origin", 3000}, {"outlier_isolated", 5}}));
    const auto store = lod::openStore(folder / "left.stipple");
    ASSERT_TRUE(store.has_value());
    EXPECT_GT(store->description.boundsMin.x, kUtm.x - 1);
    EXPECT_GT(store->description.boundsMax.x, kUtm.x + 1000) << "the tower";
    EXPECT_LT(store->description.boundsMax.z, kUtm.z + 100);
    EXPECT_EQ(store->description.dropped, left.dropped);

    // The same as if they had never been there.
    auto clean = withOutliers(0);
    clean.erase(clean.begin() + 60000, clean.begin() + 60005);
    std::filesystem::create_directory(folder / "clean");
    test::writeLas(folder / "clean/a.las", clean, 0.01, kUtm);
    test::build({folder / "clean/a.las"}, folder / "clean.stipple", *executor);
    const auto other = lod::openStore(folder / "clean.stipple");
    ASSERT_TRUE(other.has_value());
    EXPECT_EQ(test::leafLattice(*store), test::leafLattice(*other));
    const auto none = test::build({folder / "clean/a.las"}, folder / "none.stipple", *executor, dropping());
    EXPECT_TRUE(none.dropped.empty());
    EXPECT_TRUE(none.notes.empty());
}

TEST(Inputs, NeitherOrderNorThreadsNorMemoryNorFilesChangeWhichPointsAreOutliers) {
    const test::TempFolder folder;
    const auto one = makeTbbExecutor(1), four = makeTbbExecutor(4);
    auto points = withOutliers(500);
    test::writeLas(folder / "a.las", points, 0.01, kUtm);
    const auto first = test::build({folder / "a.las"}, folder / "a.stipple", *one, dropping());
    Rng rng(9);
    for (size_t i = points.size() - 1; i > 0; --i) std::swap(points[i], points[rng.below(i + 1)]);
    std::filesystem::create_directory(folder / "b");
    test::writeLas(folder / "b/a.las", points, 0.01, kUtm);
    auto settings = dropping();
    settings.memoryBytes = uint64_t{120} << 20;
    const auto second = test::build({folder / "b/a.las"}, folder / "b.stipple", *four, settings);
    EXPECT_EQ(first.contentHash, second.contentHash);
    EXPECT_EQ(first.dropped, second.dropped);
    // In three files, two of them with another scale or offset.
    const auto third = static_cast<ptrdiff_t>(points.size() / 3);
    std::vector<glm::ivec3> parts[] = {{points.begin(), points.begin() + third},
                                       {points.begin() + third, points.begin() + 2 * third},
                                       {points.begin() + 2 * third, points.end()}};
    for (glm::ivec3& p : parts[1]) p += glm::ivec3(1000, 0, -500);
    std::filesystem::create_directory(folder / "c");
    test::writeLas(folder / "c/a.las", parts[0], 0.01, kUtm);
    test::writeLas(folder / "c/b.las", parts[1], 0.01, kUtm - glm::dvec3(10, 0, -5));
    test::writeLas(folder / "c/c.las", parts[2], 0.01, kUtm);
    const auto three = test::build({folder / "c"}, folder / "c.stipple", *four, dropping());
    EXPECT_EQ(three.dropped, first.dropped);
    EXPECT_EQ(three.pointsOut, first.pointsOut);
}

TEST(Inputs, TheNameOfAFileIsNoPartOfTheContentHash) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    auto points = test::bumpySphere(3000, 1);
    test::writePly(folder / "a.ply", points);
    std::filesystem::copy_file(folder / "a.ply", folder / "a much longer name.ply");
    points[0].colour ^= 1;
    test::writePly(folder / "other.ply", points);
    const auto hashOf = [&](const char* name) {
        return test::build({folder / name}, folder / "out.stipple", *executor).contentHash;
    };
    const uint64_t first = hashOf("a.ply");
    EXPECT_EQ(hashOf("a much longer name.ply"), first);
    EXPECT_EQ(lod::openStore(folder / "out.stipple")->description.source, "a much longer name.ply");
    EXPECT_NE(hashOf("other.ply"), first) << "one bit of one colour is";
}

TEST(Inputs, PointsThatWouldRuinTheOthersAreLeftOutAndCounted) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto points = test::bumpySphere(3000, 1);
    // Beyond 1e150 distances are no numbers; from there down to 1e14 nothing of the others would be left beside it.
    for (const auto& [far, reason] : {std::pair{1e308, "beyond_1e150"},
                                      {1e151, "beyond_1e150"},
                                      {1e145, "outlier_isolated"},
                                      {1e30, "outlier_isolated"}}) {
        auto all = points;
        all.push_back({glm::dvec3(far, -far, 0)});
        test::writePly(folder / "a.ply", all);
        const auto built = test::build({folder / "a.ply"}, folder / "a.stipple", *executor);
        EXPECT_EQ(built.pointsOut, points.size()) << far;
        EXPECT_EQ(built.dropped, (std::map<std::string, uint64_t>{{reason, 1}})) << far;
        EXPECT_EQ(says(built, "could not be told apart"), far < 1e150) << far;
        const auto store = lod::openStore(folder / "a.stipple");
        ASSERT_TRUE(store.has_value());
        EXPECT_LT(store->hierarchy.unit, 1e-5) << far;
    }
    // All of them: nothing is left.
    auto none = points;
    for (auto& p : none) p.position = glm::dvec3(1e200);
    test::writePly(folder / "a.ply", none);
    Progress silent(false);
    const auto built = lod::buildStore({folder / "a.ply"}, folder / "a.stipple", {}, *executor, silent);
    ASSERT_FALSE(built);
    EXPECT_EQ(built.error().kind, ErrorKind::input);
    EXPECT_NE(built.error().line().find("a.ply"), std::string::npos) << built.error().line();
}

TEST(Inputs, AnInterruptedBuildKnowsItsOutliers) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(1);
    std::vector<glm::ivec3> points = withOutliers(500);
    for (uint64_t seed = 10; seed < 20; ++seed)
        for (const glm::ivec3& p : hills(60000, seed)) points.push_back(p);
    test::writeLas(folder / "a.las", points, 0.01, kUtm);
    for (const bool isDropping : {true, false}) {
        lod::BuildSettings settings;
        settings.dropOutliers = isDropping;
        settings.normals = lod::NormalsMode::none;
        settings.estimateRadii = false;
        const auto whole = test::build({folder / "a.las"}, folder / "whole.stipple", *executor, settings);
        settings.memoryBytes = uint64_t{120} << 20;
        const std::string journal = folder / "o.stipple.build/journal";
        settings.isStopped = [&] {  // as soon as it is known what lies where
            std::error_code error;
            const auto bytes = std::filesystem::file_size(journal, error);
            return !error && bytes > 1000;
        };
        Progress silent(false);
        const auto stopped = lod::buildStore({folder / "a.las"}, folder / "o.stipple", settings, *executor, silent);
        ASSERT_FALSE(stopped.has_value());
        EXPECT_EQ(stopped.error().kind, ErrorKind::interrupted);
        settings.isStopped = {};
        const auto resumed = test::build({folder / "a.las"}, folder / "o.stipple", *executor, settings);
        EXPECT_TRUE(resumed.isResumed);
        EXPECT_EQ(resumed.contentHash, whole.contentHash);
        EXPECT_EQ(resumed.dropped, whole.dropped);
        EXPECT_EQ(resumed.notes, whole.notes);
        EXPECT_TRUE(says(resumed, "OUTLIERS: 505 of"));
    }
}

TEST(Inputs, OutliersOfFloatingPointFilesAreFoundToo) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    std::vector<test::TestPoint> points = test::bumpySphere(30000, 3, glm::dvec3(20, 30, 40));
    for (int i = 0; i < 40; ++i) points.push_back({glm::dvec3(0)});
    for (int i = 0; i < 9; ++i) points.push_back({glm::dvec3(1e30, -1e30, i % 3)});
    test::writePly(folder / "a.ply", points);
    const auto left = test::build({folder / "a.ply"}, folder / "a.stipple", *executor, dropping());
    EXPECT_EQ(left.dropped, (std::map<std::string, uint64_t>{{"outlier_at_origin", 40}, {"outlier_isolated", 9}}));
    EXPECT_EQ(left.pointsOut, 30000u);
    const auto store = lod::openStore(folder / "a.stipple");
    ASSERT_TRUE(store.has_value());
    EXPECT_LT(store->hierarchy.unit, 1e-5) << "the lattice is that of what is kept";
    // A scanner in the middle of its scan is no outlier.
    std::vector<test::TestPoint> around = test::bumpySphere(30000, 3);
    around.push_back({glm::dvec3(0)});
    test::writePly(folder / "b.ply", around);
    const auto all = test::build({folder / "b.ply"}, folder / "b.stipple", *executor, dropping());
    EXPECT_EQ(all.pointsOut, 30001u);
    EXPECT_TRUE(all.notes.empty());
}

TEST(Inputs, CubesOfFarPointsGrowAlikeHoweverTheyComeTogether) {
    Rng rng(2);
    std::vector<glm::dvec3> points;
    for (int i = 0; i < 15000; ++i) {
        glm::dvec3 p(0);
        for (int a = 0; a < 3; ++a) p[a] = std::exp(20 * rng.uniform()) - 50;
        points.push_back(p);
    }
    const auto isolated = [&](size_t step) {
        std::vector<lod::FarCubes> some(3, lod::FarCubes(glm::dvec3(0), 1.0));
        for (size_t i = 0; i < points.size(); ++i) some[i * step / 7 % 3].add(points[i * step % points.size()]);
        lod::FarCubes all(glm::dvec3(0), 1.0);
        for (const lod::FarCubes& s : some) all.add(s);
        all.findIsolated();
        return all.isolated();
    };
    const uint64_t count = isolated(1);
    EXPECT_GT(count, 0u);
    EXPECT_LT(count, points.size());
    for (const size_t step : {7u, 101u}) EXPECT_EQ(isolated(step), count);
}

}  // namespace
}  // namespace stipple
