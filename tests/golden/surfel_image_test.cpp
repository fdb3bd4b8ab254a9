// Surfels of triangles: how they lie, and that nothing shows through what they were made from.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/surfels.h"
#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/primitives/in_memory.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

/// A closed body of 32,512 triangles with folds as deep as a third of its radius, in any order.
scene::Scene folded() {
    constexpr uint32_t kAround = 128, kUp = 128;
    scene::Primitive p;
    for (uint32_t j = 0; j <= kUp; ++j)
        for (uint32_t i = 0; i < kAround; ++i) {
            const double a = 2 * M_PI * i / kAround, b = M_PI * j / kUp, s = std::sin(b);
            const double r = 1 + 0.3 * std::pow(std::abs(std::cos(5 * a)), 3) * s * s + 0.1 * std::sin(12 * b) * s;
            p.position.emplace_back(r * s * std::cos(a), r * std::cos(b), r * s * std::sin(a));
        }
    std::vector<std::array<uint32_t, 3>> triangles;
    for (uint32_t j = 0; j < kUp; ++j)
        for (uint32_t i = 0; i < kAround; ++i) {
            const uint32_t a = j * kAround + i, b = j * kAround + (i + 1) % kAround, c = a + kAround, d = b + kAround;
            if (j > 0) triangles.push_back({a, b, d});
            if (j + 1 < kUp) triangles.push_back({a, d, c});
        }
    Rng rng(7);
    for (size_t i = triangles.size(); i > 1; --i) std::swap(triangles[i - 1], triangles[rng.below(i)]);
    std::vector<dvec3> normals(p.position.size(), dvec3(0));
    for (const auto& t : triangles) {
        const dvec3 n = glm::cross(p.at(t[1]) - p.at(t[0]), p.at(t[2]) - p.at(t[0]));
        for (const uint32_t i : t) {
            p.indices.push_back(i);
            normals[i] += n;
        }
    }
    for (const dvec3& n : normals) p.normal.emplace_back(glm::normalize(n));
    scene::Scene scene;
    scene.path = "folded";
    scene.meshes.push_back({"", {std::move(p)}});
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    return scene;
}

/// Leaves of two triangles each, turned any way, in a ball.
scene::Scene foliage(uint32_t leaves) {
    scene::Scene scene;
    scene.path = "foliage";
    scene::Primitive p;
    Rng rng(2);
    for (uint32_t k = 0; k < leaves; ++k) {
        const dvec3 c = glm::normalize(dvec3(rng.normal(), rng.normal(), rng.normal())) * std::cbrt(rng.uniform());
        const dvec3 n = glm::normalize(dvec3(rng.normal(), rng.normal(), rng.normal()));
        const dvec3 a = 0.02 * glm::normalize(glm::cross(n, dvec3(n.y, n.z, -n.x))), b = glm::cross(n, a);
        for (const dvec3& corner : {c - a - b, c + a - b, c + a + b, c - a + b}) p.position.emplace_back(corner);
        for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) p.indices.push_back(4 * k + i);
    }
    scene.meshes.push_back({"", {std::move(p)}});
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    return scene;
}

lod::PointBlock surfelsOf(const scene::Scene& scene, uint64_t count) {
    const auto source = scene::sampleSurfels(scene, {}, {count});
    lod::PointBlock block;
    if (!source) return block;
    const auto read = source->openPart(0);
    EXPECT_EQ(*(*read)(block, ~size_t{0}), source->info.points);
    return block;
}

/// Samples keep 0.73 spacings apart, and what is farther from all than their radius is rare: the middles of the
/// triangles themselves, against all surfels that face alike. (On a plane one place in 400,000 is.)
TEST(Surfels, OfFoldsKeepApartAndReachAllPlaces) {
    const scene::Scene scene = folded();
    const scene::Primitive& p = scene.meshes[0].primitives[0];
    double area = 0;
    for (size_t i = 0; i < p.indices.size(); i += 3)
        area += 0.5 * glm::length(glm::cross(p.at(p.indices[i + 1]) - p.at(p.indices[i]),
                                             p.at(p.indices[i + 2]) - p.at(p.indices[i])));
    constexpr uint64_t kCount = 4'000;
    const double spacing = std::sqrt(area / kCount);
    const lod::PointBlock s = surfelsOf(scene, kCount);
    EXPECT_NEAR(static_cast<double>(s.position.size()), kCount, 0.03 * kCount);
    ASSERT_EQ(s.radius.size(), s.position.size());
    const auto nearest = [&](const dvec3& at, const dvec3& n, size_t but) {
        double least = 1e300;
        for (size_t i = 0; i < s.position.size(); ++i)
            if (i != but && glm::dot(dvec3(s.normal[i]), n) > 0)
                least = std::min(least, glm::distance(at, s.position[i]));
        return least / spacing;
    };
    double apart = 1e300;
    for (size_t i = 0; i < s.position.size(); ++i) {
        EXPECT_NEAR(s.radius[i] / spacing, 1.03, 0.01);
        apart = std::min(apart, nearest(s.position[i], dvec3(s.normal[i]), i));
    }
    EXPECT_GT(apart, 0.7);
    size_t open = 0;
    for (size_t i = 0; i < p.indices.size(); i += 3) {
        const dvec3 middle = (p.at(p.indices[i]) + p.at(p.indices[i + 1]) + p.at(p.indices[i + 2])) / 3.0;
        open += nearest(middle, dvec3(p.normal[p.indices[i]]), ~size_t{0}) > 1.03;
    }
    printf("nearest two %.2f spacings apart; %zu of %zu triangles farther than a radius from each\n", apart, open,
           p.indices.size() / 3);
    EXPECT_LE(open, p.indices.size() / 3 / 10'000);
}

/// Of leaves none keeps apart from another, and how wide they are drawn is told by what is around them: as before.
TEST(Surfels, OfFoliageAreAsManyAsAskedForAndHaveNoRadius) {
    const lod::PointBlock few = surfelsOf(foliage(2'000), 500), many = surfelsOf(foliage(2'000), 20'000);
    EXPECT_EQ(few.position.size(), 500u);
    EXPECT_TRUE(few.radius.empty());
    EXPECT_NEAR(static_cast<double>(many.position.size()), 20'000, 600) << "10 a leaf: each is a surface";
    EXPECT_EQ(many.radius.size(), many.position.size());
}

/// From all around: pixels whose rays, and all within 3 px of them, meet the triangles.
TEST(Surfels, ShowNothingThroughFolds) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const scene::Scene scene = folded();
    Progress silent(false);
    lod::MeshBuildSettings mesh;
    mesh.description.materials = scene::surfaceMaterials(scene);
    ASSERT_TRUE(lod::buildMeshStore(scene::triangleSource(scene, scene::placements(scene)), folder / "mesh.stipple",
                                    mesh, *executor, silent));
    test::spit(folder / "scene", "x");
    const lod::PointBlock all = surfelsOf(scene, 5'000);
    const auto surfelStore = [&](const char* name, bool withRadii, bool isTwoSided) {
        lod::BuildSettings settings;
        settings.open = [&](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> {
            lod::PointBlock points = all;
            if (!withRadii) points.radius.clear();
            lod::SourceInfo info;
            info.path = "scene";
            info.isReflectance = true;
            info.isTwoSided = isTwoSided;
            return lod::pointsInMemory(std::move(info), std::move(points));
        };
        EXPECT_TRUE(lod::buildStore({folder / "scene"}, folder / name, settings, *executor, silent));
        return std::make_shared<const lod::Store>(std::move(*lod::openStore(folder / name)));
    };
    const auto triangles = std::make_shared<const lod::Store>(std::move(*lod::openStore(folder / "mesh.stipple")));
    const auto surfels = surfelStore("a.stipple", true, false), estimated = surfelStore("b.stipple", false, false),
               twoSided = surfelStore("c.stipple", true, true);
    for (const auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        if (name == "fp64") continue;
        std::map<std::string, size_t> open;
        size_t inside = 0;
        for (const double turn : {0.1, 0.9, 1.7, 2.5}) {
            lod::View view = test::viewFromAbove({0, 0, 0});
            view.forward = -glm::normalize(dvec3(std::cos(turn), 0.3, std::sin(turn)));
            view.eye = -3.2 * view.forward;
            view.right = glm::normalize(glm::cross(view.forward, dvec3(0, 1, 0)));
            view.down = glm::cross(view.forward, view.right);
            view.width = view.height = 256;
            view.focalPixels = 256;
            const render::Image truth =
                test::renderView(triangles, *backend, *executor, view, test::drawnAs(render::Mode::splat));
            const auto count = [&](const char* what, const std::shared_ptr<const lod::Store>& of, render::Mode mode) {
                const render::Image image = test::renderView(of, *backend, *executor, view, test::drawnAs(mode));
                for (int y = 3; y < 253; ++y)
                    for (int x = 3; x < 253; ++x) {
                        bool isInside = true;
                        for (int dy = -3; dy <= 3; ++dy)
                            for (int dx = -3; dx <= 3; ++dx)
                                isInside &= truth.depth[static_cast<size_t>(256 * (y + dy) + x + dx)] > 0;
                        if (!isInside) continue;
                        inside += mode == render::Mode::splat;
                        open[what] += !(image.depth[static_cast<size_t>(256 * y + x)] > 0);
                    }
            };
            count("splat", surfels, render::Mode::splat);
            count("ewa", surfels, render::Mode::ewa);
            count("surface", surfels, render::Mode::surface);
            count("pullpush", surfels, render::Mode::pullpush);
            count("splat, both sides", twoSided, render::Mode::splat);
            count("splat, radii as of a scan", estimated, render::Mode::splat);
        }
        for (const auto& [what, pixels] : open)
            printf("%s, %s: %zu open of %zu\n", name.c_str(), what.c_str(), pixels, inside / 3);
        EXPECT_GT(inside / 3, 50'000u);
        // Where the edge of a fold is seen, a disc may turn away at its centre whose rim does not: it is not drawn.
        EXPECT_EQ(open["splat, both sides"], 0u);
        for (const char* what : {"splat", "ewa", "surface", "pullpush"})
            EXPECT_LE(open[what], inside / 3 / 10'000) << what;
        // The control: what folds bend was taken for foliage.
        EXPECT_GT(open["splat, radii as of a scan"], inside / 3 / 1'000);
    }
}

}  // namespace
}  // namespace stipple
