// What meshes of small separate parts cover from afar: as much as in full detail, counted by a rasteriser of its own
// with many samples a pixel. Bodies must not grow by it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "apps/grow/plants.h"
#include "engine/scene/triangles.h"
#include "lod/builder/mesh/parts.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using StoreRef = std::shared_ptr<const lod::Store>;

StoreRef buildOf(const lod::MeshSource& source, const std::vector<shared::SurfaceMaterial>& materials,
                 const std::string& path, Executor& executor) {
    lod::MeshBuildSettings settings;
    settings.description.up = {0, 1, 0};
    settings.description.materials = materials;
    Progress progress(false);
    const auto built = lod::buildMeshStore(source, path, settings, executor, progress);
    if (!built) throw std::runtime_error(built.error().line());
    auto store = lod::openStore(path);
    if (!store) throw std::runtime_error(store.error().line());
    return std::make_shared<const lod::Store>(std::move(*store));
}

StoreRef treeStore(const std::string& species, const std::string& path, Executor& executor) {
    grow::PlantOptions options;
    options.species = species;
    options.leaves = 6000;
    options.asTriangles = true;
    const scene::Scene scene = grow::growPlant(options);
    return buildOf(scene::triangleSource(scene, scene::placements(scene)), scene::surfaceMaterials(scene), path,
                   executor);
}

glm::dvec3 randomDirection(Rng& rng) { return glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())); }

/// Strips that bend, seen from both sides, and bent tubes of five sides, from outside only; nothing touches anything.
lod::TriangleMesh leavesAndTwigs(int leaves, int twigs) {
    lod::TriangleMesh mesh;
    Rng rng(21);
    const auto add = [&](const glm::dvec3& p, uint32_t surface) {
        mesh.position.push_back(p);
        mesh.normal.emplace_back(0, 1, 0);
        mesh.surface.push_back(surface | shared::kSurfaceFlat);
    };
    for (int k = 0; k < leaves + twigs; ++k) {
        const bool isLeaf = k < leaves;
        const uint32_t sides = isLeaf ? 2 : 5, rings = isLeaf ? 5 : 8;
        glm::dvec3 at(rng.normal(), rng.normal(), rng.normal()), d = randomDirection(rng);
        const glm::dvec3 bend = randomDirection(rng);
        const double length = isLeaf ? 0.1 : 0.25, radius = (isLeaf ? 0.02 : 0.006) * rng.uniform(0.6, 1.4);
        const auto first = static_cast<uint32_t>(mesh.position.size());
        for (uint32_t r = 0; r < rings; ++r) {
            const glm::dvec3 x = glm::normalize(glm::cross(d, bend)), y = glm::cross(d, x);
            for (uint32_t s = 0; s < sides; ++s) {
                const double a = glm::two_pi<double>() * s / sides;
                const double wide = radius * (isLeaf ? 1.2 - std::abs(r - 2.0) / 2 : 1.0 - 0.08 * r);
                add(at + wide * (std::cos(a) * x + std::sin(a) * y), isLeaf ? shared::kSurfaceTwoSided : 0u);
            }
            at += length / (rings - 1) * d;
            d = glm::normalize(d + 0.15 * bend);
            for (uint32_t s = 0; r > 0 && s < (isLeaf ? 1 : sides); ++s) {
                const uint32_t a = first + (r - 1) * sides + s, b = first + (r - 1) * sides + (s + 1) % sides;
                mesh.indices.insert(mesh.indices.end(), {a, b, b + sides, a, b + sides, a + sides});
            }
        }
    }
    return mesh;
}

/// A closed smooth body like a figure: lathed, with a waist, and turned out of its axis.
lod::TriangleMesh figure(uint32_t rings) {
    lod::TriangleMesh mesh;
    const uint32_t sides = rings;
    for (uint32_t r = 0; r <= rings; ++r)
        for (uint32_t s = 0; s < sides; ++s) {
            const double u = glm::pi<double>() * r / rings, a = glm::two_pi<double>() * s / sides;
            const double wide = std::sin(u) * (0.5 + 0.15 * std::cos(4 * u) + 0.05 * std::cos(3 * a));
            mesh.position.emplace_back(wide * std::cos(a) + 0.1 * std::sin(2 * u), -std::cos(u), wide * std::sin(a));
            mesh.normal.emplace_back(0, 1, 0);
            mesh.surface.push_back(shared::kSurfaceFlat);
        }
    for (uint32_t r = 0; r < rings; ++r)
        for (uint32_t s = 0; s < sides; ++s) {
            const uint32_t a = r * sides + s, b = r * sides + (s + 1) % sides;
            mesh.indices.insert(mesh.indices.end(), {a, a + sides, b, b, a + sides, b + sides});
        }
    for (uint32_t s = 0; s < sides; ++s) {  // the poles are one point each
        mesh.position[s] = mesh.position[0];
        mesh.position[rings * sides + s] = mesh.position[rings * sides];
    }
    return mesh;
}

struct Side {
    test::Triangle corners;
    bool isTwoSided;
};

std::vector<Side> sidesOf(const lod::Store& store, const std::vector<lod::CutMeshDraw>& draws) {
    std::vector<Side> out;
    const lod::Hierarchy& h = store.hierarchy;
    for (const lod::CutMeshDraw& d : draws) {
        const auto chunk = lod::readChunk(store, d.node);
        EXPECT_TRUE(chunk);
        for (uint32_t c = d.firstCluster; c < d.firstCluster + d.clusters; ++c)
            for (uint32_t t = 0; t < chunk->clusters[c].counts >> 16; ++t) {
                Side side{};
                for (uint32_t k = 0; k < 3; ++k) {
                    const uint32_t corner = chunk->triangles[chunk->clusters[c].firstTriangle + t] >> (8 * k) & 255u;
                    const shared::MeshCluster& cluster = chunk->clusters[c];
                    const shared::MeshVertex& v = chunk->vertices[cluster.firstVertex + corner];
                    side.corners.at(k) = h.origin + h.unit * lod::vertexPlace(h.nodes[d.node], *chunk, cluster, corner);
                    side.isTwoSided = (v.surface & shared::kSurfaceTwoSided) != 0;
                }
                out.push_back(side);
            }
    }
    return out;
}

std::vector<lod::CutMeshDraw> cutAt(const lod::Store& store, const lod::View& view, double tau) {
    const lod::Hierarchy* h = &store.hierarchy;
    const lod::Instance instance;
    const std::vector<std::vector<uint8_t>> residency{std::vector<uint8_t>(h->chunks(), 1)};
    lod::CutScratch scratch;
    lod::Cut cut;
    lod::Budgets budgets;
    budgets.errorPixels = tau;
    selectCut({{&h, 1}, {&instance, 1}, {}}, {residency}, view, budgets, scratch, cut);
    return cut.meshDraw;
}

constexpr int kSamples = 8;  ///< an axis and pixel

/// Pixels that triangles cover, by rows of samples: where a row enters and leaves a triangle.
double coveredPixels(const std::vector<Side>& sides, const lod::View& view) {
    const auto width = static_cast<int>(view.width) * kSamples, height = static_cast<int>(view.height) * kSamples;
    std::vector<uint8_t> hit(static_cast<size_t>(width) * static_cast<size_t>(height), 0);
    for (const Side& side : sides) {
        std::array<glm::dvec2, 3> p{};
        for (size_t k = 0; k < 3; ++k) {
            const glm::dvec3 d = side.corners.at(k) - view.eye;
            const double scale = view.focalPixels * kSamples / glm::dot(d, view.forward);
            p.at(k) = {scale * glm::dot(d, view.right) + 0.5 * width, scale * glm::dot(d, view.down) + 0.5 * height};
        }
        const glm::dvec3 n = glm::cross(side.corners[1] - side.corners[0], side.corners[2] - side.corners[0]);
        if (!side.isTwoSided && glm::dot(n, side.corners[0] - view.eye) > 0) continue;
        const auto [top, bottom] = std::minmax({p[0].y, p[1].y, p[2].y});
        for (int row = std::max(0, static_cast<int>(std::ceil(top - 0.5))); row < height && row + 0.5 < bottom; ++row) {
            double from = 1e300, to = -1e300;
            for (size_t k = 0; k < 3; ++k) {
                const glm::dvec2 &a = p.at(k), &b = p.at((k + 1) % 3);
                if ((a.y <= row + 0.5) == (b.y <= row + 0.5)) continue;
                const double x = a.x + (row + 0.5 - a.y) / (b.y - a.y) * (b.x - a.x);
                from = std::min(from, x);
                to = std::max(to, x);
            }
            for (int x = std::max(0, static_cast<int>(std::ceil(from - 0.5))); x < width && x + 0.5 < to; ++x)
                hit[static_cast<size_t>(row) * static_cast<size_t>(width) + static_cast<size_t>(x)] = 1;
        }
    }
    return static_cast<double>(std::count(hit.begin(), hit.end(), 1)) / (kSamples * kSamples);
}

double areaOf(const std::vector<Side>& sides) {
    double sum = 0;
    for (const Side& s : sides)
        sum += 0.5 * glm::length(glm::cross(s.corners[1] - s.corners[0], s.corners[2] - s.corners[0]));
    return sum;
}

constexpr uint32_t kPixels = 240;

/// At all error targets of a picture; returns how many of all triangles the coarsest draws.
double expectSameCover(const lod::Store& store, const std::string& what, const lod::View* from = nullptr) {
    const lod::View view = from != nullptr ? *from : test::fitView(store, kPixels, kPixels);
    const auto full = sidesOf(store, cutAt(store, view, 1e-6));
    const double wanted = coveredPixels(full, view);
    EXPECT_GT(wanted, 500);
    double left = 1;
    for (const double tau : {1.0, 2.0, 4.0, 8.0}) {
        const auto drawn = sidesOf(store, cutAt(store, view, tau));
        left = static_cast<double>(drawn.size()) / static_cast<double>(full.size());
        const double covered = coveredPixels(drawn, view);
        EXPECT_NEAR(covered / wanted, 1, 0.02) << what << ", " << tau << " px, " << drawn.size() << " triangles";
        printf("[ measured ] %s, %g px: %+.2f %% of the cover, %zu of %zu triangles\n", what.c_str(), tau,
               100 * (covered / wanted - 1), drawn.size(), full.size());
    }
    return left;
}

TEST(MeshArea, ATreeCoversAsMuchFromAfarAsInFullDetail) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    // And with fewer triangles than where borders of leaves were kept (oak 0.37, spruce 0.31 of them at 8 px).
    EXPECT_LT(expectSameCover(*treeStore("oak", folder / "oak.stipple", *executor), "oak"), 0.3);
    EXPECT_LT(expectSameCover(*treeStore("spruce", folder / "spruce.stipple", *executor), "spruce"), 0.2);
}

TEST(MeshArea, LeavesAndTwigsThatTouchNothingKeepTheirCover) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto coverOf = [&](int leaves, int twigs, const char* what) {
        const lod::MeshSource source = lod::sourceOf(leavesAndTwigs(leaves, twigs));
        return expectSameCover(*buildOf(source, {shared::SurfaceMaterial{}}, folder / "a.stipple", *executor), what);
    };
    EXPECT_LT(coverOf(4000, 0, "leaves"), 0.3);
    EXPECT_LT(coverOf(0, 1500, "twigs"), 0.1);
    EXPECT_LT(coverOf(4000, 1500, "leaves and twigs"), 0.2);
}

/// With one triangle so far out that coordinates take more than 30 bits (a wide lattice).
TEST(MeshArea, OneFarOutlierLeavesPartsToBeSimplified) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const lod::TriangleMesh dense = leavesAndTwigs(4000, 1500);
    const auto alone = buildOf(lod::sourceOf(dense), {shared::SurfaceMaterial{}}, folder / "alone.stipple", *executor);
    const lod::View view = test::fitView(*alone, kPixels, kPixels);
    const double left = expectSameCover(*alone, "alone", &view);
    EXPECT_LT(left, 0.2);
    for (const glm::dvec3& far : {glm::dvec3(1e5, 0, 0), glm::dvec3(-1e9, 2e8, 0), glm::dvec3(0, -1e3, 1e12)}) {
        lod::TriangleMesh mesh = dense;
        const auto first = static_cast<uint32_t>(mesh.position.size());
        for (const glm::dvec3& off : {glm::dvec3(0), glm::dvec3(0, 0.1, 0), glm::dvec3(0, 0, 0.1)}) {
            mesh.position.push_back(far + 1e-3 * glm::length(far) * off);
            mesh.normal.emplace_back(0, 1, 0);
            mesh.surface.push_back(shared::kSurfaceFlat);
        }
        mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 2});
        const auto what = fmt::format("outlier at {} {}", far.x, far.z);
        const auto store = buildOf(lod::sourceOf(mesh), {shared::SurfaceMaterial{}}, folder / "far.stipple", *executor);
        ASSERT_GT(store->hierarchy.rootLog2, lod::kShortMeshBits) << what;
        EXPECT_LT(expectSameCover(*store, what, &view), 1.1 * left) << what;
        EXPECT_TRUE(lod::verifyStore(*store, *executor, 0)) << what;
        // What is coarsest stays within its error of the input.
        const lod::Hierarchy& h = store->hierarchy;
        uint32_t code = 0;
        for (const lod::Node& n : h.nodes)
            if (n.errorCode < lod::ErrorScale::kNoParent) code = std::max<uint32_t>(code, n.errorCode);
        const auto leaves = test::leafTriangles(*store), drawn = test::drawnTriangles(*store, test::evenCut(h, code));
        const double bound = h.errors.decode(code) * h.unit;
        EXPECT_LE(bound, 1) << what;
        EXPECT_LE(test::largestDistance(leaves, drawn, 200, 7), bound) << what;
        EXPECT_LE(test::largestDistance(drawn, leaves, 200, 8), bound) << what;
    }
}

TEST(MeshArea, MovedVerticesStayWithinTheStatedErrorBothWays) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto store = buildOf(lod::sourceOf(leavesAndTwigs(4000, 1500)), {shared::SurfaceMaterial{}},
                               folder / "a.stipple", *executor);
    const lod::Hierarchy& h = store->hierarchy;
    const auto leaves = test::leafTriangles(*store);
    ASSERT_EQ(leaves.size(), store->description.points);
    std::vector<uint32_t> codes;
    for (const lod::Node& n : h.nodes)
        if (n.errorCode < lod::ErrorScale::kNoParent) codes.push_back(n.errorCode);
    std::sort(codes.begin(), codes.end());
    for (const double share : {0.1, 0.5, 0.8, 1.0}) {
        const uint32_t code = codes[static_cast<size_t>(share * static_cast<double>(codes.size() - 1))];
        const auto drawn = test::drawnTriangles(*store, test::evenCut(h, code));
        const double bound = h.errors.decode(code) * h.unit;
        EXPECT_LE(test::largestDistance(leaves, drawn, 20'000, 7), bound) << share;
        EXPECT_LE(test::largestDistance(drawn, leaves, 20'000, 8), bound) << share;
    }
}

/// A few vertices far out: at 10 to 64 times what most span the lattice has more bits than fp32 (mesh/lattice.cpp).
TEST(MeshArea, LeavesFarOutAreBuiltOnAllSides) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const lod::TriangleMesh dense = leavesAndTwigs(800, 200);
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : dense.position) {
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    const double extent = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
    const std::vector<glm::dvec3> sides{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0},
                                        {0, 0, 1}, {0, 0, -1}, {1, 1, 1}, {-1, -1.01, -0.97}};
    for (const double far : {10.0, 15.2, 23.0, 41.7, 64.0})
        for (const glm::dvec3& side : sides) {
            const auto what = fmt::format("{} times as far on side {} {} {}", far, side.x, side.y, side.z);
            lod::TriangleMesh mesh = dense;
            const lod::TriangleMesh stray = leavesAndTwigs(1, 0);
            const auto first = static_cast<uint32_t>(mesh.position.size());
            for (const glm::dvec3& p : stray.position) mesh.position.push_back(p + far * extent * side);
            mesh.normal.insert(mesh.normal.end(), stray.normal.begin(), stray.normal.end());
            mesh.surface.insert(mesh.surface.end(), stray.surface.begin(), stray.surface.end());
            for (const uint32_t i : stray.indices) mesh.indices.push_back(first + i);
            StoreRef store;
            EXPECT_NO_THROW(
                store = buildOf(lod::sourceOf(mesh), {shared::SurfaceMaterial{}}, folder / "a.stipple", *executor))
                << what;
            if (!store) continue;
            EXPECT_TRUE(lod::verifyStore(*store, *executor, 0)) << what;
            // What is coarsest stays within its error of the input, the stray too.
            const lod::Hierarchy& h = store->hierarchy;
            uint32_t code = 0;
            for (const lod::Node& n : h.nodes)
                if (n.errorCode < lod::ErrorScale::kNoParent) code = std::max<uint32_t>(code, n.errorCode);
            const auto leaves = test::leafTriangles(*store),
                       drawn = test::drawnTriangles(*store, test::evenCut(h, code));
            EXPECT_LT(drawn.size(), leaves.size() / 2) << what;
            const double bound = h.errors.decode(code) * h.unit;
            EXPECT_LE(bound, 0.1 * extent) << what;
            EXPECT_LE(test::largestDistance(leaves, drawn, 400, 7), bound) << what;
            EXPECT_LE(test::largestDistance(drawn, leaves, 400, 8), bound) << what;
        }
}

TEST(MeshArea, PlacesOfMovedVerticesStayOnTheLattice) {
    constexpr int kLargest = (1 << 30) - 1;
    const lod::Steps from(0, kLargest, 5);
    EXPECT_EQ(lod::movedPlace(from, {0, 0, 0}, 0, kLargest), glm::ivec3(0, kLargest, 5));
    EXPECT_EQ(lod::movedPlace(from, {-31, 32, -5.4}, 0, kLargest), glm::ivec3(0, kLargest, 0));
    EXPECT_EQ(lod::movedPlace(from, {31.6, -32.4, 2.5}, 0, kLargest), glm::ivec3(32, kLargest - 32, 8));
    // Farther than integers of 32 bits reach.
    EXPECT_EQ(lod::movedPlace(from, {3e9, -3e9, 5e18}, 0, kLargest), glm::ivec3(kLargest, 0, kLargest));
    EXPECT_EQ(lod::movedPlace(from, {-1e30, 1e30, 1e300}, 0, kLargest), glm::ivec3(0, kLargest, kLargest));
}

TEST(MeshArea, AnInputThatChangesBetweenItsReadingsIsRefused) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    // Its first block grows from the second reading on; another has one more, or one less, block.
    enum class Change { more, fewer, anotherBlock };
    for (const Change change : {Change::more, Change::fewer, Change::anotherBlock}) {
        const lod::TriangleMesh mesh = leavesAndTwigs(200, 0), larger = leavesAndTwigs(30'000, 0);
        lod::MeshSource source = lod::sourceOf(larger);
        int readings = 0;
        source.read = [&](const lod::MeshSource::Take& take) -> Result<void> {
            const bool isFirst = readings++ == 0;
            STIPPLE_TRY(take((change == Change::more) != isFirst ? larger : mesh));
            if (!isFirst && change == Change::anotherBlock) STIPPLE_TRY(take(mesh));
            return {};
        };
        lod::MeshBuildSettings settings;
        settings.description.materials = {shared::SurfaceMaterial{}};
        Progress progress(false);
        const auto built = lod::buildMeshStore(source, folder / "a.stipple", settings, *executor, progress);
        ASSERT_FALSE(built) << static_cast<int>(change);
        EXPECT_EQ(built.error().kind, ErrorKind::input);
        EXPECT_NE(built.error().line().find("changed"), std::string::npos) << built.error().line();
    }
}

/// Triangles that share nothing.
lod::TriangleMesh separateTriangles(uint32_t count) {
    lod::TriangleMesh mesh;
    Rng rng(5);
    for (uint32_t t = 0; t < count; ++t) {
        const glm::dvec3 at(rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(0, 1));
        mesh.position.insert(mesh.position.end(), {at, at + glm::dvec3(0.004, 0, 0), at + glm::dvec3(0, 0.004, 0.001)});
        mesh.indices.insert(mesh.indices.end(), {3 * t, 3 * t + 1, 3 * t + 2});
    }
    return mesh;
}

TEST(MeshArea, MemoryThatLookingForPartsTakesIsSaid) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    lod::MeshBuildSettings settings;
    settings.limits.memoryBytes = uint64_t{185} << 20;  // (96 MiB and 115 for the parts; 180 for the work after that)
    Progress progress(false);
    const auto built = lod::buildMeshStore(lod::sourceOf(separateTriangles(1'200'000)), folder / "a.stipple", settings,
                                           *executor, progress);
    ASSERT_FALSE(built);
    EXPECT_EQ(built.error().kind, ErrorKind::budget);
    EXPECT_NE(built.error().hint.find("--memory"), std::string::npos);
}

/// A PLY file has twice as many triangles as faces before it is read.
TEST(MeshArea, PartsAreFoundByHowManyTrianglesThereAreNotByHowManyAreDeclared) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    lod::MeshSource source = lod::sourceOf(leavesAndTwigs(800, 0));
    buildOf(source, {shared::SurfaceMaterial{}}, folder / "exact.stipple", *executor);
    source.triangles = 3'000'000;
    buildOf(source, {shared::SurfaceMaterial{}}, folder / "declared.stipple", *executor);
    EXPECT_TRUE(test::slurp(folder / "exact.stipple") == test::slurp(folder / "declared.stipple"));
}

TEST(MeshArea, BodiesDoNotGrow) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    // One that is small enough to be taken for a leaf, and one that is not.
    for (const uint32_t rings : {30u, 160u}) {
        const auto store =
            buildOf(lod::sourceOf(figure(rings)), {shared::SurfaceMaterial{}}, folder / "a.stipple", *executor);
        const lod::View view = test::fitView(*store, kPixels, kPixels);
        const auto full = sidesOf(*store, cutAt(*store, view, 1e-6));
        const double area = areaOf(full), covered = coveredPixels(full, view);
        size_t fewest = full.size();
        for (const double tau : {0.25, 0.5, 1.0, 2.0}) {
            const auto drawn = sidesOf(*store, cutAt(*store, view, tau));
            fewest = std::min(fewest, drawn.size());
            const double grown = areaOf(drawn) / area - 1, wider = coveredPixels(drawn, view) / covered - 1;
            printf("[ measured ] figure of %zu triangles, %g px: area %+.2f %%, silhouette %+.2f %%, %zu triangles\n",
                   full.size(), tau, 100 * grown, 100 * wider, drawn.size());
            EXPECT_LE(grown, 0.005) << rings << ", " << tau;
            EXPECT_LE(wider, 0.005) << rings << ", " << tau;
            EXPECT_GE(wider, tau > 1 ? -0.02 : -0.005) << rings << ", " << tau;
        }
        EXPECT_LE(fewest, full.size() / 2);
    }
}

TEST(MeshArea, IsTheSameForAnyNumberOfThreadsAndAnyOrder) {
    const test::TempFolder folder;
    const lod::TriangleMesh mesh = leavesAndTwigs(3000, 600);
    lod::TriangleMesh turned = mesh;
    const size_t triangles = mesh.indices.size() / 3;
    for (size_t t = 0; t < triangles; ++t)
        std::copy_n(mesh.indices.begin() + static_cast<ptrdiff_t>(3 * (triangles - 1 - t)), 3,
                    turned.indices.begin() + static_cast<ptrdiff_t>(3 * t));
    const auto bytes = [&](const lod::TriangleMesh& of, int threads) {
        const auto executor = makeTbbExecutor(threads);
        buildOf(lod::sourceOf(of), {shared::SurfaceMaterial{}}, folder / "a.stipple", *executor);
        return test::slurp(folder / "a.stipple");
    };
    const auto one = bytes(mesh, 1);
    EXPECT_EQ(one, bytes(mesh, 2));
    EXPECT_EQ(one, bytes(mesh, 4));
    EXPECT_EQ(one, bytes(turned, 2));
}

}  // namespace
}  // namespace stipple
