// What materials say between the vertices of a mesh is on the samples of its patches.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"
#include "shaders/shared/record.h"
#include "tests/support/patch_shapes.h"

namespace stipple {
namespace {

/// Sixteen large triangles, bent; texture coordinates are twice the place's x and y, against each other.
lod::TriangleMesh bentSheet() {
    lod::TriangleMesh mesh =
        test::sheet(4, 2, [](double u, double v) { return glm::dvec3(u, v, 0.2 * u * u + 0.1 * v); });
    mesh.uv.clear();
    for (const glm::dvec3& p : mesh.position) mesh.uv.emplace_back(2 * p.x, -2 * p.y);
    mesh.surface.assign(mesh.position.size(), 3);
    mesh.colour.assign(mesh.position.size(), 0xffffffffu);
    mesh.normal.clear();
    return mesh;
}

glm::vec3 waves(const glm::vec2& uv) {
    return {0.5f + 0.4f * std::sin(9 * uv.x), 0.5f + 0.4f * std::cos(7 * uv.y), 0.3f};
}

/// Largest difference between the colours of samples and `waves` at their places, in steps of 255.
int farthestOff(const lod::PatchSet& set) {
    int most = 0;
    for (const lod::Patch& patch : set.patches) {
        const lod::PatchSurface surface(patch);
        for (size_t s = 0; s < patch.heights.size(); ++s) {
            if (patch.heights[s] == 0) continue;
            const glm::dvec3 p = surface.position(s) + set.middle;
            if (std::min({p.x, p.y, 1 - p.x, 1 - p.y}) < 0) continue;  // beyond the border: what is near
            const glm::vec2 uv(2 * p.x, -2 * p.y);
            for (int a = 0; a < 3; ++a) {
                const int wanted = unitToByte(shared::srgbFromLinear(waves(uv)[a]));
                most = std::max(most, std::abs(wanted - static_cast<int>(patch.colours[s] >> (8 * a) & 255u)));
            }
        }
    }
    return most;
}

TEST(PatchLooks, ColoursBetweenVerticesAreOnTheSamples) {
    lod::PatchSettings settings;
    double least = 1e30, greatest = 0;
    settings.looks = [&](uint32_t surface, const glm::vec2& uv, float side) {
        EXPECT_EQ(surface, 3u);
        least = std::min(least, double{side});
        greatest = std::max(greatest, double{side});
        return lod::PlaceLook{waves(uv), {0, 0, 1}};
    };
    const lod::PatchSet set = test::patchesOf(bentSheet(), settings, 1);
    ASSERT_GT(set.samples, 10'000u);
    EXPECT_LE(farthestOff(set), 4);
    // A sample stands for a square of its step: twice that in texture coordinates, less where the sheet is steep.
    const double step = set.patches[0].step;
    EXPECT_LE(greatest, 2.0 * step * 1.001);
    EXPECT_GE(least, 2.0 * step / 1.12);
    // Control: without, the colours of the vertices.
    EXPECT_GT(farthestOff(test::patchesOf(bentSheet(), {}, 1)), 60);
}

TEST(PatchLooks, NormalMapsBendNormals) {
    lod::PatchSettings settings;
    settings.looks = [&](uint32_t, const glm::vec2&, float) {
        return lod::PlaceLook{glm::vec3(1), {0.3f, 0.4f, 0.866f}};
    };
    for (const bool isBent : {true, false}) {
        const lod::PatchSet set = test::patchesOf(bentSheet(), isBent ? settings : lod::PatchSettings{}, 1);
        double most = 0;
        size_t seen = 0;
        for (const lod::Patch& patch : set.patches) {
            const lod::PatchSurface surface(patch);
            for (size_t s = 0; s < patch.heights.size(); ++s) {
                const glm::dvec3 p = surface.position(s) + set.middle;
                const double cell = p.x * 4 - std::floor(p.x * 4);  // inside a row of triangles
                if (patch.heights[s] == 0 || p.x < 0 || p.x > 1 || p.y < 0 || p.y > 1 || cell < 0.05 || cell > 0.95)
                    continue;
                const double k = (std::floor(p.x * 4) + 0.5) / 2 * 0.2;  // slope of the chord between two columns
                const glm::dvec3 n = glm::normalize(glm::dvec3(-k, -0.1, 1));
                // Along u is along x, against v along y, both in the triangle's plane.
                const glm::dvec3 t = glm::normalize(glm::dvec3(1, 0, k)), b = glm::normalize(glm::dvec3(0, 1, 0.1));
                const glm::dvec3 wanted = glm::normalize(0.3 * t + 0.4 * b + 0.866 * n);
                const glm::dvec3 is = glm::normalize(surface.frame() * glm::dvec3(shared::octDecode(patch.normals[s])));
                most = std::max(most, std::acos(std::clamp(glm::dot(is, wanted), -1.0, 1.0)) * 180 / 3.14159265);
                ++seen;
            }
        }
        ASSERT_GT(seen, 5'000u);
        if (isBent) EXPECT_LT(most, 0.2);
        if (!isBent) EXPECT_GT(most, 25) << "the control";
    }
}

}  // namespace
}  // namespace stipple
