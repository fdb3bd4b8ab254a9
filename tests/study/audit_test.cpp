// The bound audit on what is known beforehand, and of pictures against the points, triangles and curves that stores
// were built from, by brute force: nothing of it knows codes, cuts or stores.
#include <gtest/gtest.h>

#include <cmath>

#include "apps/study/audit/audit.h"
#include "apps/study/audit/originals.h"
#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

dvec3 anyPlace(Rng& rng) { return {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)}; }

TEST(BoundAudit, DistancesAreThoseOfDenseSamples) {
    Rng rng(7);
    for (int run = 0; run < 40; ++run) {
        const study::FullTriangle t{anyPlace(rng), anyPlace(rng), anyPlace(rng)};
        const study::FullDisc d{anyPlace(rng), glm::normalize(anyPlace(rng)), rng.uniform(0.1, 0.5)};
        const study::FullTube s{anyPlace(rng), anyPlace(rng), 0.05, 0.2};
        const dvec3 p = 2.0 * anyPlace(rng);
        double toTriangle = 1e300, toDisc = 1e300, toTube = 1e300;
        const dvec3 x = glm::normalize(glm::cross(d.normal, dvec3(0.3, 0.5, 0.8))), y = glm::cross(d.normal, x);
        constexpr int kSteps = 200;
        for (int i = 0; i <= kSteps; ++i) {
            const double u = static_cast<double>(i) / kSteps;
            toTube =
                std::min(toTube, glm::length(p - glm::mix(s.a, s.b, u)) - (s.radiusA + u * (s.radiusB - s.radiusA)));
            for (int k = 0; k <= kSteps; ++k) {
                const double v = static_cast<double>(k) / kSteps;
                if (u + v <= 1 + 1e-12)
                    toTriangle = std::min(toTriangle, glm::length(t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]) - p));
                const double angle = 6.283185307179586 * v;
                toDisc = std::min(
                    toDisc, glm::length(d.centre + u * d.radius * (std::cos(angle) * x + std::sin(angle) * y) - p));
            }
        }
        EXPECT_NEAR(study::distanceTo(t, p), toTriangle, 0.02);
        EXPECT_LE(study::distanceTo(t, p), toTriangle + 1e-12);
        EXPECT_NEAR(study::distanceTo(d, p), toDisc, 0.01);
        EXPECT_LE(study::distanceTo(d, p), toDisc + 1e-12);
        // (The nearest place of a cone's axis is not that of its side: by less than its slope.)
        EXPECT_NEAR(study::distanceTo(s, p), std::max(toTube, 0.0), 0.05);
    }
}

TEST(BoundAudit, AFieldIsTheLeastOfItsShapes) {
    Rng rng(8);
    study::FullShapes shapes;
    for (int i = 0; i < 300; ++i) {
        const dvec3 c = anyPlace(rng);
        shapes.discs.push_back({c, glm::normalize(anyPlace(rng)), 0.02});
        shapes.triangles.push_back({c, c + 0.1 * anyPlace(rng), c + 0.1 * anyPlace(rng)});
        shapes.tubes.push_back({anyPlace(rng), c, 0.01, 0.02});
    }
    const study::FullShapes all = shapes;
    const study::FullDetail full(std::move(shapes));
    for (int i = 0; i < 200; ++i) {
        const dvec3 p = 1.5 * anyPlace(rng);
        double least = 0.3;
        for (const auto& d : all.discs) least = std::min(least, study::distanceTo(d, p));
        for (const auto& t : all.triangles) least = std::min(least, study::distanceTo(t, p));
        for (const auto& t : all.tubes) least = std::min(least, study::distanceTo(t, p));
        EXPECT_EQ(full.distance(p, 0.3), least);
    }
}

/// A plane across the view at depth 5, drawn `pixels` too far away.
study::Audit auditOfPlane(double pixels, double stated, bool isOrthographic) {
    lod::View view;
    view.width = 64;
    view.height = 48;
    view.focalPixels = isOrthographic ? 8 : 60;
    view.isOrthographic = isOrthographic;
    study::FullShapes shapes;
    shapes.triangles.push_back({dvec3(-90, -90, -5), dvec3(90, -90, -5), dvec3(0, 180, -5)});
    const study::FullDetail full(std::move(shapes));
    const double unit = isOrthographic ? 1 / view.focalPixels : 5 / view.focalPixels;
    render::Image image, traced;
    image.width = traced.width = view.width;
    image.height = traced.height = view.height;
    traced.depth.assign(size_t{64} * 48, 5.0f);
    image.depth.assign(size_t{64} * 48, static_cast<float>(5 + pixels * unit));
    const auto executor = makeSerialExecutor();
    return study::auditDepths(image, traced, view, full, stated, *executor);
}

TEST(BoundAudit, APlantedTenthOfAPixelIsFound) {
    for (const bool isOrthographic : {false, true}) {
        const study::Audit exact = auditOfPlane(0, 1, isOrthographic), off = auditOfPlane(0.1, 1, isOrthographic);
        EXPECT_EQ(exact.drawn, 64u * 48);
        EXPECT_LT(exact.worst, 1e-4);
        // Pixels are larger where the plane is farther: 0.1 px at 5 is a little less beyond it.
        EXPECT_NEAR(off.p99 - exact.p99, 0.1, 0.001) << isOrthographic;
        EXPECT_NEAR(off.worst, 0.1, 0.001);
        EXPECT_EQ(off.beyond(), 0u);
        EXPECT_EQ(auditOfPlane(1.7, 1, isOrthographic).beyond(), 64u * 48) << "the control: 1.5 px are allowed";
    }
}

TEST(BoundAudit, ViolationsHaveClasses) {
    lod::View view;
    view.width = view.height = 32;
    view.focalPixels = 30;
    study::FullShapes shapes;
    shapes.triangles.push_back({dvec3(-90, -90, -5), dvec3(90, -90, -5), dvec3(0, 180, -5)});
    const study::FullDetail full(std::move(shapes));
    render::Image image, traced;
    image.width = traced.width = image.height = traced.height = 32;
    image.depth.assign(1024, 5.0f);
    traced.depth.assign(1024, 5.0f);
    const auto at = [](size_t x, size_t y) { return y * 32 + x; };
    image.depth[at(0, 0)] = 0;
    image.depth[at(1, 1)] = 7;    // beside nothing
    image.depth[at(20, 20)] = 7;  // nothing is traced there
    traced.depth[at(20, 20)] = 0;
    image.depth[at(10, 20)] = 7;  // between layers
    traced.depth[at(11, 21)] = 9;
    image.depth[at(20, 10)] = 7;
    const auto executor = makeSerialExecutor();
    const study::Audit a = study::auditDepths(image, traced, view, full, 1, *executor);
    EXPECT_EQ(a.outline, 1u);
    EXPECT_EQ(a.gap, 1u);
    EXPECT_EQ(a.between, 1u);
    EXPECT_EQ(a.other, 1u);
    EXPECT_EQ(a.drawn, 1023u);
    EXPECT_GT(a.worst, 7);
}

/// Of pictures of a store, judged by what it was built from.
struct Audited {
    uint64_t drawn = 0, beyond = 0;
    double worst = 0;
};
Audited auditOf(const std::shared_ptr<const lod::Store>& store, const study::FullDetail& full, render::Mode mode,
                double asked, double judged, Executor& executor) {
    Audited sum;
    const auto backend = cpu::makeCpuBackend(executor);
    for (const auto& [elevation, distance] : {std::pair{35.0, 0.9}, {25.0, 0.5}, {4.0, 0.7}, {20.0, 3.0}}) {
        const lod::View view = test::lookAt(*store, 30, elevation, distance, 200);
        render::FrameSettings settings;
        settings.budgets.errorPixels = asked;
        settings.wantDepthAndNormal = true;
        settings.mode = mode;
        const render::Image image = test::renderView(store, *backend, executor, view, settings);
        render::PlacedStore placed;
        placed.store = store;
        const auto traced = reference::trace({placed}, view, {1, {}}, executor);
        EXPECT_TRUE(traced);
        const study::Audit a = study::auditDepths(image, *traced, view, full, judged, executor);
        sum.drawn += a.drawn;
        sum.beyond += a.beyond();
        sum.worst = std::max(sum.worst, a.worst);
    }
    return sum;
}

// Discs of the points as they were given. (Stores keep radii rounded up by at most 4.4 %, which is below half a pixel
// at these distances.)
TEST(BoundAudit, PicturesOfPointsKeepTheirBoundFromTheOriginalPoints) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    for (const test::Shape shape : {test::Shape::statue, test::Shape::torus}) {
        std::vector<test::TestPoint> points = test::samplesOf(shape, 30'000, 3);
        for (test::TestPoint& p : points) p.radius = static_cast<float>(test::spacingOf(shape, 30'000));
        test::writePly(folder / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
        study::FullShapes shapes;
        for (const test::TestPoint& p : points)
            shapes.discs.push_back({p.position, glm::normalize(dvec3(p.normal)), p.radius});
        study::FullShapes moved = shapes;
        const study::FullDetail full(std::move(shapes));
        for (const render::Mode mode : {render::Mode::surface, render::Mode::splat, render::Mode::pullpushExact})
            for (const double tau : {0.5, 1.0, 4.0}) {
                const Audited a = auditOf(store, full, mode, tau, tau, *executor);
                std::printf("%s at %.1f px: %lu drawn, %lu beyond, worst %.2f px\n",
                            render::reconstructionOf(mode).name, tau, static_cast<unsigned long>(a.drawn),
                            static_cast<unsigned long>(a.beyond), a.worst);
                EXPECT_GT(a.drawn, 15'000u);
                EXPECT_EQ(a.beyond, 0u) << render::reconstructionOf(mode).name << " " << tau;
            }
        for (study::FullDisc& d : moved.discs) d.centre *= 1.05;
        const Audited control =
            auditOf(store, study::FullDetail(std::move(moved)), render::Mode::splat, 1, 1, *executor);
        EXPECT_GT(control.beyond, 10'000u) << "the control: points that were 5 % farther out";
    }
}

TEST(BoundAudit, PicturesOfTrianglesKeepTheirBoundFromTheOriginalTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::MeshRecipe recipe;
    recipe.grow.kind = "boulder";
    recipe.grow.triangles = 30'000;
    recipe.isTextured = false;
    lod::MeshBuildSettings settings;
    const lod::TriangleMesh mesh = test::growTriangles(recipe, settings);
    study::FullShapes shapes;
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
        shapes.triangles.push_back(
            {mesh.position[mesh.indices[i]], mesh.position[mesh.indices[i + 1]], mesh.position[mesh.indices[i + 2]]});
    const study::FullDetail full(std::move(shapes));
    const auto store = test::growMeshStore(recipe, folder / "m.stipple", *executor);
    for (const double tau : {0.5, 1.0, 4.0}) {
        const Audited a = auditOf(store, full, render::Mode::surface, tau, tau, *executor);
        std::printf("boulder at %.1f px: %lu drawn, %lu beyond, worst %.2f px\n", tau,
                    static_cast<unsigned long>(a.drawn), static_cast<unsigned long>(a.beyond), a.worst);
        EXPECT_GT(a.drawn, 15'000u);
        EXPECT_EQ(a.beyond, 0u) << tau;
    }
    EXPECT_GT(auditOf(store, full, render::Mode::surface, 16, 0.5, *executor).beyond, 50u) << "the control";
}

/// What frames of patches state holds their distance from the triangles, which their leaves are not either.
TEST(BoundAudit, PicturesOfPatchesKeepTheirBoundFromTheOriginalTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const lod::TriangleMesh mesh = test::torusMesh(120, 60);
    study::FullShapes shapes;
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
        shapes.triangles.push_back(
            {mesh.position[mesh.indices[i]], mesh.position[mesh.indices[i + 1]], mesh.position[mesh.indices[i + 2]]});
    lod::PatchBuildSettings settings;
    settings.leafTriangles = 1500;  // several levels
    settings.description.materials.resize(1);
    Progress silent(false);
    ASSERT_TRUE(lod::buildPatchStore(lod::sourceOf(mesh), folder / "p.stipple", settings, *executor, silent));
    auto opened = lod::openStore(folder / "p.stipple");
    ASSERT_TRUE(opened);
    render::PlacedStore placed;
    placed.store = std::make_shared<const lod::Store>(std::move(*opened));
    // The leaves, decoded once more: near the triangles, as the store says of them.
    const auto leaves = study::leavesOf(std::span(&placed, 1), 1'000'000);
    ASSERT_TRUE(leaves) << leaves.error().line();
    EXPECT_GT(leaves->triangles.size(), 5'000u);
    study::FullShapes moved = shapes;
    const study::FullDetail full(std::move(shapes));
    for (const study::FullTriangle& t : leaves->triangles)
        for (const dvec3& corner : t) ASSERT_LT(full.distance(corner, 1), 0.05);
    for (study::FullTriangle& t : moved.triangles)
        for (dvec3& corner : t) corner *= 1.05;
    const study::FullDetail farther(std::move(moved));
    const auto backend = cpu::makeCpuBackend(*executor);
    const auto state = render::makeFrameState({placed.store}, *backend, *executor, {});
    for (const double tau : {0.5, 4.0}) {
        Audited sum, control;
        double stated = 0;
        for (const auto& [elevation, distance] : {std::pair{35.0, 0.9}, {25.0, 0.5}, {4.0, 0.7}, {20.0, 3.0}}) {
            const lod::View view = test::lookAt(*placed.store, 30, elevation, distance, 200);
            render::FrameSettings frame = test::drawnAs(render::Mode::surface, tau);
            frame.wantDepthAndNormal = true;
            ASSERT_TRUE(render::renderUntilComplete(*state, view, frame));
            const auto traced = reference::trace({placed}, view, {1, {}}, *executor);
            ASSERT_TRUE(traced);
            stated = state->counters.tauEffectivePixels;
            const study::Audit a = study::auditDepths(state->image, *traced, view, full, stated, *executor);
            sum.drawn += a.drawn;
            sum.beyond += a.beyond();
            sum.worst = std::max(sum.worst, a.worst);
            control.beyond += study::auditDepths(state->image, *traced, view, farther, stated, *executor).beyond();
        }
        std::printf("patches at %.1f px (%.2f said): %lu drawn, %lu beyond, worst %.2f px; control %lu\n", tau, stated,
                    static_cast<unsigned long>(sum.drawn), static_cast<unsigned long>(sum.beyond), sum.worst,
                    static_cast<unsigned long>(control.beyond));
        EXPECT_GT(sum.drawn, 15'000u);
        EXPECT_EQ(sum.beyond, 0u) << tau;
        EXPECT_GT(control.beyond, 1'000u) << "the control: triangles that were 5 % farther out";
    }
}

// (A line as deep as the plane of its ribbon, seen edge-on, lay up to 13 px off: 2 pixels of 1,000 at 1 px.)
TEST(BoundAudit, PicturesOfCurvesKeepTheirBoundFromTheOriginalCurves) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::CurlRecipe narrow;
    narrow.count = 3000;
    narrow.radius = 0.004f;
    for (const bool isTree : {true, false}) {
        const lod::CurveSet curves = isTree ? test::oak(20'000) : test::curls(narrow);
        study::FullShapes shapes;
        for (size_t c = 0; c < curves.curves(); ++c)
            for (uint32_t v = curves.first[c]; v + 1 < curves.first[c + 1]; ++v)
                shapes.tubes.push_back(
                    {curves.position[v], curves.position[v + 1], curves.radius[v], curves.radius[v + 1]});
        study::FullShapes moved = shapes;
        const study::FullDetail full(std::move(shapes));
        const auto store = test::buildCurves(curves, folder / "c.stipple", *executor);
        for (const render::Mode mode : {render::Mode::surface, render::Mode::splat, render::Mode::ewa})
            for (const double tau : {0.5, 1.0, 4.0}) {
                const Audited a = auditOf(store, full, mode, tau, tau, *executor);
                std::printf("%s in %s at %.1f px: %lu drawn, %lu beyond, worst %.2f px\n", isTree ? "oak" : "curls",
                            render::reconstructionOf(mode).name, tau, static_cast<unsigned long>(a.drawn),
                            static_cast<unsigned long>(a.beyond), a.worst);
                EXPECT_GT(a.drawn, 15'000u);
                EXPECT_EQ(a.beyond, 0u) << render::reconstructionOf(mode).name << " " << tau;
            }
        for (study::FullTube& t : moved.tubes) t.a *= 1.05, t.b *= 1.05;
        EXPECT_GT(auditOf(store, study::FullDetail(std::move(moved)), render::Mode::surface, 1, 1, *executor).beyond,
                  300u)
            << "the control: curves that were 5 % farther out";
    }
}

/// What a store keeps of its points, held against the points themselves; a record that is moved by a step, a normal
/// that is turned and a colour that is changed are found.
TEST(OriginalsAudit, FindsWhatIsNotKept) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(3'000, 2, {4.1e6, 5.2e5, 4.9e6}));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    auto originals = study::readOriginals(folder / "a.ply", 10'000);
    ASSERT_TRUE(originals) << originals.error().line();
    const auto kept = study::auditOriginals(*originals, *store);
    ASSERT_TRUE(kept);
    EXPECT_EQ(kept->points, 3'000u);
    EXPECT_EQ(kept->records, 3'000u);
    EXPECT_EQ(kept->normals, 3'000u);
    EXPECT_EQ(kept->colours, 3'000u);
    EXPECT_EQ(kept->beyond(), 0u) << kept->worstRounding << " of " << kept->statedRounding << ", " << kept->worstNormal;
    EXPECT_GT(kept->worstRounding, 0.3 * kept->statedRounding) << "the bound is not idle";
    originals->place[7].x += 2 * kept->statedRounding;
    originals->normal[8] =
        glm::normalize(originals->normal[8] + 5e-3 * glm::cross(originals->normal[8], dvec3(1, 0, 0)));
    originals->colour[9][1] ^= 1;
    const auto spoilt = study::auditOriginals(*originals, *store);
    ASSERT_TRUE(spoilt);
    EXPECT_EQ(spoilt->placeBeyond, 1u);
    EXPECT_EQ(spoilt->normalBeyond, 1u);
    EXPECT_EQ(spoilt->colourBeyond, 1u);
    EXPECT_FALSE(study::readOriginals(folder / "a.ply", 100)) << "too many";
}

}  // namespace
}  // namespace stipple
