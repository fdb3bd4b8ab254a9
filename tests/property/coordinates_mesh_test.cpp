// Meshes and curves of which something lies far away, against the places that the input names and against pictures of
// the same scene without it. Stored places are decoded here from the bytes of the chunks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "engine/base/progress.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "lod/store/chunk.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple::lod {
namespace {

/// A tenth of a pixel, where an object of radius 1 fills a picture 1,000 pixels high.
constexpr double kTenthOfAPixel = 0.1 * 2 / 1000;

std::shared_ptr<const Store> opened(const std::string& path) {
    auto store = openStore(path);
    if (!store) throw std::runtime_error(store.error().line());
    return std::make_shared<const Store>(std::move(*store));
}

/// A bumpy ball of triangles, radius 1, whose corners lie on no lattice.
void addBall(uint32_t rings, const glm::dvec3& centre, TriangleMesh& mesh) {
    const uint32_t around = 2 * rings, first = static_cast<uint32_t>(mesh.position.size());
    for (uint32_t i = 0; i <= rings; ++i)
        for (uint32_t k = 0; k < around; ++k) {
            const double a = M_PI * (0.02 + 0.96 * i / rings), b = 2 * M_PI * k / around;
            const double radius = 0.9 + 0.1 * std::sin(5 * a) * std::cos(4 * b);
            mesh.position.push_back(
                centre + radius * glm::dvec3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
        }
    for (uint32_t i = 0; i < rings; ++i)
        for (uint32_t k = 0; k < around; ++k) {
            const uint32_t p = first + i * around + k, q = first + i * around + (k + 1) % around;
            for (const uint32_t v : {p, p + around, q, q, p + around, q + around}) mesh.indices.push_back(v);
        }
}

std::shared_ptr<const Store> builtMesh(const TriangleMesh& mesh, const std::string& path, Executor& executor) {
    Progress silent(false);
    const auto built = buildMeshStore(sourceOf(mesh), path, {}, executor, silent);
    if (!built) throw std::runtime_error(built.error().line());
    EXPECT_EQ(built->pointsOut, mesh.indices.size() / 3);
    return opened(path);
}

/// Corners of the input's own triangles, decoded by hand: int32 from the group's origin, or 64 bits in two vertices.
std::vector<glm::dvec3> cornersOf(const Store& store) {
    std::vector<glm::dvec3> out;
    const Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        const Chunk chunk = *readChunk(store, n);
        const bool isPaired = h.nodes[n].stepShift == 1;
        for (uint32_t r = 0; r < h.groups[n].runs; ++r) {
            const MeshRun& run = h.runs[h.groups[n].firstRun + r];
            if (run.producer != MeshRun::kOriginal) continue;
            for (uint32_t c = run.firstCluster; c < run.firstCluster + run.clusters; ++c) {
                const shared::MeshCluster& cluster = chunk.clusters[c];
                const uint32_t slots = cluster.counts & 0xffffu, count = isPaired ? slots / 2 : slots;
                for (uint32_t i = 0; i < count; ++i) {
                    const shared::MeshVertex& v = chunk.vertices[cluster.firstVertex + i];
                    glm::dvec3 steps(v.x, v.y, v.z);
                    if (isPaired) {
                        const shared::MeshVertex& u = chunk.vertices[cluster.firstVertex + count + i];
                        steps = glm::dvec3(u.x, u.y, u.z) * 0x1p32 +
                                glm::dvec3(uint32_t(v.x), uint32_t(v.y), uint32_t(v.z));
                    }
                    for (size_t a = 0; a < 3; ++a)
                        steps[static_cast<int>(a)] += 0x1p30 * static_cast<int32_t>(uint32_t(h.nodes[n].cell.at(a)));
                    out.push_back(h.origin + h.unit * steps);
                }
            }
        }
    }
    return out;
}

/// Largest distance of a place of `truth` from the nearest of `found`; `reach`: more than any should be.
double farthest(const std::vector<glm::dvec3>& truth, std::vector<glm::dvec3> found, double reach) {
    std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.x < b.x; });
    double worst = 0;
    for (const glm::dvec3& p : truth) {
        double nearest = reach;
        auto at = std::lower_bound(found.begin(), found.end(), p.x - reach,
                                   [](const glm::dvec3& q, double x) { return q.x < x; });
        for (; at != found.end() && at->x <= p.x + reach; ++at) nearest = std::min(nearest, glm::length(p - *at));
        worst = std::max(worst, nearest);
    }
    return worst;
}

/// Pictures of full detail: what levels of detail choose is not what is looked at here.
render::Image pictureOf(const std::shared_ptr<const Store>& store, Executor& executor, const View& view) {
    const auto backend = cpu::makeCpuBackend(executor);
    render::FrameSettings settings;
    settings.budgets.errorPixels = 0.1;
    settings.draw.exactCurves = 0;
    return test::renderView(store, *backend, executor, view, settings);
}

/// Far to a side that no picture shows, and behind the eye.
std::vector<glm::dvec3> farPlaces() {
    std::vector<glm::dvec3> out;
    for (const double far : {1e7, 1e9, 1e12})
        for (const glm::dvec3& way : {glm::dvec3(0, 0, 1), glm::dvec3(-1, 0.25, 0), glm::dvec3(0, 1, 0)})
            out.push_back(far * way);
    return out;
}

TEST(CoordinatesOfMeshes, ATriangleFarAwayChangesNothing) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const glm::dvec3 centre(4.3, -2.7, 1.1);
    TriangleMesh alone;
    addBall(96, centre, alone);
    const render::Image without =
        pictureOf(builtMesh(alone, folder / "alone", *executor), *executor, test::viewFromAbove(centre));
    for (const glm::dvec3& far : farPlaces()) {
        TriangleMesh mesh = alone;
        for (const glm::dvec3& off : {glm::dvec3(0), glm::dvec3(0.3, 0, 0) * glm::length(far) * 1e-3,
                                      glm::dvec3(0, 0.3, 0.1) * glm::length(far) * 1e-3}) {
            mesh.indices.push_back(static_cast<uint32_t>(mesh.position.size()));
            mesh.position.push_back(far + off);
        }
        const auto store = builtMesh(mesh, folder / "far", *executor);
        EXPECT_LE(farthest(alone.position, cornersOf(*store), 0.05), kTenthOfAPixel / 100) << far.x << " " << far.z;
        EXPECT_GE(test::drawnPsnr(pictureOf(store, *executor, test::viewFromAbove(centre)), without), 50)
            << far.x << " " << far.z;
        // One double at 1e12 has a step of 1e-4: what info says holds for the triangle far away, too.
        std::vector<glm::dvec3> stray(mesh.position.end() - 3, mesh.position.end());
        EXPECT_LE(farthest(stray, cornersOf(*store), 1),
                  std::sqrt(3.0) * store->description.roundingUnits + glm::length(far) * 0x1p-52);
        EXPECT_LE(store->description.roundingUnits, kTenthOfAPixel / 100);
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far.x << " " << far.z;
        const glm::dvec3 focus = store->description.focusMax - store->description.focusMin;
        EXPECT_LE(std::max({focus.x, focus.y, focus.z}), 2.1) << "what a camera looks at first";
    }
}

TEST(CoordinatesOfMeshes, AVertexFarAwayLeavesTheOtherTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    TriangleMesh alone;
    addBall(96, glm::dvec3(0), alone);
    // A vertex of the side that is turned away: without its six triangles there is a hole, not to be seen.
    const uint32_t moved = 90 * 192 + 7;
    TriangleMesh open = alone;
    open.indices.clear();
    for (size_t i = 0; i < alone.indices.size(); i += 3)
        if (std::find(&alone.indices[i], &alone.indices[i] + 3, moved) == &alone.indices[i] + 3)
            open.indices.insert(open.indices.end(), &alone.indices[i], &alone.indices[i] + 3);
    const render::Image without =
        pictureOf(builtMesh(open, folder / "open", *executor), *executor, test::viewFromAbove(glm::dvec3(0)));
    std::vector<glm::dvec3> others = alone.position;
    others.erase(others.begin() + moved);
    for (const double far : {1e7, 1e9, 1e12}) {
        TriangleMesh mesh = alone;
        mesh.position[moved] = glm::dvec3(0.1 * far, 0, -far);  // behind the ball
        const auto store = builtMesh(mesh, folder / "far", *executor);
        EXPECT_LE(farthest(others, cornersOf(*store), 0.05), kTenthOfAPixel / 100) << far;
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far;
        // Six triangles as long as that reach behind the ball past its outline; what they cover is not compared.
        const render::Image with = pictureOf(store, *executor, test::viewFromAbove(glm::dvec3(0)));
        render::Image within = with, expected = without;
        for (size_t i = 0; i < with.rgba.size(); ++i)
            if (without.rgba[i] >> 24 == 0) within.rgba[i] = expected.rgba[i] = 0;
        EXPECT_GE(test::drawnPsnr(within, expected), 50) << far;
    }
}

TEST(CoordinatesOfMeshes, ATriangleThatWouldRuinTheOthersIsLeftOutAndCounted) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    TriangleMesh alone;
    addBall(96, glm::dvec3(4.3, -2.7, 1.1), alone);
    for (const double far : {1e30, 1e160, 1e308}) {
        TriangleMesh mesh = alone;
        mesh.indices.insert(mesh.indices.end(), {0u, 1u, static_cast<uint32_t>(mesh.position.size())});
        mesh.position.emplace_back(far, 0, -far);
        Progress silent(false);
        const auto built = buildMeshStore(sourceOf(mesh), folder / "far", {}, *executor, silent);
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_EQ(built->pointsOut, alone.indices.size() / 3) << far;
        EXPECT_EQ(built->dropped,
                  (std::map<std::string, uint64_t>{{"triangles that reach too far out for the others' places", 1}}));
        const auto store = opened(folder / "far");
        EXPECT_LE(farthest(alone.position, cornersOf(*store), 0.05), kTenthOfAPixel / 100) << far;
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far;
    }
}

TEST(CoordinatesOfMeshes, ObjectsFarApartAreDrawnWhereTheyAre) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const double extent : {1e5, 1e9}) {
        Rng rng(7);
        TriangleMesh mesh, last;
        std::vector<glm::dvec3> places{glm::dvec3(0), glm::dvec3(extent, extent, 0.1 * extent)};
        while (places.size() < 40)
            places.emplace_back(extent * rng.uniform(), extent * rng.uniform(), 0.1 * extent * rng.uniform());
        for (const glm::dvec3& place : places) addBall(24, place, mesh);
        const auto store = builtMesh(mesh, folder / "m", *executor);
        const double ofDoubles = 2 * extent * 0x1p-53;
        EXPECT_LE(farthest(mesh.position, cornersOf(*store), 0.05), kTenthOfAPixel / 2 + ofDoubles) << extent;
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << extent;
        // The farthest one as if it stood alone.
        addBall(24, places[1], last);
        const render::Image with = pictureOf(store, *executor, test::viewFromAbove(places[1]));
        EXPECT_GE(test::drawnPsnr(with, pictureOf(builtMesh(last, folder / "l", *executor), *executor,
                                                  test::viewFromAbove(places[1]))),
                  extent < 1e6 ? 50 : 45)
            << extent;
    }
}

TEST(CoordinatesOfMeshes, FacesWithoutAreaFarFromTheOthersLeaveWhatIsLookedAt) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    const glm::dvec3 centre(1000, -1000, 0.5);
    for (const glm::dvec3& off : {glm::dvec3(0), glm::dvec3(0, 0, 1e9)}) {
        TriangleMesh mesh;
        addBall(2, centre, mesh);
        const size_t real = mesh.indices.size() / 3;
        // Most vertices are corners of faces that no store keeps.
        Rng rng(3);
        for (int k = 0; k < 2000; ++k) {
            const glm::dvec3 p = off + glm::dvec3(rng.uniform(), rng.uniform(), rng.uniform());
            for (const double y : {0.0, 0.0, 0.5}) {
                mesh.indices.push_back(static_cast<uint32_t>(mesh.position.size()));
                mesh.position.push_back(p + glm::dvec3(0, y, 0));
            }
        }
        Progress silent(false);
        const auto built = buildMeshStore(sourceOf(mesh), folder / "m", {}, *executor, silent);
        ASSERT_TRUE(built) << built.error().line();
        EXPECT_EQ(built->pointsOut, real);
        const auto store = opened(folder / "m");
        EXPECT_TRUE(verifyStore(*store, *executor, 0));
        const StoreDescription& d = store->description;
        for (int a = 0; a < 3; ++a) {
            EXPECT_NEAR(d.focusMin[a], centre[a], 1.1);
            EXPECT_NEAR(d.focusMax[a], centre[a], 1.1);
            EXPECT_LT(d.focusMin[a], d.focusMax[a]);
        }
    }
}

TEST(CoordinatesOfMeshes, WideStoresAreTheSameBytesForAnyThreadsAndOrder) {
    const test::TempFolder folder;
    TriangleMesh mesh;
    addBall(60, glm::dvec3(0), mesh);
    mesh.position.front() = glm::dvec3(1e11, 0, 0);
    std::string first;
    for (const auto& [threads, isTurned] : {std::pair{1, false}, {7, false}, {3, true}}) {
        const auto executor = makeTbbExecutor(threads);
        TriangleMesh in = mesh;
        if (isTurned) {
            in.indices.clear();
            for (size_t i = mesh.indices.size(); i > 0; i -= 3)
                in.indices.insert(in.indices.end(), mesh.indices.begin() + static_cast<ptrdiff_t>(i - 3),
                                  mesh.indices.begin() + static_cast<ptrdiff_t>(i));
        }
        builtMesh(in, folder / "m", *executor);
        if (first.empty()) first = test::slurp(folder / "m");
        EXPECT_TRUE(first == test::slurp(folder / "m")) << threads;
    }
}

TEST(CoordinatesOfMeshes, GltfKeepsTheDigitsOfMapCoordinates) {
    const test::TempFolder folder;
    const glm::dvec3 centre(431'234.567, 5'321'987.125, 512.375);
    TriangleMesh truth;
    addBall(24, centre, truth);
    {
        std::ofstream out(folder / "a.obj");
        out.precision(17);
        for (const glm::dvec3& p : truth.position) out << "v " << p.x << ' ' << p.y << ' ' << p.z << '\n';
        for (size_t i = 0; i < truth.indices.size(); i += 3)
            out << "f " << truth.indices[i] + 1 << ' ' << truth.indices[i + 1] + 1 << ' ' << truth.indices[i + 2] + 1
                << '\n';
    }
    const auto scene = scene::readObj(folder / "a.obj");
    ASSERT_TRUE(scene) << scene.error().line();
    for (const char* name : {"b.glb", "b.gltf"}) {
        ASSERT_TRUE(scene::writeGltf(*scene, folder / name));
        const auto back = scene::readGltf(folder / name);
        ASSERT_TRUE(back) << back.error().line();
        std::vector<glm::dvec3> found;
        const auto worlds = back->worldTransforms();
        for (size_t n = 0; n < back->nodes.size(); ++n) {
            if (back->nodes[n].mesh < 0) continue;
            for (const auto& p : back->meshes[static_cast<size_t>(back->nodes[n].mesh)].primitives)
                for (size_t i = 0; i < p.position.size(); ++i) found.emplace_back(worlds[n] * glm::dvec4(p.at(i), 1));
        }
        constexpr double kSpacing = 0.1;
        EXPECT_LE(farthest(truth.position, found, 0.5), 1e-3 * kSpacing) << name;
        // What programs make of it that read triangles, too.
        const TriangleMesh read = test::collect(scene::triangleSource(*back, scene::placements(*back)));
        EXPECT_EQ(read.indices.size(), truth.indices.size());
        EXPECT_LE(farthest(truth.position, read.position, 0.5), 1e-3 * kSpacing) << name;
    }
}

/// Ends of leaf segments.
std::vector<glm::dvec3> endsOf(const Store& store) {
    const Hierarchy& h = store.hierarchy;
    std::vector<glm::dvec3> ends;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        const Node& node = h.nodes[n];
        if (!node.isLeaf()) continue;
        const Chunk chunk = *readChunk(store, n);
        const double cell = std::ldexp(1.0, static_cast<int>(h.rootLog2) - node.level);
        for (const shared::CurveSegment& s : chunk.segments)
            for (const shared::CurveVertex& v : {s.a, s.b}) {
                const glm::dvec3 at(v.positionXY & 0xffffu, v.positionXY >> 16, v.positionZ & 0xffffu);
                const glm::dvec3 corner(node.cell[0], node.cell[1], node.cell[2]);
                ends.push_back(h.origin + h.unit * (cell * (corner - 0.5) + cell / 32768 * at));
            }
    }
    return ends;
}

TEST(CoordinatesOfCurves, ACurveFarAwayChangesNothing) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const float radius : {0.01f, 0.06f}) {
        const CurveSet alone = test::curls({.count = 60, .vertices = 40, .radius = radius});
        const View view = test::viewFromAbove(glm::dvec3(0, 0, 1));
        const render::Image without =
            pictureOf(test::buildCurves(alone, folder / "alone", *executor, 8192), *executor, view);
        const auto withOne = [&](const glm::dvec3& place) {
            CurveSet set = alone;
            for (const double y : {0.0, 1.0}) set.addVertex(place + glm::dvec3(0, y, 0), 0.01f, glm::vec3(0), 0);
            set.endCurve(false);
            return test::buildCurves(set, folder / "far", *executor, 8192);
        };
        // Any other curve, too, lets the cells lie elsewhere, and with them the steps of a 30,000th of a cell: at
        // outlines, which are not smoothed, a pixel turns here and there, and thin curves cover others stochastically.
        double usual = 99;
        for (const glm::dvec3& near : {glm::dvec3(0.3, 0.1, 4.5), glm::dvec3(0, -0.4, 5), glm::dvec3(0.2, 0, 6)})
            usual = std::min(usual, test::drawnPsnr(pictureOf(withOne(near), *executor, view), without));
        for (const glm::dvec3& far : farPlaces()) {
            const auto store = withOne(far);
            EXPECT_LE(farthest(alone.position, endsOf(*store), 0.05), kTenthOfAPixel) << far.x << " " << far.z;
            EXPECT_GE(test::drawnPsnr(pictureOf(store, *executor, view), without), usual - 1.5)
                << far.x << " " << far.z;
            EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far.x << " " << far.z;
            const glm::dvec3 focus = store->description.focusMax - store->description.focusMin;
            EXPECT_LE(std::max({focus.x, focus.y, focus.z}), 3) << "what a camera looks at first";
        }
    }
}

TEST(CoordinatesOfCurves, ObjectsFarApartAreDrawnWhereTheyAre) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const double extent : {1e5, 1e9}) {
        Rng rng(7);
        const CurveSet one = test::curls({.count = 20, .vertices = 30});
        CurveSet set;
        for (int k = 0; k < 40; ++k) {
            const glm::dvec3 place(extent * rng.uniform(), extent * rng.uniform(), 0.1 * extent * rng.uniform());
            for (size_t s = 0; s < one.curves(); ++s) {
                for (uint32_t i = one.first[s]; i < one.first[s + 1]; ++i)
                    set.addVertex(place + one.position[i], one.radius[i], one.normal[i], one.colour[i]);
                set.endCurve(one.isRibbon[s] != 0);
            }
        }
        const auto store = test::buildCurves(set, folder / "s", *executor, 8192);
        const double ofDoubles = 4 * extent * 0x1p-53;
        EXPECT_LE(farthest(set.position, endsOf(*store), 0.05), kTenthOfAPixel + ofDoubles) << extent;
        EXPECT_TRUE(verifyStore(*store, *executor, 0)) << extent;
    }
}

TEST(CoordinatesOfCurves, OneThatReachesFarAwayLeavesTheOthersWhereTheyAre) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const CurveSet alone = test::curls({.count = 60, .vertices = 40, .radius = 0.01f});
    for (const glm::dvec3& far : farPlaces()) {
        // From among the others; through them, from far to far.
        for (const glm::dvec3& from : {glm::dvec3(0.3, 0.1, 0.2), -far}) {
            CurveSet set = alone;
            set.addVertex(from, 0.01f, glm::vec3(0), 0);
            set.addVertex(far, 0.01f, glm::vec3(0), 0);
            set.endCurve(false);
            const auto store = test::buildCurves(set, folder / "far", *executor, 8192);
            const std::vector<glm::dvec3> ends = endsOf(*store);
            const double ofDoubles = glm::length(far - from) * 0x1p-52;
            EXPECT_LE(farthest(alone.position, ends, 0.05), kTenthOfAPixel + ofDoubles) << far.x << " " << far.z;
            // Its own vertices as near as `info` says.
            const double said = store->description.roundingUnits;
            EXPECT_LE(said, 0.01 + ofDoubles);
            for (const glm::dvec3& p : {from, far}) {
                double nearest = 1e300;
                for (const glm::dvec3& q : ends) nearest = std::min(nearest, glm::length(p - q));
                EXPECT_LE(nearest, said + ofDoubles) << far.x << " " << far.z;
            }
            // Between them it is as straight as the count of added pieces says.
            double bend = 0;
            for (const glm::dvec3& p : ends) {
                const double way = std::min({glm::length(p - from), glm::length(p - far), glm::length(p)});
                if (glm::length(p) < 4) continue;  // among the others
                const glm::dvec3 d = glm::normalize(far - from), off = p - from - glm::dot(p - from, d) * d;
                bend = std::max(bend, (glm::length(off) - said - ofDoubles) / std::max(way, 1e-3));
            }
            EXPECT_LE(bend, 1.0 / 16384) << far.x << " " << far.z;
            printf("[ measured ] a %.0fth of the way off\n", 1 / std::max(bend, 1e-12));
            EXPECT_LE(ends.size(), 2 * (alone.position.size() + 4000));
            EXPECT_TRUE(verifyStore(*store, *executor, 0)) << far.x << " " << far.z;
        }
    }
}

TEST(CoordinatesOfCurves, ShortSegmentsAreNoRepeatsHoweverFarAnotherLies) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    CurveSet set;  // as readers give it
    for (uint32_t i = 0; i < 200; ++i) set.addVertex({0.3 * i, 0.2 * (i % 2), 0}, 0.05f, glm::vec3(0), 0);
    set.endCurve(false);
    const std::vector<glm::dvec3> truth = set.position;
    for (const double y : {0.0, 1.0}) set.addVertex({1e12, y, 0}, 0.05f, glm::vec3(0), 0);
    set.endCurve(false);
    const auto store = test::buildCurves(cleanCurves(set, 0), folder / "far", *executor, 8192);
    EXPECT_TRUE(store->description.dropped.empty());
    const double ofDoubles = 1e12 * 0x1p-52;
    EXPECT_LE(farthest(truth, endsOf(*store), 0.5), store->description.roundingUnits + ofDoubles);
    EXPECT_LE(store->description.roundingUnits, 0.005);
}

}  // namespace
}  // namespace stipple::lod
