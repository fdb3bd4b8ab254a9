// Graphs of places: hard cases 2 (the eye's and the places' transforms multiplied in fp32 lose the translation),
// 5 (uneven scales), 7 (singular scales), 8 (deep graphs). Oracle: the same in long double. Each test has the naive
// formula beside it and requires that it fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "engine/base/rng.h"
#include "engine/render/draw_list.h"
#include "engine/scene/triangles.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dmat3;
using glm::dmat4;
using glm::dvec3;
using Long3 = glm::tvec3<long double>;
using Long4x4 = glm::tmat4x4<long double>;

const dvec3 kEarth(4.1e6, 5.2e5, 4.9e6);  // a place on the ground, from the earth's centre

dvec3 anyDirection(Rng& rng) {
    dvec3 d;
    do d = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
    while (glm::length(d) < 0.1 || glm::length(d) > 1);
    return glm::normalize(d);
}
dmat4 anyTurn(Rng& rng) { return glm::rotate(dmat4(1), rng.uniform(0, 6.28), anyDirection(rng)); }

/// A chain of nodes, each in the one before it.
scene::Scene chainOf(const std::vector<dmat4>& locals) {
    scene::Scene s;
    for (size_t i = 0; i < locals.size(); ++i) {
        scene::Node n;
        n.local = locals[i];
        n.parent = static_cast<int>(i) - 1;
        s.nodes.push_back(n);
    }
    return s;
}
template <typename M>
M product(const std::vector<dmat4>& locals) {
    M m(1);
    for (const dmat4& l : locals) m = m * M(l);
    return m;
}

/// Where the frame's constants put a record, against long double.
double ulpsOff(const Long3& truth, const dvec3& place) {
    const double distance = static_cast<double>(glm::length(truth));
    return static_cast<double>(glm::length(Long3(place) - truth)) / (distance * 0x1p-24);
}

TEST(Transforms, SixNestedLevelsAtTheEarthsCentreKeepTheirPlaces) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    test::writePly(folder / "a.ply", test::bumpySphere(300, 1));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const lod::Hierarchy& h = store->hierarchy;
    const std::vector<const lod::Hierarchy*> hierarchies{&h};
    Rng rng(1);
    double worst = 0, naive = 1e300;
    for (int k = 0; k < 200; ++k) {
        std::vector<dmat4> locals{glm::translate(dmat4(1), kEarth)};
        for (int level = 1; level < 6; ++level)
            locals.push_back(glm::translate(dmat4(1), rng.uniform(1, 30) * anyDirection(rng)) * anyTurn(rng));
        const dmat4 world = chainOf(locals).worldTransforms().back();
        std::vector<lod::Instance> instances(1);
        instances[0].translation = dvec3(world[3]);
        instances[0].rotation = dmat3(world);
        lod::View view = test::viewFromAbove(dvec3(world[3]));
        view.eye = dvec3(world[3]) + rng.uniform(1.5, 20) * anyDirection(rng);
        const dmat3 turn(anyTurn(rng));
        view.right = turn[0];
        view.down = turn[1];
        view.forward = turn[2];
        lod::Cut cut;
        lod::CutDraw draw;
        draw.count = 1;
        cut.draw.push_back(draw);
        render::DrawList list;
        render::makeDrawList(cut, hierarchies, instances, view, {}, list);
        const shared::DrawNode& node = list.points().nodes.at(0);
        const Long4x4 exact = product<Long4x4>(locals);
        const Long3 record(h.origin + h.unit * h.recordOrigin(h.nodes[0], h.payload(0)));
        const Long3 off = Long3(exact * glm::tvec4<long double>(record, 1)) - Long3(view.eye);
        const auto seen = [&](const Long3& d) {
            return Long3(glm::dot(Long3(view.right), d), glm::dot(Long3(view.down), d),
                         glm::dot(Long3(view.forward), d));
        };
        worst = std::max(worst, ulpsOff(seen(off), dvec3(glm::vec3(node.base))));
        // The naive way: the matrix of the view times that of the model, in fp32.
        const glm::mat4 model(product<dmat4>(locals));
        glm::mat4 camera(
            glm::transpose(glm::mat3(glm::vec3(view.right), glm::vec3(view.down), glm::vec3(view.forward))));
        camera = camera * glm::translate(glm::mat4(1), -glm::vec3(view.eye));
        const glm::vec3 wrong((camera * model) * glm::vec4(glm::dvec4(dvec3(record), 1)));
        naive = std::min(naive, ulpsOff(seen(off), dvec3(wrong)));
    }
    std::printf("%.2f ulps of the distance; in fp32 at least %.0f\n", worst, naive);
    EXPECT_LE(worst, 4);
    EXPECT_GT(naive, 40);
}

TEST(Transforms, SixtyFourLevelsAndTheirInversesAreNothing) {
    Rng rng(2);
    double worst = 0, naive = 1e300;
    for (int k = 0; k < 100; ++k) {
        std::vector<dmat4> locals;
        for (int level = 0; level < 64; ++level)
            locals.push_back(glm::translate(dmat4(1), rng.uniform(0, 10) * anyDirection(rng)) * anyTurn(rng) *
                             glm::scale(dmat4(1), dvec3(std::exp2(rng.uniform(-0.5, 0.5)))));
        const size_t levels = locals.size();
        for (size_t i = levels; i > 0; --i) {
            const dmat4 inverse(glm::inverse(Long4x4(locals[i - 1])));
            locals.push_back(inverse);
        }
        // Relative to the largest place and scale that the chain goes through.
        const auto offOf = [&]<typename M>(const M& m) {
            double size = 1, off = 0;
            M through(1);
            for (size_t i = 0; i < levels; ++i) {
                through = through * M(locals[i]);
                size = std::max(size, static_cast<double>(glm::length(through[3])));
            }
            for (int c = 0; c < 4; ++c)
                for (int r = 0; r < 4; ++r)
                    off = std::max(off, std::abs(static_cast<double>(m[c][r]) - (c == r ? 1 : 0)));
            return off / size;
        };
        worst = std::max(worst, offOf(chainOf(locals).worldTransforms().back()));
        naive = std::min(naive, offOf(product<glm::mat4>(locals)));
    }
    std::printf("%.1e of the largest place; in fp32 at least %.1e\n", worst, naive);
    EXPECT_LE(worst, 1e-12);
    EXPECT_GT(naive, 1e-10);
}

/// The triangles of one grown rock where a matrix puts it.
lod::TriangleMesh rockAt(const dmat4& world) {
    static const scene::Scene rock = grow::growMesh({"rock", 2'000, 1, 16});
    return test::collect(scene::triangleSource(rock, {scene::Placement{0, world}}));
}
double angleBetween(const dvec3& a, const dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

TEST(Transforms, NormalsStandOnSurfacesThatAreScaledUnevenly) {
    const lod::TriangleMesh plain = rockAt(dmat4(1));
    Rng rng(3);
    double worst = 0, naive = 0;
    for (int k = 0; k < 20; ++k) {
        const dvec3 scale = k == 0 ? dvec3(1, 1e4, 1) : dvec3(std::exp2(rng.uniform(-6.6, 6.6)), 1e2, 1e-2);
        const dmat4 world = anyTurn(rng) * glm::scale(dmat4(1), scale) * anyTurn(rng);
        const lod::TriangleMesh placed = rockAt(world);
        ASSERT_EQ(placed.normal.size(), plain.normal.size());
        const glm::tmat3x3<long double> linear{dmat3(world)};
        const glm::tmat3x3<long double> forNormals = glm::transpose(glm::inverse(linear));
        for (size_t i = 0; i < placed.normal.size(); ++i) {
            const dvec3 truth(glm::normalize(forNormals * Long3(plain.normal[i])));
            ASSERT_NEAR(glm::length(placed.normal[i]), 1, 1e-6);
            worst = std::max(worst, angleBetween(dvec3(placed.normal[i]), truth));
            naive = std::max(naive, angleBetween(glm::normalize(dmat3(world) * dvec3(plain.normal[i])), truth));
        }
    }
    std::printf("%.1e radians; turned like positions up to %.2f\n", worst, naive);
    // Normals of the input are floats: those of the plain mesh are already rounded, which the shear magnifies by
    // nothing, as both start from them.
    EXPECT_LE(worst, 1e-5);
    EXPECT_GT(naive, 1);
}

TEST(Transforms, PlacesWithoutAnAreaAreCountedAndThoseOfAPlaneAreKept) {
    const scene::Scene rock = grow::growMesh({"rock", 2'000, 1, 16});
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    const auto reportOf = [&](const std::vector<dvec3>& scales) {
        std::vector<scene::Placement> placed;
        for (const dvec3& s : scales) placed.push_back({0, glm::scale(dmat4(1), s)});
        Progress progress(false);
        return lod::buildMeshStore(scene::triangleSource(rock, placed), folder / "a.stipple", {}, *executor, progress);
    };
    const auto plain = reportOf({dvec3(1)});
    ASSERT_TRUE(plain) << plain.error().line();
    const uint64_t own =
        plain->dropped.contains("degenerate triangles") ? plain->dropped.at("degenerate triangles") : 0;
    // Rank 1 and 0 beside the rock itself: all of theirs have no area, and all are counted.
    const auto thin = reportOf({dvec3(1), dvec3(1, 0, 0), dvec3(0)});
    ASSERT_TRUE(thin) << thin.error().line();
    EXPECT_EQ(thin->dropped.at("degenerate triangles"), 3 * own + 2 * (plain->pointsIn - own));
    EXPECT_EQ(thin->pointsOut, plain->pointsOut);
    // Rank 2: a flat shape of its own, with the normal of its plane (from the cofactors; the inverse has none).
    const lod::TriangleMesh flat = rockAt(glm::scale(dmat4(1), dvec3(1, 0, 1)));
    size_t isOfPlane = 0;
    for (const glm::vec3& n : flat.normal) {
        ASSERT_TRUE(std::isfinite(n.x + n.y + n.z));
        isOfPlane += std::abs(std::abs(n.y) - 1) < 1e-6f;
    }
    EXPECT_GT(isOfPlane, 0.9 * static_cast<double>(flat.normal.size()));
    const dmat3 inverse = glm::transpose(glm::inverse(dmat3(1, 0, 0, 0, 0, 0, 0, 0, 1)));
    EXPECT_FALSE(std::isfinite(inverse[0][0] + inverse[1][1]));  // the naive formula
}

}  // namespace
}  // namespace stipple
