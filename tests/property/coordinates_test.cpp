// Where things are drawn, against where the input has them: whatever lies how far away. Nothing here knows a lattice:
// places are those that the test made up.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include "engine/base/progress.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/decode.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "lod/store/chunk.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple::lod {
namespace {

using test::TestPoint;

/// Objects of radius 1 at these places; a point's colour is its number in its object.
std::vector<TestPoint> objectsAt(const std::vector<glm::dvec3>& centres, size_t points) {
    std::vector<TestPoint> all;
    for (const glm::dvec3& centre : centres) {
        std::vector<TestPoint> object = test::bumpySphere(points, 5, centre);
        for (uint32_t i = 0; i < object.size(); ++i) object[i].colour = i + 1;
        all.insert(all.end(), object.begin(), object.end());
    }
    return all;
}

struct Drawn {
    double off = 0, storedOff = 0;  ///< largest distance of a drawn, and of a stored, place from the true one
    double step = 0;                ///< largest of a leaf, world units
    size_t found = 0;
};
/// Of the leaf records whose colour and surroundings say which point they are.
Drawn drawnPlaces(const Store& store, const std::vector<TestPoint>& truth, double reach) {
    std::multimap<uint32_t, glm::dvec3> byColour;
    for (const TestPoint& p : truth) byColour.emplace(p.colour, p.position);
    const Hierarchy& h = store.hierarchy;
    Drawn out;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        const Chunk chunk = *readChunk(store, n, true);
        for (size_t i = 0; i < chunk.records.size(); ++i) {
            const shared::PointRecord& r = chunk.records[i];
            const glm::dvec3 drawn = reference::decodeDisc(h, h.nodes[n], r).position;
            glm::dvec3 stored = drawn;
            for (int a = 0; a < 3 && !chunk.lowBits.empty(); ++a)
                stored[a] += h.unit * (chunk.lowBits[3 * i + static_cast<size_t>(a)] -
                                       0.5 * (std::exp2(h.nodes[n].stepShift) - 1));
            const auto [first, last] = byColour.equal_range(r.colour & 0xffffffu);
            double nearest = reach, storedNearest = reach;
            for (auto at = first; at != last; ++at) {
                nearest = std::min(nearest, glm::length(at->second - drawn));
                storedNearest = std::min(storedNearest, glm::length(at->second - stored));
            }
            if (nearest >= reach) continue;
            ++out.found;
            out.off = std::max(out.off, nearest);
            out.storedOff = std::max(out.storedOff, storedNearest);
            out.step = std::max(out.step, h.unit * std::exp2(h.nodes[n].stepShift));
        }
    }
    return out;
}

std::shared_ptr<const Store> opened(const std::string& path) {
    auto store = openStore(path);
    if (!store) throw std::runtime_error(store.error().line());
    return std::make_shared<const Store>(std::move(*store));
}

/// A tenth of a pixel, where an object of radius 1 fills a picture 1,000 pixels high.
constexpr double kTenthOfAPixel = 0.1 * 2 / 1000;

std::vector<glm::dvec3> fortyPlaces(double extent) {
    Rng rng(7);
    std::vector<glm::dvec3> places{glm::dvec3(0), glm::dvec3(extent, extent, 0.1 * extent)};
    while (places.size() < 40)
        places.emplace_back(extent * rng.uniform(), extent * rng.uniform(), 0.1 * extent * rng.uniform());
    return places;
}

TEST(Coordinates, ObjectsFarApartAreDrawnWhereTheyAre) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const double extent : {2e4, 1e5, 1e7}) {
        const std::vector<TestPoint> truth = objectsAt(fortyPlaces(extent), 1500);
        test::writePly(folder / "a.ply", truth, false);
        test::build({folder / "a.ply"}, folder / "a.stipple", *executor);
        const auto store = opened(folder / "a.stipple");
        const Drawn drawn = drawnPlaces(*store, truth, 0.05);
        EXPECT_EQ(drawn.found, truth.size()) << extent;
        EXPECT_LE(drawn.off, kTenthOfAPixel) << extent;
        EXPECT_LE(drawn.storedOff, 2 * store->description.roundingUnits) << "what info says of them";
        EXPECT_GT(extent / 65536, kTenthOfAPixel) << "steps of the whole extent would be too coarse";
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << extent;
    }
}

TEST(Coordinates, ScannerIntegersFarApartAreDrawnWhereTheyAre) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    constexpr double kScale = 0.0001;
    std::vector<glm::ivec3> steps;
    std::vector<TestPoint> truth;
    for (const TestPoint& p : objectsAt(fortyPlaces(1e5), 1500)) {
        steps.emplace_back(glm::round(p.position / kScale));
        truth.push_back({glm::dvec3(steps.back()) * kScale, p.normal, 0, 0});
    }
    test::writeLas(folder / "a.las", steps, kScale, glm::dvec3(0));
    BuildSettings settings;
    settings.normals = NormalsMode::none;
    test::build({folder / "a.las"}, folder / "a.stipple", *executor, settings);
    const auto store = opened(folder / "a.stipple");
    std::vector<std::array<int64_t, 3>> back = test::leafLattice(*store), want;
    glm::ivec3 least = steps[0];
    for (const glm::ivec3& s : steps) least = glm::min(least, s);
    for (const glm::ivec3& s : steps) want.push_back({s.x - least.x, s.y - least.y, s.z - least.z});
    std::sort(want.begin(), want.end());
    EXPECT_TRUE(back == want) << "integers come back";
    const Hierarchy& h = store->hierarchy;
    double coarsest = 0;
    for (const Node& n : h.nodes)
        if (n.isLeaf() && n.records > 1) coarsest = std::max(coarsest, h.unit * std::exp2(n.stepShift));
    EXPECT_LE(std::sqrt(3.0) / 2 * coarsest, kTenthOfAPixel);
    EXPECT_TRUE(verifyStore(*store, *executor, 0));
}

TEST(Coordinates, OnePointFarAwayChangesNothing) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const glm::dvec3 centre(431'234.5, 5'321'987.25, 512.125);
    std::vector<TestPoint> truth = objectsAt({centre}, 40'000);
    test::writePly(folder / "alone.ply", truth, false);
    test::build({folder / "alone.ply"}, folder / "alone.stipple", *executor);
    const auto alone = opened(folder / "alone.stipple");
    const auto backend = cpu::makeCpuBackend(*executor);
    const render::Image without = test::renderView(alone, *backend, *executor, test::viewFromAbove(centre), {});
    const double rounding = drawnPlaces(*alone, truth, 0.05).storedOff;
    // Any other point, too, lets the octree's cells lie elsewhere, and what is estimated in its windows changes a
    // little.
    const auto withOne = [&](const glm::dvec3& place) {
        std::vector<TestPoint> more = truth;
        more.push_back({place, glm::vec3(0, 0, 1), 0xffffff, 0});
        test::writePly(folder / "far.ply", more, false);
        test::build({folder / "far.ply"}, folder / "far.stipple", *executor);
        return opened(folder / "far.stipple");
    };
    double usual = 99;
    for (const glm::dvec3& near : {glm::dvec3(1.9, -1.3, -1.7), glm::dvec3(-1.4, -1.8, 1.1), glm::dvec3(-2, 1.3, -1.9)})
        usual = std::min(usual, test::drawnPsnr(test::renderView(withOne(centre + near), *backend, *executor,
                                                                 test::viewFromAbove(centre), {}),
                                                without));
    for (const glm::dvec3& far : {glm::dvec3(0), centre + glm::dvec3(1e4, 0, 0), glm::dvec3(0, 1e9, 0),
                                  glm::dvec3(-1e11, 1e11, 3), glm::dvec3(1e12, 0, 0)}) {
        const auto store = withOne(far);
        const Drawn drawn = drawnPlaces(*store, truth, 0.05);
        EXPECT_EQ(drawn.found, truth.size()) << far.x << " " << far.y;
        // Coordinates have 53 bits, and so has their sum with the origin.
        const double ofDoubles = 2 * std::max(glm::length(far - centre), glm::length(centre)) * std::exp2(-53);
        EXPECT_LE(drawn.storedOff, std::max(rounding * (1 + 1e-6), ofDoubles) + 1e-9) << far.x << " " << far.y;
        EXPECT_LE(drawn.off, kTenthOfAPixel) << far.x << " " << far.y;
        EXPECT_EQ(store->description.points, truth.size() + 1);
        const render::Image with = test::renderView(store, *backend, *executor, test::viewFromAbove(centre), {});
        // At 1e12 keys of 42 bits an axis have cells of a quarter of a unit, 14 spacings: within them points are not in
        // the order of the curve, in which neighbours are looked for. (It is not the steps of 2^-13: the same points
        // rounded to these in the input, with a stray nearby, give 26.7 dB, usually 26.9, and with one at 1e12 21.9.)
        EXPECT_GT(test::drawnPsnr(with, without), usual - (std::abs(far.x) < 1e12 ? 2 : 6))
            << far.x << " " << far.y << ", usually " << usual;
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far.x << " " << far.y;
    }
}

/// Errors of coarse records are measured against points whose coordinates take more than 32 bits.
TEST(Coordinates, LevelsOfWhatTakesMoreThan32BitsHaveTheErrorsOfTheirSize) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const glm::dvec3 centre(431'234.5, 5'321'987.25, 512.125);
    std::vector<TestPoint> points = objectsAt({centre}, 40'000);
    points.push_back({centre - glm::dvec3(1e9, 1e10, 1e8), glm::vec3(0, 0, 1), 0xffffff, 0});
    test::writePly(folder / "a.ply", points, false);
    test::build({folder / "a.ply"}, folder / "a.stipple", *executor);
    const auto store = opened(folder / "a.stipple");
    const Hierarchy& h = store->hierarchy;
    size_t wide = 0, measured = 0;
    for (const Node& n : h.nodes) {
        const glm::dvec3 place = h.origin + h.unit * n.centre;
        if (n.isLeaf() || glm::length(place - centre) + h.unit * n.radius > 2) continue;
        ++measured;
        wide += std::max({n.centre.x, n.centre.y, n.centre.z}) > 0x1p32 ? 1 : 0;
        // Whatever it holds is drawn as a disc that reaches across it: no farther off than from side to side.
        EXPECT_LE(h.errors.decode(n.errorCode), 2 * 1.1 * n.radius) << "level " << int{n.level};
    }
    EXPECT_GT(measured, 3u);
    EXPECT_EQ(wide, measured);
}

/// The largest radius of a leaf disc within `reach` of a place.
double largestRadius(const Store& store, const glm::dvec3& place, double reach) {
    double largest = 0;
    for (uint32_t n = 0; n < store.hierarchy.nodes.size(); ++n) {
        if (!store.hierarchy.nodes[n].isLeaf()) continue;
        const Chunk chunk = *readChunk(store, n);
        for (const shared::PointRecord& r : chunk.records) {
            const reference::Disc disc = reference::decodeDisc(store.hierarchy, store.hierarchy.nodes[n], r);
            if (glm::length(disc.position - place) < reach) largest = std::max(largest, disc.radius);
        }
    }
    return largest;
}

// With a point far away cells are large and lie elsewhere: a few rows of the ground are then alone in theirs, and all
// that they belong to is beyond its border.
TEST(Coordinates, OnePointFarAwayLeavesTheRadiiOfTheOthers) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const glm::dvec3 centre(500'010, 5'400'010, 300);
    Rng rng(3);
    std::vector<TestPoint> ground;
    for (int k = 0; k < 40'000; ++k) {
        const double x = k % 200 * 0.1 + 0.03 * rng.uniform(-1, 1) - 10, y = k / 200 * 0.1 - 10.02;
        ground.push_back({centre + glm::dvec3(x, y, 0.5 * std::sin(x) * std::cos(y)), {}, 0x808080, 0});
    }
    test::writePly(folder / "alone.ply", ground, false);
    test::build({folder / "alone.ply"}, folder / "alone.stipple", *executor);
    const double usual = largestRadius(*opened(folder / "alone.stipple"), centre, 100);
    EXPECT_LT(usual, 0.4);
    for (const glm::dvec3& far : {glm::dvec3(0), centre + glm::dvec3(1e4, 0, 0), glm::dvec3(0, 1e9, 0)}) {
        ground.push_back({far, {}, 0x808080, 0});
        test::writePly(folder / "far.ply", ground, false);
        ground.pop_back();
        test::build({folder / "far.ply"}, folder / "far.stipple", *executor);
        EXPECT_LE(largestRadius(*opened(folder / "far.stipple"), centre, 100), 2 * usual) << far.x << " " << far.y;
    }
}

TEST(Coordinates, WideBuildsGiveTheSameBytesForAnyThreadsAndOrder) {
    const test::TempFolder folder;
    std::vector<TestPoint> truth = objectsAt(fortyPlaces(1e7), 3000);
    truth.push_back({glm::dvec3(1e11, 0, 0), glm::vec3(0), 1, 0});
    test::writePly(folder / "a.ply", truth, false);
    std::reverse(truth.begin(), truth.end());
    test::writePly(folder / "b.ply", truth, false);
    std::string first;
    for (const auto& [name, threads] : {std::pair{"a.ply", 1}, {"a.ply", 7}, {"b.ply", 3}}) {
        const auto executor = makeTbbExecutor(threads);
        std::filesystem::copy_file(folder / name, folder / "in.ply", std::filesystem::copy_options::overwrite_existing);
        test::build({folder / "in.ply"}, folder / "out", *executor);
        if (first.empty()) first = test::slurp(folder / "out");
        EXPECT_TRUE(first == test::slurp(folder / "out")) << name << " " << threads;
    }
}

/// As builds of before left them: all points in one leaf, drawn to steps of its whole cell.
TEST(Coordinates, VerifyFindsPointsThatAreNotDrawnWhereTheyAreStored) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    for (const int stepShift : {0, 8}) {
        const uint32_t rootLog2 = 16 + static_cast<uint32_t>(stepShift);
        Chunk chunk;
        Rng rng(3);
        for (int i = 0; i < 200; ++i) {
            std::array<uint32_t, 3> q{};
            for (uint32_t& v : q) v = 30'000 + static_cast<uint32_t>(200 * rng.uniform());
            if (i == 0) q = {(1u << rootLog2) - 1, 0, 0};
            std::array<uint32_t, 3> s{};
            for (size_t a = 0; a < 3; ++a) {
                s.at(a) = q.at(a) >> stepShift;
                if (stepShift > 0) chunk.lowBits.push_back(q.at(a) & ((1u << stepShift) - 1));
            }
            chunk.records.push_back({s[0] | s[1] << 16, s[2] | 100u << 16, 0, shared::kFlagNoNormal << 24});
        }
        Hierarchy h;
        h.rootLog2 = rootLog2;
        h.nodes.emplace_back();
        Node& node = h.nodes[0];
        node.centre = glm::dvec3(std::exp2(rootLog2 - 1));
        node.radius = 2 * std::exp2(rootLog2);
        node.records = static_cast<uint32_t>(chunk.records.size());
        node.stepShift = static_cast<int8_t>(stepShift);
        h.greaterThan = {0};
        node.parentCounts = {0, 255, 255};
        node.ownCounts = {0, 0, 0};
        auto writer = StoreWriter::create(folder / "a");
        ASSERT_TRUE(writer);
        ASSERT_TRUE(writer->appendChunk(encodeChunk(chunk), {}, node));
        StoreDescription description;
        description.points = node.records;
        ASSERT_TRUE(writer->finish(h, description));
        ASSERT_TRUE(writer->commit());
        const auto verified = verifyStore(*opened(folder / "a"), *executor, 0);
        ASSERT_EQ(verified.has_value(), stepShift == 0) << (verified ? "" : verified.error().line());
        if (!verified) EXPECT_NE(verified.error().what.find("off where they are stored"), std::string::npos);
    }
}

/// A sphere of triangles around `centre`.
TriangleMesh sphereOfTriangles(uint32_t rings, const glm::dvec3& centre, double radius) {
    TriangleMesh mesh;
    const uint32_t around = 2 * rings;
    for (uint32_t i = 0; i <= rings; ++i)
        for (uint32_t k = 0; k < around; ++k) {
            const double a = M_PI * (0.02 + 0.96 * i / rings), b = 2 * M_PI * k / around;
            mesh.position.push_back(
                centre + radius * glm::dvec3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
        }
    for (uint32_t i = 0; i < rings; ++i)
        for (uint32_t k = 0; k < around; ++k) {
            const uint32_t p = i * around + k, q = i * around + (k + 1) % around;
            for (const uint32_t v : {p, q, p + around, q, q + around, p + around}) mesh.indices.push_back(v);
        }
    return mesh;
}

/// Largest distance of a true corner from the nearest corner in the store; corners beyond `reach` of the centre not.
double farthestCorner(const TriangleMesh& truth, const Store& store, const glm::dvec3& centre, double reach) {
    std::vector<glm::dvec3> corners;
    for (const test::Triangle& t : test::leafTriangles(store))
        for (const glm::dvec3& p : t)
            if (glm::length(p - centre) < reach) corners.push_back(p);
    std::sort(corners.begin(), corners.end(), [](const auto& a, const auto& b) { return a.x < b.x; });
    double worst = 0;
    for (const glm::dvec3& p : truth.position) {
        if (glm::length(p - centre) >= reach) continue;
        double nearest = 1e300;
        auto at = std::lower_bound(corners.begin(), corners.end(), p.x - 0.1,
                                   [](const glm::dvec3& q, double x) { return q.x < x; });
        for (; at != corners.end() && at->x < p.x + 0.1; ++at) nearest = std::min(nearest, glm::length(p - *at));
        worst = std::max(worst, nearest);
    }
    return worst;
}

TEST(Coordinates, AVertexFarAwayTakesNoTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Progress silent(false);
    const glm::dvec3 centre(100, 50, 20);
    for (const double far : {1e3, 1e5, 1e7}) {
        TriangleMesh mesh = sphereOfTriangles(72, centre, 30);
        mesh.position.front() = centre + glm::dvec3(far, 0, 0);
        const auto built = buildMeshStore(sourceOf(mesh), folder / "m", {}, *executor, silent);
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_EQ(built->pointsOut, mesh.indices.size() / 3) << far;
        const auto store = opened(folder / "m");
        // 30 bits of the extent, or 24 of what is not far.
        EXPECT_LE(farthestCorner(mesh, *store, centre, 40), std::max(far * std::exp2(-29), 64 * std::exp2(-23))) << far;
        EXPECT_GT(far * std::exp2(-24), far > 1e6 ? 0.5 : 0.0) << "24 bits of the extent";
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far;
    }
}

TEST(Coordinates, ObjHasTheDigitsOfMapCoordinates) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Progress silent(false);
    const glm::dvec3 centre(431'234.5, 5'321'987.25, 512.125);
    TriangleMesh mesh = sphereOfTriangles(18, centre, 2);
    {
        std::ofstream out(folder / "a.obj");
        out.precision(15);
        for (const glm::dvec3& p : mesh.position) out << "v " << p.x << ' ' << p.y << ' ' << p.z << '\n';
        for (size_t i = 0; i < mesh.indices.size(); i += 3)
            out << "f " << mesh.indices[i] + 1 << ' ' << mesh.indices[i + 1] + 1 << ' ' << mesh.indices[i + 2] + 1
                << '\n';
    }
    const auto scene = scene::readObj(folder / "a.obj");
    ASSERT_TRUE(scene) << scene.error().line();
    const auto built =
        buildMeshStore(scene::triangleSource(*scene, scene::placements(*scene)), folder / "m", {}, *executor, silent);
    ASSERT_TRUE(built) << built.error().line();
    EXPECT_EQ(built->pointsOut, mesh.indices.size() / 3);
    const auto store = opened(folder / "m");
    EXPECT_LE(farthestCorner(mesh, *store, centre, 10), 1e-6);
    double single = 0;
    for (const glm::dvec3& p : mesh.position) single = std::max(single, glm::length(glm::dvec3(glm::vec3(p)) - p));
    EXPECT_GT(single, 0.1) << "fp32 has not";
}

/// Largest distance of a vertex of `truth` from the nearest end of a segment of a leaf.
double farthestEnd(const std::shared_ptr<const Store>& store, const std::vector<glm::dvec3>& truth) {
    const Hierarchy& h = store->hierarchy;
    std::vector<glm::dvec3> ends;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        const double step = h.unit * std::exp2(h.nodes[n].stepShift);
        const Chunk chunk = *readChunk(*store, n);
        for (const shared::CurveSegment& s : chunk.segments)
            for (const shared::CurveVertex& v : {s.a, s.b})
                ends.push_back(h.origin + h.unit * h.recordOrigin(h.nodes[n]) +
                               step * glm::dvec3(v.positionXY & 0xffffu, v.positionXY >> 16, v.positionZ & 0xffffu));
    }
    double worst = 0;
    for (const glm::dvec3& p : truth) {
        double nearest = 1e300;
        for (const glm::dvec3& q : ends) nearest = std::min(nearest, glm::length(p - q));
        worst = std::max(worst, nearest);
    }
    return worst;
}

TEST(Coordinates, ACurveFarAwayMovesNoOthers) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    CurveSet set = test::curls({.count = 100, .vertices = 40});
    std::vector<glm::dvec3> truth = set.position;
    for (const glm::dvec3& p : {glm::dvec3(1e4, 0, 0), glm::dvec3(1e4, 1, 0)}) set.addVertex(p, 0.01f, glm::vec3(0), 0);
    set.endCurve(false);
    const auto store = test::buildCurves(set, folder / "s", *executor, 8192);
    const double worst = farthestEnd(store, truth);
    EXPECT_LE(worst, 0.01 / 8) << "an eighth of the radius";
    EXPECT_GT(1e4 / 32768, 0.01) << "steps of the whole extent would be too coarse";
    EXPECT_TRUE(verifyStore(*store, *executor, 0));
}

TEST(Coordinates, ACurveThatWouldRuinTheOthersIsLeftOutAndCounted) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const CurveSet alone = test::curls({.count = 100, .vertices = 40});
    for (const double far : {1e30, 1e160, 1e308}) {
        CurveSet set = alone;
        const glm::dvec3 first = set.position.front();
        // In, in, out, out, in, in: two segments stay.
        for (const glm::dvec3& p :
             {first, first + glm::dvec3(0, 0, 0.3), glm::dvec3(far, 0, 0), glm::dvec3(far, far, 0),
              first + glm::dvec3(0, 0.3, 0), first + glm::dvec3(0, 0.6, 0)})
            set.addVertex(p, 0.01f, glm::vec3(0), 0);
        set.endCurve(false);
        const auto store = test::buildCurves(set, folder / "s", *executor, 8192);
        EXPECT_EQ(store->description.dropped,
                  (std::map<std::string, uint64_t>{{"that reach too far out for the others' places", 3}}))
            << far;
        EXPECT_LE(farthestEnd(store, alone.position), 0.01 / 8) << far;
        EXPECT_LT(store->description.boundsMax.x, 1e3) << far;
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far;
    }
}

}  // namespace
}  // namespace stipple::lod
