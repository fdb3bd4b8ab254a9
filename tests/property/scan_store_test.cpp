// Stores of elevation patches from points: what their levels are, closed at any cut, the same bytes whatever the order,
// and what fits no patch stays points.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include "lod/builder/scan_store/scan_store_build.h"
#include "lod/verify/patches.h"
#include "tests/support/patch_cuts.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;
using test::Triangle;

struct Built {
    BuildReport report;
    Store store;
    std::string bytes;
};

/// Binary PLY of fp64 places, with what else there is.
void writePly(const std::string& path, const PointBlock& points) {
    std::ofstream out(path, std::ios::binary);
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.position.size()
        << "\nproperty double x\nproperty double y\nproperty double z\n";
    if (!points.normal.empty()) out << "property float nx\nproperty float ny\nproperty float nz\n";
    if (!points.colour.empty()) out << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    out << "end_header\n";
    for (size_t i = 0; i < points.position.size(); ++i) {
        out.write(reinterpret_cast<const char*>(&points.position[i]), 24);
        if (!points.normal.empty()) out.write(reinterpret_cast<const char*>(&points.normal[i]), 12);
        if (!points.colour.empty()) out.write(reinterpret_cast<const char*>(&points.colour[i]), 3);
    }
}

Result<BuildReport> tryBuild(const PointBlock& points, const std::string& path, const ScanBuildSettings& settings,
                             int threads) {
    writePly(path + ".ply", points);
    const auto executor = makeTbbExecutor(threads);
    Progress silent(false);
    return buildScanStore({path + ".ply"}, path, settings, *executor, silent);
}
/// Leaves of few points, so that there are several levels.
ScanBuildSettings finely() {
    ScanBuildSettings settings;
    settings.leafPoints = 1500;
    return settings;
}
Built build(const PointBlock& points, const std::string& path, const ScanBuildSettings& settings = finely(),
            int threads = 2) {
    Built out;
    const auto report = tryBuild(points, path, settings, threads);
    EXPECT_TRUE(report) << (report ? "" : report.error().line());
    if (!report) return out;
    out.report = *report;
    auto store = openStore(path);
    EXPECT_TRUE(store);
    out.store = std::move(*store);
    out.bytes = test::slurp(path);
    return out;
}

/// Places of a mesh, as many as asked for on its triangles, evenly by area.
PointBlock sampled(const TriangleMesh& mesh, size_t count, uint64_t seed) {
    const std::vector<Triangle> all = test::trianglesOf(mesh);
    std::vector<double> sum;
    for (const Triangle& t : all)
        sum.push_back((sum.empty() ? 0 : sum.back()) + glm::length(glm::cross(t[1] - t[0], t[2] - t[0])));
    Rng rng(seed);
    PointBlock out;
    for (size_t k = 0; k < count; ++k) {  // (stratified, so that the densities are even)
        const double at = (static_cast<double>(k) + rng.uniform()) / static_cast<double>(count) * sum.back();
        const auto i = static_cast<size_t>(std::upper_bound(sum.begin(), sum.end(), at) - sum.begin());
        const Triangle& t = all[std::min(i, all.size() - 1)];
        double u = rng.uniform(), v = rng.uniform();
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        out.position.push_back(t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]));
    }
    return out;
}
/// The vertices of the torus: dense and even.
PointBlock torusPoints(uint32_t around, uint32_t across) {
    PointBlock out;
    out.position = test::wavyTorus(around, across).position;
    return out;
}

std::vector<NodeSurface> leavesOf(const Store& store) {
    std::vector<NodeSurface> leaves;
    for (uint32_t n = 0; n < store.hierarchy.nodes.size(); ++n) {
        if (!store.hierarchy.nodes[n].isLeaf()) continue;
        auto surface = NodeSurface::read(store, n);
        EXPECT_TRUE(surface);
        if (surface) leaves.push_back(std::move(*surface));
    }
    return leaves;
}
/// Every point of the source lies within what is stated of the leaves' patches and discs.
void expectAllIsThere(const PointBlock& points, const Store& store) {
    const Hierarchy& h = store.hierarchy;
    const std::vector<NodeSurface> leaves = leavesOf(store);
    const double most = store.description.roundingUnits / h.unit * (1 + 1e-9);
    size_t missing = 0;
    for (size_t k = 0; k < points.position.size(); k += points.position.size() / 700 + 1) {
        const glm::dvec3 p = (points.position[k] - h.origin) / h.unit;
        if (!(glm::length(p) < 1e300)) continue;
        missing += std::none_of(leaves.begin(), leaves.end(), [&](const NodeSurface& s) { return s.isWithin(p, most); })
                       ? 1u
                       : 0u;
    }
    EXPECT_EQ(missing, 0u);
}
void expectBooksAreRight(const BuildReport& report) {
    uint64_t books = report.pointsIn;
    for (const auto& [reason, count] : report.added) books += count;
    for (const auto& [reason, count] : report.dropped) books -= count;
    EXPECT_EQ(books, report.pointsOut);
}
uint64_t discsOf(const Store& store) {
    uint64_t discs = 0;
    for (uint32_t n = 0; n < store.hierarchy.nodes.size(); ++n) {
        if (!store.hierarchy.nodes[n].isLeaf()) continue;
        store.hierarchy.forEachPayload(n, [&](uint32_t chunk) {
            const Payload& p = store.hierarchy.payload(chunk);
            discs += p.kind == Kind::points ? p.records : 0;
        });
    }
    return discs;
}

TEST(ScanStore, EveryLevelIsWithinItsErrorOfTheLeaves) {
    const test::TempFolder folder;
    const PointBlock points = torusPoints(200, 80);
    const Built built = build(points, folder / "a.stipple");
    const Hierarchy& h = built.store.hierarchy;
    ASSERT_GE(h.nodes.size(), 20u);
    EXPECT_EQ(built.report.pointsIn, points.position.size());
    expectBooksAreRight(built.report);
    expectAllIsThere(points, built.store);
    EXPECT_LE(discsOf(built.store), points.position.size() / 100);
    const auto all = test::trianglesOfAll(built.store);
    std::vector<Triangle> leaves;
    for (const uint32_t n : test::cutOf(h, [](uint32_t) { return true; })) test::append(all[n], leaves);
    uint32_t deepest = 0;
    for (const Node& n : h.nodes) deepest = std::max<uint32_t>(deepest, n.level);
    ASSERT_GE(deepest, 2u);
    // (That of the leaves from the truth, which no build knows: the torus itself, a quarter as far apart.)
    const std::vector<Triangle> truth = test::trianglesOf(test::wavyTorus(800, 320));
    EXPECT_LE(test::largestDistance(truth, leaves, 3000, 1), built.store.description.roundingUnits);
    for (uint32_t level = 0; level < deepest; ++level) {
        std::vector<Triangle> cut;
        double error = 0;
        for (const uint32_t n : test::cutOf(h, [&](uint32_t k) { return h.nodes[k].level < level; })) {
            test::append(all[n], cut);
            error = std::max(error, h.unit * h.errors.decode(h.nodes[n].errorCode));
            EXPECT_LE(h.nodes[n].errorCode, n == 0 ? 254 : h.nodes[h.nodes[n].parent].errorCode);
        }
        const double there = test::largestDistance(cut, leaves, 3000, 3),
                     back = test::largestDistance(leaves, cut, 3000, 4);
        EXPECT_LE(there, error) << "level " << level;
        EXPECT_LE(back, error) << "level " << level;
        EXPECT_GT(std::max(there, back), 0.02 * error) << "an error that says too little, level " << level;
    }
}

TEST(ScanStore, IsClosedAtAnyCut) {
    const test::TempFolder folder;
    const Built built = build(torusPoints(200, 80), folder / "a.stipple");
    const Hierarchy& h = built.store.hierarchy;
    const auto all = test::trianglesOfAll(built.store);
    const std::vector<glm::dvec3> inside = test::insideTorus();
    Rng rng(5);
    for (int round = 0; round < 6; ++round) {
        std::vector<Triangle> drawn;
        const std::vector<uint32_t> last = test::cutOf(h, [&](uint32_t) { return rng.uniform() < 0.7; });
        for (const uint32_t n : last) test::append(all[n], drawn);
        EXPECT_EQ(test::escaping(drawn, inside, 1500, rng), 0u) << "cut " << round << " of " << last.size() << " nodes";
    }
    // The control: all leaves without what reaches beyond their cells.
    std::vector<Triangle> drawn;
    for (const uint32_t n : test::cutOf(h, [](uint32_t) { return true; })) {
        const glm::dvec3 cell(h.nodes[n].cell[0], h.nodes[n].cell[1], h.nodes[n].cell[2]);
        for (const Triangle& t : all[n]) {
            const glm::dvec3 at = ((t[0] + t[1] + t[2]) / 3.0 - h.origin) / (h.unit * h.cellSize(h.nodes[n]));
            if (glm::floor(at) == cell) drawn.push_back(t);
        }
    }
    EXPECT_GT(test::escaping(drawn, inside, 6000, rng), 0u);
}

TEST(ScanStore, IsTheSameForAnyOrderThreadsAndMemory) {
    const test::TempFolder folder;
    PointBlock points = sampled(test::wavyTorus(60, 24), 9000, 3);
    for (size_t k = 0; k < points.position.size(); ++k)
        points.colour.push_back(static_cast<uint32_t>(k * 2654435761u) & 0xffffffu);
    const Built built = build(points, folder / "a.stipple");
    // (The file's name is in the store.)
    const auto again = [&](const PointBlock& of, const ScanBuildSettings& settings, int threads) {
        fs::remove(folder / "a.stipple");
        return build(of, folder / "a.stipple", settings, threads).bytes == built.bytes;
    };
    EXPECT_TRUE(again(points, finely(), 1));
    EXPECT_TRUE(again(points, finely(), 4));
    for (const uint64_t seed : {1, 2}) EXPECT_TRUE(again(test::shuffled(points, seed), finely(), 2));
    ScanBuildSettings settings = finely();
    settings.coneDegrees = 40;
    EXPECT_FALSE(again(points, settings, 2));
}

TEST(ScanStore, GoesOnWhereItWasStopped) {
    const test::TempFolder folder;
    const std::string path = folder / "a.stipple";
    const PointBlock points = sampled(test::wavyTorus(100, 40), 140'000, 9);
    ScanBuildSettings settings = finely();
    settings.leafPoints = 9000;
    const Built whole = build(points, path, settings);
    ASSERT_GE(whole.store.hierarchy.nodes.size(), 9u);
    fs::remove(path);
    settings.points.memoryBytes = uint64_t{266} << 20;
    std::atomic<int> asked{0};
    settings.points.isStopped = [&] { return ++asked < 0; };
    const auto little = tryBuild(points, path, settings, 1);
    ASSERT_TRUE(little) << little.error().line();
    EXPECT_GT(little->temporaryBytes, 0u);
    const int all = asked;
    EXPECT_TRUE(test::slurp(path) == whole.bytes) << "with little memory";
    fs::remove(path);
    for (const int part : {3, 9}) {
        asked = 0;
        settings.points.isStopped = [&] { return ++asked == std::max(1, all * part / 10); };
        const auto executor = makeTbbExecutor(1);
        Progress silent(false);
        const auto stopped = buildScanStore({path + ".ply"}, path, settings, *executor, silent);
        ASSERT_FALSE(stopped) << part;
        EXPECT_EQ(stopped.error().kind, ErrorKind::interrupted);
        settings.points.isStopped = {};
        const auto built = buildScanStore({path + ".ply"}, path, settings, *executor, silent);
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_TRUE(test::slurp(path) == whole.bytes) << "stopped at " << part << " of 10";
        fs::remove(path);
    }
}

PointBlock blockOf(std::vector<glm::dvec3> places) {
    PointBlock out;
    out.position = std::move(places);
    return out;
}

TEST(ScanStore, OfHostilePointsIsPatchesOrPoints) {
    const test::TempFolder folder;
    Rng rng(11);
    std::map<std::string, std::vector<glm::dvec3>> of;
    for (int k = 0; k < 4000; ++k) {
        const double u = rng.uniform(), v = rng.uniform(), a = 6.283185307179586 * v;
        of["volume"].emplace_back(u, v, rng.uniform());
        of["line"].emplace_back(u, 1e-4 * rng.normal(), 1e-4 * rng.normal());
        of["noisy"].emplace_back(u, v, 2.0 / 63 * rng.normal());               // two spacings
        of["tube"].emplace_back(u, 0.003 * std::cos(a), 0.003 * std::sin(a));  // a fifth of a spacing
        of["sheets"].emplace_back(u, v, k % 2 == 0 ? 0 : 1e-6);
        const double b = 0.6 * v - 0.3, r = 1 + b * std::cos(3.141592653589793 * u), t = 6.283185307179586 * u;
        of["half a turn"].emplace_back(r * std::cos(t), r * std::sin(t), b * std::sin(t / 2));  // no orientation
    }
    of["one"].emplace_back(1, 2, 3);
    for (int k = 0; k < 30; ++k) of["few"].emplace_back(k % 6, k / 6, 0);
    of["at one place"].assign(3000, {4, 5, 6});
    of["far"] = of["sheets"];
    of["far"].emplace_back(1e3, -1e3, 1e3);
    for (const auto& [name, places] : of) {
        SCOPED_TRACE(name);
        const PointBlock points = blockOf(places);
        const Built built = build(points, folder / "a.stipple");
        if (built.bytes.empty()) continue;
        EXPECT_EQ(built.report.pointsIn, points.position.size());
        expectBooksAreRight(built.report);
        expectAllIsThere(points, built.store);
        const double left = static_cast<double>(discsOf(built.store)) / static_cast<double>(built.report.pointsOut);
        if (name == "volume") EXPECT_GT(left, 0.5) << "a volume is no surface";
        if (name == "line" || name == "one" || name == "at one place") EXPECT_EQ(left, 1) << "no surface";
        if (name == "sheets" || name == "half a turn") EXPECT_LT(left, 0.05) << "a surface";
        if (name == "at one place") EXPECT_EQ(built.report.pointsOut, 1u);
        fs::remove(folder / "a.stipple");
    }
}

TEST(ScanStore, OfNothingIsRefused) {
    const test::TempFolder folder;
    const double nan = std::nan("");
    const auto none = tryBuild(blockOf({{nan, 0, 0}, {0, nan, 0}}), folder / "b.stipple", finely(), 1);
    ASSERT_FALSE(none);
    EXPECT_FALSE(fs::exists(folder / "b.stipple"));
}

TEST(ScanStore, KeepsColoursAndSidesOfNormals) {
    const test::TempFolder folder;
    Rng rng(4);
    PointBlock points;
    for (int k = 0; k < 20'000; ++k) {
        points.position.emplace_back(rng.uniform(), rng.uniform(), 0);
        points.normal.emplace_back(0, 0, -1);
        points.colour.push_back(points.position.back().x < 0.5 ? 0x2040c0u : 0xc04020u);
    }
    const Built built = build(points, folder / "a.stipple");
    const Hierarchy& h = built.store.hierarchy;
    size_t samples = 0, wrong = 0, turned = 0;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        h.forEachPayload(n, [&](uint32_t chunk) {
            if (kindOf(h, chunk) != Kind::patches) return;
            const auto patches = readPatches(built.store, chunk);
            ASSERT_TRUE(patches);
            const Node& node = h.nodes[n];
            const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
            for (const Patch& p : *patches) {
                const PatchSurface surface(p);
                turned += surface.frame()[2].z > 0 ? 1 : 0;
                for (size_t s = 0; s < p.heights.size(); ++s) {
                    if (p.heights[s] == 0) continue;
                    const double x = h.origin.x + h.unit * (corner + surface.position(s)).x, off = x - 0.5;
                    if (std::abs(off) < 8 * h.unit * double{p.step}) continue;
                    ++samples;
                    wrong += (p.colours[s] & 0xffffffu) != (off < 0 ? 0x2040c0u : 0xc04020u) ? 1 : 0;
                }
            }
        });
    }
    EXPECT_GT(samples, 10'000u);
    EXPECT_EQ(wrong, 0u);
    EXPECT_EQ(turned, 0u);
}

TEST(ScanStore, DamageIsFoundByMeasuring) {
    const test::TempFolder folder;
    Built built = build(torusPoints(200, 80), folder / "a.stipple");
    const auto executor = makeTbbExecutor(2);
    const auto right = verifyStore(built.store, *executor);
    ASSERT_TRUE(right) << right.error().line();
    EXPECT_GT(right->errorsMeasured, 500u);
    // The control: the errors that it says, a 32nd as large.
    built.store.hierarchy.errors.smallest /= 32;
    built.store.description.roundingUnits /= 32;
    const auto wrong = verifyStore(built.store, *executor);
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().line().find("farther from the leaves"), std::string::npos) << wrong.error().line();
}

}  // namespace
}  // namespace stipple::lod
