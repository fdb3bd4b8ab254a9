// Stores of elevation patches: what their levels are, closed at any cut, the same bytes whatever the order.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <map>

#include "lod/builder/patch_store/patch_store_build.h"
#include "lod/verify/patches.h"
#include "tests/support/patch_cuts.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/triangle_field.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;
using test::append;
using test::cutOf;
using test::escaping;
using test::insideTorus;
using test::Triangle;
using test::trianglesOfAll;
using test::wavyTorus;

struct Built {
    BuildReport report;
    Store store;
    std::string bytes;
};

Result<BuildReport> tryBuild(const TriangleMesh& mesh, const std::string& path, const PatchBuildSettings& settings,
                             int threads) {
    const auto executor = makeTbbExecutor(threads);
    Progress silent(false);
    return buildPatchStore(sourceOf(mesh), path, settings, *executor, silent);
}
/// Leaves of few triangles, so that there are several levels.
PatchBuildSettings finely() {
    PatchBuildSettings settings;
    settings.leafTriangles = 1500;
    settings.description.materials.resize(1);
    return settings;
}
Built build(const TriangleMesh& mesh, const std::string& path, const PatchBuildSettings& settings = finely(),
            int threads = 2) {
    Built out;
    const auto report = tryBuild(mesh, path, settings, threads);
    EXPECT_TRUE(report) << (report ? "" : report.error().line());
    if (!report) return out;
    out.report = *report;
    auto store = openStore(path);
    EXPECT_TRUE(store);
    out.store = std::move(*store);
    out.bytes = test::slurp(path);
    return out;
}

TEST(PatchStore, EveryLevelIsWithinItsErrorOfTheSourceAndTheLeaves) {
    const test::TempFolder folder;
    const TriangleMesh mesh = wavyTorus(200, 80);
    const Built built = build(mesh, folder / "a.stipple");
    const Hierarchy& h = built.store.hierarchy;
    ASSERT_GE(h.nodes.size(), 40u);
    EXPECT_EQ(built.report.pointsIn, mesh.indices.size() / 3);
    const auto all = trianglesOfAll(built.store);
    std::vector<Triangle> leaves;
    const std::vector<Triangle> source = test::trianglesOf(mesh);
    for (const uint32_t n : cutOf(h, [](uint32_t) { return true; })) append(all[n], leaves);
    const double residual = built.store.description.roundingUnits;
    EXPECT_LE(test::largestDistance(leaves, source, 4000, 1), residual);
    EXPECT_LE(test::largestDistance(source, leaves, 4000, 2), residual);
    uint32_t deepest = 0;
    for (const Node& n : h.nodes) deepest = std::max<uint32_t>(deepest, n.level);
    ASSERT_GE(deepest, 2u);
    for (uint32_t level = 0; level < deepest; ++level) {
        std::vector<Triangle> cut;
        double error = 0;
        for (const uint32_t n : cutOf(h, [&](uint32_t k) { return h.nodes[k].level < level; })) {
            append(all[n], cut);
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

/// A torus, one half of many triangles with spikes that no coarse level keeps, the other smooth, of few: shallow leaves
/// beside deep ones.
TriangleMesh halfRoughTorus(double height, uint32_t fine, uint32_t few, uint32_t across) {
    const uint32_t all = fine + few;
    return test::sheet(all, across, [&](double u, double v) {
        const auto i = static_cast<uint32_t>(std::lround(u * all)) % all,
                   j = static_cast<uint32_t>(std::lround(v * across)) % across;
        const double turn = i < fine ? 0.5 * i / fine : 0.5 + 0.5 * (i - fine) / few;
        const double a = 6.283185307179586 * turn, b = 6.283185307179586 * j / across;
        const bool isSpike = i > 0 && i < fine && i % 4 == 2 && j % 4 == 2;
        const double tube = 0.4 + (isSpike ? height : 0), r = 1 + tube * std::cos(b);
        return glm::dvec3(r * std::cos(a), r * std::sin(a), tube * std::sin(b));
    });
}

/// Places of nodes beyond their cells, which stand for neighbours' triangles: what a neighbour was simplified by before
/// its strips came is a part of the error.
TEST(PatchStore, WhatNeighboursWereSimplifiedByIsInTheError) {
    const test::TempFolder folder;
    for (const double height : {0.002, 0.006}) {
        const TriangleMesh mesh = halfRoughTorus(height, 240, 60, 100);
        PatchBuildSettings settings = finely();
        settings.leafTriangles = 3000;
        const Built built = build(mesh, folder / "a.stipple", settings);
        const Hierarchy& h = built.store.hierarchy;
        uint32_t shallowest = 100, deepest = 0;
        const test::TriangleField source(test::trianglesOf(mesh));
        for (uint32_t n = 0; n < h.nodes.size(); ++n) {
            const Node& node = h.nodes[n];
            if (node.isLeaf()) {
                shallowest = std::min<uint32_t>(shallowest, node.level);
                deepest = std::max<uint32_t>(deepest, node.level);
            }
            const double most =
                node.isLeaf() ? built.store.description.roundingUnits : h.unit * h.errors.decode(node.errorCode);
            double far = 0;
            const glm::dvec3 cell(node.cell[0], node.cell[1], node.cell[2]);
            for (const Triangle& t : test::trianglesOf(built.store, n)) {
                const glm::dvec3 p = (t[0] + t[1] + t[2]) / 3.0;
                const bool isOwn = glm::floor((p - h.origin) / (h.unit * h.cellSize(node))) == cell;
                if (!isOwn) far = std::max(far, source.distance(p, 4 * most));
            }
            EXPECT_LE(far, most) << "node " << n << ", level " << int{node.level} << (node.isLeaf() ? ", a leaf" : "");
        }
        EXPECT_GT(deepest, shallowest);
    }
}

TEST(PatchStore, ALevelOfCreasedSurfacesComesInAtAboutItsStep) {
    const test::TempFolder folder;
    TriangleMesh mesh = test::torusMesh(200, 80);
    for (glm::dvec3& p : mesh.position) p *= 1 + 0.1 * std::abs(std::sin(7 * p.x) * std::sin(5 * p.y));
    const Hierarchy h = build(mesh, folder / "a.stipple").store.hierarchy;
    size_t inner = 0;
    for (const Node& n : h.nodes) {
        if (n.isLeaf()) continue;
        ++inner;
        // (A code above 1.25: the rounding of the lattice is part of the bound.)
        EXPECT_LE(h.errors.decode(n.errorCode), 1.3 * h.cellSize(n) / 64) << "level " << int{n.level};
    }
    EXPECT_GE(inner, 5u);
}

/// Largest difference, over the samples of a level, between their colours and `colourAt` their places (0 to 255), and
/// the share of samples that have another material than `materialAt`.
struct LooksOff {
    double colour = 0, far = 0, material = 0;  ///< far: share of samples whose colour is more than 24 off
    size_t samples = 0;
};
LooksOff looksOff(const Store& store, uint32_t level, const std::function<double(const glm::dvec3&)>& redAt,
                  const std::function<int(const glm::dvec3&)>& materialAt) {
    const Hierarchy& h = store.hierarchy;
    LooksOff off;
    double wrong = 0, known = 0, far = 0;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        h.forEachPayload(n, [&](uint32_t chunk) {
            if (h.nodes[n].level != level || kindOf(h, chunk) != Kind::patches) return;
            const auto patches = readPatches(store, chunk);
            ASSERT_TRUE(patches);
            const glm::dvec3 corner =
                glm::dvec3(h.nodes[n].cell[0], h.nodes[n].cell[1], h.nodes[n].cell[2]) * h.cellSize(h.nodes[n]);
            for (const Patch& p : *patches) {
                const PatchSurface surface(p);
                for (size_t s = 0; s < p.heights.size(); ++s) {
                    if (p.heights[s] == 0) continue;
                    const glm::dvec3 at = h.origin + h.unit * (corner + surface.position(s));
                    if (std::min({at.x, at.y, 4 - at.x, 4 - at.y}) < 0) continue;  // beyond the border: what is near
                    ++off.samples;
                    const double by = std::abs(redAt(at) - static_cast<double>(p.colours[s] & 255u));
                    off.colour = std::max(off.colour, by);
                    far += by > 24 ? 1 : 0;
                    if (materialAt(at) < 0) continue;
                    ++known;
                    wrong += (p.materials.empty() ? 0 : p.materials[s]) != materialAt(at) ? 1 : 0;
                }
            }
        });
    off.material = wrong / std::max(known, 1.0);
    off.far = far / static_cast<double>(std::max<size_t>(off.samples, 1));
    return off;
}

// Twelve triangles, and a texture that knows much more: every level has its means, not the colours of its corners.
TEST(PatchStore, LooksOfMaterialsAreOnEveryLevel) {
    const test::TempFolder folder;
    TriangleMesh mesh = test::sheet(2, 3, [](double u, double v) { return glm::dvec3(4 * u, 4 * v, 0.3 * u * v); });
    mesh.uv.clear();
    for (const glm::dvec3& p : mesh.position) mesh.uv.emplace_back(p.x, p.y);
    mesh.surface.assign(mesh.position.size(), 0);
    mesh.colour.assign(mesh.position.size(), 0xffffffffu);
    mesh.normal.clear();
    // A wave of two units' length, and stripes of materials one unit wide.
    const auto red = [](double x) { return 0.5 + 0.3 * std::sin(3.14159265 * x); };
    PatchBuildSettings settings;
    settings.leafTriangles = 64;
    settings.samples = 120'000;
    settings.description.pointMaterials = {{1, 0}, {0.3f, 1}};
    settings.looks = [&](uint32_t, const glm::vec2& uv, float) {
        PlaceLook look;
        look.colour = {static_cast<float>(red(double{uv.x})), 0.2f, 0.2f};
        look.material = static_cast<uint8_t>(static_cast<int>(std::floor(uv.y)) & 1);
        return look;
    };
    const Built looks = build(mesh, folder / "a.stipple", settings);
    const auto redAt = [&](const glm::dvec3& p) {
        const double linear = red(p.x);
        return 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055);
    };
    const auto materialAt = [&](const glm::dvec3& p) {
        const double in = p.y - std::floor(p.y);
        return in < 0.15 || in > 0.85 ? -1 : static_cast<int>(std::floor(p.y)) & 1;
    };
    uint32_t deepest = 0;
    for (const Node& n : looks.store.hierarchy.nodes) deepest = std::max<uint32_t>(deepest, n.level);
    ASSERT_GE(deepest, 2u);
    for (uint32_t level = 0; level <= deepest; ++level) {
        const LooksOff off = looksOff(looks.store, level, redAt, materialAt);
        if (level == 0 || level == deepest) EXPECT_GT(off.samples, 500u) << level;
        // Of inner levels but where a sliver is seen across, whose places are anywhere along it.
        if (level == deepest) EXPECT_LE(off.colour, 6) << "level " << level;
        EXPECT_LE(off.far, 0.002) << "level " << level;
        EXPECT_LE(off.material, level == deepest ? 0 : 0.02) << "level " << level;
    }
    EXPECT_EQ(looks.store.description.pointMaterials.size(), 2u);
    const auto executor = makeTbbExecutor(2);
    EXPECT_TRUE(verifyStore(looks.store, *executor, 0));
    // Control: of corners alone.
    PatchBuildSettings without = settings;
    without.looks = nullptr;
    EXPECT_GT(looksOff(build(mesh, folder / "b.stipple", without).store, 0, redAt, materialAt).far, 0.5);
    // The same bytes for another number of threads and another order.
    EXPECT_TRUE(build(test::shuffled(mesh, 5), folder / "c.stipple", settings, 1).bytes == looks.bytes);
}

TEST(PatchStore, IsClosedAtAnyCut) {
    const test::TempFolder folder;
    const Built built = build(wavyTorus(200, 80), folder / "a.stipple");
    const Hierarchy& h = built.store.hierarchy;
    const auto all = trianglesOfAll(built.store);
    const std::vector<glm::dvec3> inside = insideTorus();
    Rng rng(5);
    std::vector<uint32_t> last;
    for (int round = 0; round < 6; ++round) {
        std::vector<Triangle> drawn;
        last = cutOf(h, [&](uint32_t) { return rng.uniform() < 0.7; });
        for (const uint32_t n : last) append(all[n], drawn);
        EXPECT_EQ(escaping(drawn, inside, 1500, rng), 0u) << "cut " << round << " of " << last.size() << " nodes";
    }
    // The control: without what reaches beyond its node's cell.
    std::vector<Triangle> drawn;
    for (const uint32_t n : last) {
        const glm::dvec3 cell(h.nodes[n].cell[0], h.nodes[n].cell[1], h.nodes[n].cell[2]);
        for (const Triangle& t : all[n]) {
            const glm::dvec3 at = ((t[0] + t[1] + t[2]) / 3.0 - h.origin) / (h.unit * h.cellSize(h.nodes[n]));
            if (glm::floor(at) == cell) drawn.push_back(t);
        }
    }
    EXPECT_GT(escaping(drawn, inside, 3000, rng), 0u);
}

TEST(PatchStore, IsTheSameForAnyOrderThreadsAndMemory) {
    const test::TempFolder folder;
    const TriangleMesh mesh = wavyTorus(120, 50);
    const Built built = build(mesh, folder / "a.stipple");
    EXPECT_TRUE(build(mesh, folder / "b.stipple", finely(), 1).bytes == built.bytes);
    EXPECT_TRUE(build(mesh, folder / "c.stipple", finely(), 4).bytes == built.bytes);
    for (const uint64_t seed : {1, 2})
        EXPECT_TRUE(build(test::shuffled(mesh, seed), folder / "d.stipple").bytes == built.bytes);
    PatchBuildSettings settings = finely();
    settings.coneDegrees = 40;
    EXPECT_FALSE(build(mesh, folder / "e.stipple", settings).bytes == built.bytes);
}

/// With which `outOfCore` goes through the disk.
constexpr uint64_t kLittleMemory = uint64_t{264} << 20;
TriangleMesh outOfCore() { return wavyTorus(500, 160); }

TEST(PatchStore, GoesOnWhereItWasStopped) {
    const test::TempFolder folder;
    const std::string path = folder / "a.stipple";
    const TriangleMesh mesh = outOfCore();
    const Built whole = build(mesh, folder / "whole.stipple", {});
    ASSERT_GE(whole.store.hierarchy.nodes.size(), 9u);
    PatchBuildSettings settings;
    settings.limits.memoryBytes = kLittleMemory;
    std::atomic<int> asked{0};
    int all = 0;
    settings.limits.isStopped = [&] { return ++asked < 0; };
    ASSERT_TRUE(tryBuild(mesh, path, settings, 1));
    all = asked;
    EXPECT_TRUE(test::slurp(path) == whole.bytes) << "with little memory";
    fs::remove(path);
    // (It is asked mostly within cells; the first time in the survey, before there is anything to go on with.)
    for (const int part : {0, 3, 8, 9}) {
        asked = 0;
        settings.limits.isStopped = [&] { return ++asked == std::max(1, all * part / 10); };
        const auto stopped = tryBuild(mesh, path, settings, 1);
        ASSERT_FALSE(stopped) << part;
        EXPECT_EQ(stopped.error().kind, ErrorKind::interrupted);
        settings.limits.isStopped = {};
        const auto built = tryBuild(mesh, path, settings, 1);
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_EQ(built->isResumed, fs::exists(path) && part > 0) << part;
        EXPECT_TRUE(test::slurp(path) == whole.bytes) << "stopped at " << part << " of 10";
        fs::remove(path);
    }
}

/// Every triangle of the source lies within the rounding of the leaves' patches and discs.
void expectAllIsThere(const TriangleMesh& mesh, const Store& store) {
    const Hierarchy& h = store.hierarchy;
    std::vector<NodeSurface> leaves;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        auto surface = NodeSurface::read(store, n);
        ASSERT_TRUE(surface);
        leaves.push_back(std::move(*surface));
    }
    const double most = store.description.roundingUnits / h.unit * (1 + 1e-9);
    Rng rng(3);
    size_t missing = 0;
    const std::vector<Triangle> source = test::trianglesOf(mesh);
    for (size_t k = 0; k < 500; ++k) {
        const Triangle& t = source[k % source.size()];
        double u = rng.uniform(), v = rng.uniform();
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        const glm::dvec3 p = (t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]) - h.origin) / h.unit;
        missing += std::none_of(leaves.begin(), leaves.end(), [&](const NodeSurface& s) { return s.isWithin(p, most); })
                       ? 1u
                       : 0u;
    }
    EXPECT_EQ(missing, 0u);
}

TEST(PatchStore, OfHostileMeshesIsPatchesOrDiscs) {
    const test::TempFolder folder;
    Rng rng(11);
    const auto at = [&] { return glm::dvec3(rng.uniform(), rng.uniform(), rng.uniform()); };
    std::map<std::string, TriangleMesh> meshes;
    for (int k = 0; k < 2000; ++k) {  // slivers in any direction, none beside another
        const glm::dvec3 p = at();
        TriangleMesh& m = meshes["soup"];
        for (const glm::dvec3& q : {p, p + 0.03 * (at() - 0.5), p + 0.003 * (at() - 0.5)}) {
            m.indices.push_back(static_cast<uint32_t>(m.position.size()));
            m.position.push_back(q);
        }
    }
    meshes["one"].position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.3}};
    meshes["one"].indices = {0, 1, 2};
    for (const double z : {0.0, 1e-6}) {  // two sheets, the upper one turned over
        const TriangleMesh sheet =
            test::sheet(40, 40, [&](double u, double v) { return glm::dvec3(z == 0 ? u : v, z == 0 ? v : u, z); });
        TriangleMesh& m = meshes["sheets"];
        const auto first = static_cast<uint32_t>(m.position.size());
        m.position.insert(m.position.end(), sheet.position.begin(), sheet.position.end());
        for (const uint32_t i : sheet.indices) m.indices.push_back(first + i);
    }
    meshes["fin"] = test::sheet(2, 2, [&](double u, double v) { return glm::dvec3(u, v, 0); });  // three at one edge
    meshes["fin"].position.emplace_back(0.5, 0.5, 1);
    meshes["fin"].indices.insert(meshes["fin"].indices.end(), {4, 3, 9, 4, 1, 9});
    meshes["tube"] = test::sheet(400, 3, [&](double u, double v) {  // thinner than a sample
        const double a = 6.283185307179586 * (v == 1 ? 0 : v);
        return glm::dvec3(u, 1e-4 * std::cos(a), 1e-4 * std::sin(a));
    });
    meshes["floor"] = test::torusMesh(60, 24);  // two large triangles beside many small ones
    for (const glm::dvec3& p : {glm::dvec3(-90, -90, -1), glm::dvec3(90, -90, -1), glm::dvec3(0, 90, -1)}) {
        meshes["floor"].indices.push_back(static_cast<uint32_t>(meshes["floor"].position.size()));
        meshes["floor"].position.push_back(p);
    }
    for (const auto& [name, mesh] : meshes) {
        SCOPED_TRACE(name);
        const Built built = build(mesh, folder / (name + ".stipple"), finely());
        if (built.bytes.empty()) continue;
        EXPECT_EQ(built.report.pointsIn, mesh.indices.size() / 3);
        expectAllIsThere(mesh, built.store);
    }
}

TEST(PatchStore, SaysWhatItLeavesOut) {
    const test::TempFolder folder;
    TriangleMesh mesh = test::torusMesh(30, 12);
    const size_t whole = mesh.indices.size() / 3;
    mesh.position.emplace_back(std::nan(""), 0, 0);
    const auto bad = static_cast<uint32_t>(mesh.position.size() - 1);
    mesh.indices.insert(mesh.indices.end(), {0, 1, bad, 5, 5, 6});
    mesh.indices.insert(mesh.indices.end(), mesh.indices.begin(), mesh.indices.begin() + 6);
    const Built built = build(mesh, folder / "a.stipple");
    EXPECT_EQ(built.report.dropped.at("triangles that are not finite"), 1u);
    EXPECT_EQ(built.report.dropped.at("degenerate triangles"), 1u);
    EXPECT_GE(built.report.dropped.at("duplicate triangles"), 2u);  // of them, or of what they are divided into
    EXPECT_EQ(built.report.pointsIn, whole + 4);
    uint64_t books = built.report.pointsIn;
    for (const auto& [reason, count] : built.report.added) books += count;
    for (const auto& [reason, count] : built.report.dropped) books -= count;
    EXPECT_EQ(books, built.report.pointsOut);

    TriangleMesh empty;
    empty.position = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    empty.indices = {0, 1, 2};
    const auto none = tryBuild(empty, folder / "b.stipple", finely(), 1);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().line().find("no triangle with an area"), std::string::npos) << none.error().line();
    EXPECT_FALSE(fs::exists(folder / "b.stipple"));
}

TEST(PatchStore, DamageIsFoundByMeasuring) {
    const test::TempFolder folder;
    Built built = build(wavyTorus(200, 80), folder / "a.stipple");
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
