// Faces of very many corners: the shape stays, and the time grows with the corners.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <numbers>

#include "engine/scene/polygon.h"
#include "engine/scene/scene.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/import/ply/mesh.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using Corners = std::vector<glm::dvec3>;

glm::dvec3 onCircle(double angle, double radius) {
    return {radius * std::cos(angle), radius * std::sin(angle), 0.3 * radius * std::cos(angle)};
}

/// Forty lobes; a comb; a spiral.
std::vector<Corners> shapes(int count) {
    std::vector<Corners> all(3);
    for (int i = 0; i < count; ++i) {
        const double turn = 2 * std::numbers::pi * i / count;
        all[0].push_back(onCircle(turn, 1 + 0.1 * std::sin(40 * turn)));
    }
    for (int i = 0; i < count / 2; ++i) all[1].emplace_back(i, i % 2 == 0 ? 1 : 100, 0);
    for (int i = count / 2; i-- > 0;) all[1].emplace_back(i, 0, 0);
    for (int i = 0; i < count / 2; ++i) all[2].push_back(onCircle(20.0 * i / count, 2 + 20.0 * i / count));
    for (int i = count / 2; i-- > 0;) all[2].push_back(onCircle(20.0 * i / count, 1 + 20.0 * i / count));
    return all;
}

glm::dvec3 areaOf(const Corners& corners) {
    glm::dvec3 sum(0);
    for (size_t i = 0; i < corners.size(); ++i)
        sum += 0.5 * glm::cross(corners[i] - corners[0], corners[(i + 1) % corners.size()] - corners[0]);
    return sum;
}

TEST(Polygon, TrianglesCoverItOnceWithItsSide) {
    for (const int count : {4, 6, 100, 1000})
        for (const Corners& polygon : shapes(count)) {
            const glm::dvec3 whole = areaOf(polygon);
            double sum = 0;
            const auto triangles = triangulatePolygon(polygon);
            EXPECT_EQ(triangles.size(), polygon.size() - 2);
            for (const auto& [a, b, c] : triangles) {
                const glm::dvec3 area = areaOf({polygon[a], polygon[b], polygon[c]});
                EXPECT_GE(glm::dot(area, whole), -1e-9) << "turned";
                sum += glm::length(area);
            }
            EXPECT_NEAR(sum, glm::length(whole), 1e-9 * sum) << count;
        }
    // What has no area, or crosses itself, ends as well.
    EXPECT_EQ(triangulatePolygon(Corners(50, glm::dvec3(1))).size(), 48u);
    Rng rng(1);
    Corners tangle;
    for (int i = 0; i < 500; ++i) tangle.emplace_back(rng.uniform(), rng.uniform(), rng.uniform());
    EXPECT_EQ(triangulatePolygon(tangle).size(), 498u);
}

TEST(Polygon, AnObjFaceOfManyCornersIsReadInOneGo) {
    constexpr int kCorners = 40'000;
    const test::TempFolder folder;
    const Corners ring = shapes(kCorners)[0];
    for (const bool isBackwards : {false, true}) {
        std::string text, face = "f";
        for (int i = 0; i < kCorners; ++i) {
            const glm::dvec3& p = ring[static_cast<size_t>(i)];
            text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
            face += fmt::format(" {}", isBackwards ? i - kCorners : i + 1);
        }
        test::spit(folder / "ring.obj", text + face + "\r\nf 1 2 3\n");
        const auto start = std::chrono::steady_clock::now();
        const auto read = readObj(folder / "ring.obj");
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        ASSERT_TRUE(read) << read.error().line();
        EXPECT_LT(seconds.count(), 5 * test::kSlower) << "it took 15 s";
        const Primitive& p = read->meshes.at(0).primitives.at(0);
        ASSERT_EQ(p.indices.size(), 3 * (kCorners - 2 + 1u));
        double sum = 0;
        for (size_t t = 0; t + 3 < p.indices.size(); t += 3) {
            const auto at = [&](size_t k) { return glm::dvec3(p.position[p.indices[t + k]]); };
            sum += glm::length(areaOf({at(0), at(1), at(2)}));
        }
        EXPECT_NEAR(sum, glm::length(areaOf(ring)), 1e-5 * sum);
    }
    // A corner that is not there spoils its own triangles only.
    std::string face = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf";
    for (int i = 0; i < 99; ++i) face += fmt::format(" {}", i % 3 + 1);
    test::spit(folder / "bad.obj", face + " 7\n");
    const auto bad = readObj(folder / "bad.obj");
    ASSERT_TRUE(bad) << bad.error().line();
    EXPECT_FALSE(bad->notes.empty());
}

TEST(Polygon, AScanWhoseFacesAreEmptyIsToldOfItsPoints) {
    const test::TempFolder folder;
    test::spit(folder / "range.ply",
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n");
    const auto source = lod::openPlyMesh(folder / "range.ply", 1 << 20, folder.path());
    ASSERT_TRUE(source);
    lod::MeshBuildSettings settings;
    settings.description.source = "range.ply";
    settings.description.materials.resize(1);
    Progress silent(false);
    const auto executor = makeSerialExecutor();
    const auto built = lod::buildMeshStore(*source, folder / "a.stipple", settings, *executor, silent);
    ASSERT_FALSE(built);
    EXPECT_NE(built.error().line().find("--only-points"), std::string::npos) << built.error().line();
}

}  // namespace
}  // namespace stipple::scene
