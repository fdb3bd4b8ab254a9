// Readers of curves, and what they make of bad input.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "lod/import/curves/curve_readers.h"
#include "lod/primitives/curves.h"
#include "shaders/shared/curve.h"
#include "shaders/shared/pack.h"
#include "tests/support/curves.h"

namespace stipple {
namespace {

Result<lod::CurveSet> readTrk(const std::vector<uint8_t>& bytes, const std::string& path) {
    lod::CurveSource source;
    source.read = [&](const lod::CurveSource::Take& take) { return lod::readTrk(Cursor(bytes), path, take); };
    return lod::collect(source);
}
Result<lod::CurveSet> readHair(const std::vector<uint8_t>& bytes, const std::string& path) {
    lod::CurveSource source;
    source.read = [&](const lod::CurveSource::Take& take) {
        const auto open = [&](uint64_t at) {
            return Cursor({bytes.begin() + static_cast<ptrdiff_t>(std::min<uint64_t>(at, bytes.size())), bytes.end()});
        };
        return lod::readHair(open, path, take);
    };
    return lod::collect(source);
}

std::vector<uint8_t> bytesOf(const std::string& s) { return {s.begin(), s.end()}; }

TEST(Swc, SectionsAreTubes) {
    const auto set = lod::readSwc(
        "# a comment\n1 1 0 0 0 2 -1\r\n2 3 0 0 2 1 1\n3 3 0 0 4 1 2\n4 3 1 0 5 0.5 3\n5 3 -1 0 5 0.5 3\n", "a.swc");
    ASSERT_TRUE(set) << set.error().line();
    EXPECT_EQ(set->curves(), 4u);  // the soma, a trunk, two branches
    size_t threes = 0;
    for (size_t s = 0; s < set->curves(); ++s) threes += set->first[s + 1] - set->first[s] == 3 ? 1 : 0;
    EXPECT_EQ(threes, 1u);
    EXPECT_TRUE(set->dropped.empty());
}

TEST(Swc, WhatIsWrongIsCountedOrRefused) {
    const auto refused = lod::readSwc("1 1 0 0 0 2\n", "a.swc");
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("line 1"), std::string::npos);
    EXPECT_FALSE(lod::readSwc("# nothing\n", "a.swc"));
    const auto circle = lod::readSwc("1 3 0 0 0 1 -1\n2 3 1 0 0 1 1\n7 3 5 0 0 1 8\n8 3 6 0 0 1 7\n", "a.swc");
    ASSERT_TRUE(circle);
    EXPECT_EQ(circle->mended.at("samples whose parents lead round in a circle"), 2u);
    const auto orphan = lod::readSwc("1 3 0 0 0 1 99\n2 3 1 0 0 1 1\n2 3 1 0 0 1 1\n", "a.swc");
    ASSERT_TRUE(orphan);
    EXPECT_EQ(orphan->mended.at("parents that do not exist (made roots)"), 1u);
    EXPECT_EQ(orphan->mended.at("samples whose id is taken"), 1u);
}

TEST(Qsm, BranchesAreTubesAndCirclesAreCut) {
    const std::string row = "0.1 1 0 0 0 0 0 1 0 ";
    const auto set =
        lod::readQsm("radius length x y z ax ay az parent extension\n" + row + "2\n0.1 1 0 0 1 0 0 1 1 0\n", "a.txt");
    ASSERT_TRUE(set) << set.error().line();
    ASSERT_EQ(set->curves(), 1u);
    EXPECT_EQ(set->position.size(), 3u);
    EXPECT_EQ(set->position.back(), glm::dvec3(0, 0, 2));
    const auto circle = lod::readQsm(row + "2\n" + row + "1\n", "a.txt");
    ASSERT_TRUE(circle);
    EXPECT_EQ(circle->mended.at("extensions that lead round in a circle (cut)"), 1u);
    EXPECT_FALSE(lod::readQsm("1 2 3\n", "a.txt"));
    EXPECT_FALSE(lod::readQsm(row + "0.5\n", "a.txt"));
    EXPECT_FALSE(lod::readQsm(row + "0\n" + row + "0 7\n", "a.txt"));  // another number of columns
}

TEST(Trk, TruncatedAndLyingFilesAreRefused) {
    std::string head(1000, '\0');
    head.replace(0, 5, "TRACK");
    const int32_t size = 1000;
    std::memcpy(&head[996], &size, 4);
    const auto number = [](auto v) { return std::string(reinterpret_cast<const char*>(&v), 4); };
    const std::string track =
        number(int32_t{2}) + number(0.0f) + number(0.0f) + number(0.0f) + number(1.0f) + number(2.0f) + number(3.0f);
    const auto whole = readTrk(bytesOf(head + track), "a.trk");
    ASSERT_TRUE(whole) << whole.error().line();
    EXPECT_EQ(whole->curves(), 1u);
    EXPECT_EQ(whole->position[1], glm::dvec3(1, 2, 3));
    EXPECT_FALSE(readTrk(bytesOf(head.substr(0, 999)), "a.trk"));
    EXPECT_FALSE(readTrk(bytesOf(head + track.substr(0, 20)), "a.trk"));
    EXPECT_FALSE(readTrk(bytesOf(head + number(int32_t{-1})), "a.trk"));
    EXPECT_FALSE(readTrk(bytesOf(head + number(int32_t{0x7fffffff})), "a.trk"));
    EXPECT_FALSE(readTrk(bytesOf("GZIP"), "a.trk"));
}

TEST(Hair, HeadersThatClaimTooMuchAreRefused) {
    struct {
        char magic[4] = {'H', 'A', 'I', 'R'};
        uint32_t curves = 2, points = 4, arrays = 2, segments = 1;
        float rest[5] = {0.2f, 0, 0, 0, 0};
        char info[88] = {};
    } head;
    static_assert(sizeof(head) == 128);
    const auto file = [&](size_t points) {
        std::string s(reinterpret_cast<const char*>(&head), sizeof(head));
        return bytesOf(s + std::string(12 * points, '\0'));
    };
    const auto set = readHair(file(4), "a.hair");
    ASSERT_TRUE(set) << set.error().line();
    EXPECT_EQ(set->curves(), 2u);
    EXPECT_FLOAT_EQ(set->radius[0], 0.1f);
    EXPECT_FALSE(readHair(file(3), "a.hair"));
    head.segments = 3;
    EXPECT_FALSE(readHair(file(4), "a.hair"));
    head.points = 0xffffffffu;
    EXPECT_FALSE(readHair(file(4), "a.hair"));
    head.arrays = 0;
    EXPECT_FALSE(readHair(file(4), "a.hair"));
}

TEST(CleanCurves, MendsAndCounts) {
    lod::CurveSet in;
    const float nan = std::nanf("");
    const auto curve = [&](std::initializer_list<glm::dvec4> vertices) {  // place and radius
        for (const glm::dvec4& v : vertices) in.addVertex(glm::dvec3(v), static_cast<float>(v.w), glm::vec3(0), 0);
        in.endCurve(false);
    };
    curve({{0, 0, 0, 1}});
    curve({{0, 0, 0, 1}, {0, 0, 0, 1}});
    curve({{0, 0, 0, 1}, {double(nan), 0, 0, 1}, {1, 0, 0, 1}});
    curve({{0, 0, 0, 0}, {0, 1, 0, 0}});
    curve({{0, 0, 0, 1}, {0, 1, 0, 0}});  // a tip
    curve({{0, 0, 0, double(nan)}, {0, 1, 0, -1}});
    const lod::CurveSet out = lod::cleanCurves(in, 0.25);
    EXPECT_EQ(out.curves(), 4u);
    EXPECT_EQ(out.mended.at("curves of one vertex (left out)"), 1u);
    EXPECT_EQ(out.mended.at("curves without length (left out)"), 1u);
    EXPECT_EQ(out.dropped.at("at vertices that are not finite"), 1u);
    EXPECT_EQ(out.mended.at("radii that are negative or not finite (replaced)"), 2u);
    EXPECT_FLOAT_EQ(out.radius[out.first[1]], 0.25f);
    EXPECT_FLOAT_EQ(out.radius[out.first[2] + 1], 0.0f);
    EXPECT_FLOAT_EQ(out.radius[out.first[3]], 0.25f);
}

TEST(CleanCurves, HalfTurnsAreTurnedThroughAndTurnsBackKeepTheirFrames) {
    const lod::CurveSet twisted = test::oneCurve({{0, 0, 0}, {0, 0, 1}}, 0.1f, {{1, 0, 0}, {-1, 1e-4f, 0}});
    EXPECT_GE(twisted.position.size(), 4u);
    for (size_t i = 0; i + 1 < twisted.position.size(); ++i) {
        EXPECT_NEAR(glm::length(twisted.normal[i]), 1, 1e-5);
        EXPECT_GE(glm::dot(twisted.normal[i], twisted.normal[i + 1]), 0.4f);
    }
    const lod::CurveSet back =
        test::oneCurve({{0, 0, 0}, {0, 0, 1}, {0, 0, 0}}, 0.1f, {{0, 0, 0}, {0, 0, 0}, {0, 0, 1}});
    ASSERT_EQ(back.curves(), 1u);
    for (const glm::vec3& n : back.normal) EXPECT_NEAR(glm::length(n), 1, 1e-5);
}

TEST(Shared, TubesSurviveThePyramidsWords) {
    Rng rng(6);
    for (int i = 0; i < 10'000; ++i) {
        shared::Texel t;
        t.depth = static_cast<float>(rng.uniform(0.1, 1e4));
        t.radius = static_cast<float>(std::exp2(rng.uniform(-1, 12)));
        t.thickness = t.radius;
        t.offset = {static_cast<float>(rng.uniform(-1, 1)) * t.radius, 0.1f * t.radius};
        t.normalPerp = {static_cast<float>(rng.uniform(-1, 1)), static_cast<float>(rng.uniform(-1, 1))};
        t.axis = {static_cast<float>(rng.uniform(-1, 1)), static_cast<float>(rng.uniform(-1, 1))};
        t.colour = {0.5f, 0.25f, 0.125f};
        t.isRound = 1;
        const shared::Texel u = shared::unpackAnyTexel(shared::packAnyTexel(t));
        EXPECT_EQ(u.isRound, 1.0f);
        EXPECT_EQ(u.depth, t.depth);
        EXPECT_NEAR(u.radius / t.radius, 1, 1.0 / 256);
        EXPECT_EQ(u.thickness, u.radius);
        EXPECT_NEAR(u.normalPerp.x, t.normalPerp.x, 1.0 / 2047);
        EXPECT_NEAR(u.normalPerp.y, t.normalPerp.y, 1.0 / 1023);
        EXPECT_NEAR(u.axis.x, t.axis.x, 1.0 / 2047);
        EXPECT_NEAR(u.axis.y, t.axis.y, 1.0 / 2047);
        // What is no tube comes through as before.
        t.isRound = 0;
        t.normalPerp = {0.3f, -0.4f};
        const shared::Texel plain = shared::unpackTexel(shared::packTexel(t)),
                            any = shared::unpackAnyTexel(shared::packAnyTexel(t));
        EXPECT_EQ(any.isRound, 0.0f);
        EXPECT_EQ(any.normalPerp.x, plain.normalPerp.x);
        EXPECT_EQ(any.thickness, plain.thickness);
    }
}

TEST(CurveData, EveryRealFileLoadsOrIsRefusedWithAReason) {
    const std::string folder = test::dataFile("05_tubes");
    if (folder.empty()) GTEST_SKIP() << "05_tubes is missing: real neurons, streamlines and hair were not read";
    size_t loaded = 0, refused = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
        if (!entry.is_regular_file() || !lod::isCurveFile(entry.path().string())) continue;
        const auto set = [&] {
            const auto source = lod::openCurves(entry.path().string());
            return source ? lod::collect(*source) : tl::unexpected(source.error());
        }();
        if (!set) {
            ++refused;
            EXPECT_GT(set.error().line().size(), 20u) << entry.path();
            printf("%s\n", set.error().line().c_str());
            continue;
        }
        ++loaded;
        const lod::CurveSet clean = lod::cleanCurves(*set, 0);
        for (const glm::dvec3& p : clean.position) ASSERT_TRUE(std::isfinite(p.x + p.y + p.z)) << entry.path();
        for (const float r : clean.radius) ASSERT_TRUE(r >= 0 && std::isfinite(r)) << entry.path();
    }
    EXPECT_GE(loaded, 55u);
    EXPECT_LE(refused, 5u);
}

}  // namespace
}  // namespace stipple
