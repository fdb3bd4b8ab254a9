// Depth of triangles as the cpu kernels write it, against the plane that the triangles tile: the oracle is one division
// in fp64 and shares nothing with the kernels' edge functions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/base/rng.h"
#include "engine/cpu/kernels.h"

namespace stipple {
namespace {

constexpr double kFocal = 300, kDistance = 1 << 22;  // lattice steps
constexpr uint32_t kWidth = 16, kHeight = 12;
constexpr int kCells = 15;  // of a cluster, along an edge

/// A plane across the picture whose depth grows by `slope` along x: depth at the pixel coordinate px.
struct Plane {
    double distance = kDistance, slope = 0;
    double depthAt(double px) const { return distance / (1 - slope * (px - 0.5 * kWidth) / kFocal); }
};

struct Picture {
    std::vector<uint64_t> keys = std::vector<uint64_t>(size_t{kWidth} * kHeight, shared::kNoKey);
    std::vector<uint8_t> runs = std::vector<uint8_t>(kWidth * kHeight / cpu::Visibility::kRun + 1);
    float depthAt(size_t pixel) const { return shared::keyDepth(keys[pixel]); }
    bool isCovered(size_t pixel) const { return keys[pixel] != shared::kNoKey; }
};

/// Tiles the picture with triangles of about `size` pixels, vertices off the grid by a third of that.
void drawPlane(const cpu::Kernels& kernels, const Plane& plane, double size, uint32_t firstPlace, Picture& picture) {
    shared::FrameConstants frame{};
    frame.focal = static_cast<float>(kFocal);
    frame.centre = {0.5f * kWidth, 0.5f * kHeight};
    frame.width = kWidth;
    frame.height = kHeight;
    frame.nearPlane = 1;
    shared::DrawMesh mesh{};
    mesh.axisX = {1, 0, 0};
    mesh.axisY = {0, 1, 0};
    mesh.axisZ = {0, 0, 1};
    mesh.mirror = 1;
    const auto vertexAt = [&](int column, int row) {
        Rng rng((static_cast<uint64_t>(static_cast<uint32_t>(column)) << 32) ^ static_cast<uint32_t>(row));
        const double px = (column + (rng.uniform() - 0.5) * 0.66) * size - 1,
                     py = (row + (rng.uniform() - 0.5) * 0.66) * size - 1;
        const double z = plane.depthAt(px);
        shared::MeshVertex v{};
        v.x = static_cast<int>(std::lround((px - 0.5 * kWidth) / kFocal * z));
        v.y = static_cast<int>(std::lround((py - 0.5 * kHeight) / kFocal * z));
        v.z = static_cast<int>(std::lround(z));
        v.surface = shared::kSurfaceTwoSided;
        return v;
    };
    std::vector<shared::MeshVertex> vertices(size_t{kCells + 1} * (kCells + 1));
    std::vector<uint32_t> triangles;
    for (int y = 0; y < 8; ++y)  // (a cluster holds 256 triangles: half of the rows at a time)
        for (int x = 0; x < kCells; ++x) {
            const auto at = [](int column, int row) { return static_cast<uint32_t>(row * (kCells + 1) + column); };
            triangles.push_back(at(x, y) | at(x + 1, y) << 8 | at(x, y + 1) << 16);
            triangles.push_back(at(x + 1, y) | at(x + 1, y + 1) << 8 | at(x, y + 1) << 16);
        }
    const int columns = static_cast<int>((kWidth + 2) / size) + 1, rows = static_cast<int>((kHeight + 2) / size) + 1;
    const cpu::LargeSink none{nullptr, [](void*, const cpu::LargeTriangle&) { FAIL() << "no triangle is large"; }};
    for (int top = 0; top < rows; top += 8)
        for (int left = 0; left < columns; left += kCells) {
            for (int y = 0; y <= 8; ++y)
                for (int x = 0; x <= kCells; ++x)
                    vertices[static_cast<size_t>(y * (kCells + 1) + x)] = vertexAt(left + x, top + y);
            cpu::MeshBlock block{};
            block.vertices = vertices.data();
            block.triangles = triangles.data();
            block.mesh = &mesh;
            block.counts = 9 * (kCells + 1) | static_cast<uint32_t>(triangles.size()) << 16;
            kernels.rasterCluster(frame, nullptr, block, firstPlace, none, {picture.keys.data(), picture.runs.data()});
        }
}

void forAllKernels(const std::function<void(const cpu::Kernels&)>& test) {
    size_t count = 0;
    const cpu::Kernels* const* all = cpu::availableKernels(count);
    for (size_t k = 0; k < count; ++k) {
        SCOPED_TRACE(all[k]->name);
        test(*all[k]);
    }
}

TEST(RasterDepth, IsThatOfThePlaneHoweverSmallTheTrianglesAre) {
    forAllKernels([](const cpu::Kernels& kernels) {
        for (const double slope : {0.0, 1.0, 10.0})
            for (const double size : {2.0, 0.5, 0.13, 0.03}) {
                const Plane plane{kDistance, slope};
                Picture picture;
                drawPlane(kernels, plane, size, 0, picture);
                std::vector<double> apart;  // from the plane, along its normal, pixels
                for (size_t i = 0; i < picture.keys.size(); ++i) {
                    ASSERT_TRUE(picture.isCovered(i)) << "a gap at pixel " << i;
                    const double z = plane.depthAt(static_cast<double>(i % kWidth) + 0.5);
                    apart.push_back(std::abs(picture.depthAt(i) - z) * kFocal / z / std::hypot(1, slope));
                }
                std::sort(apart.begin(), apart.end());
                EXPECT_LE(apart[apart.size() * 99 / 100], 0.01) << "triangles of " << size << " px, slope " << slope;
                EXPECT_LE(apart.back(), 0.1) << "triangles of " << size << " px, slope " << slope;
            }
    });
}

TEST(RasterDepth, ADenseSheetInFrontHidesWhatLiesBehindIt) {
    forAllKernels([](const cpu::Kernels& kernels) {
        constexpr uint32_t kSheet = 0, kBehind = 1u << 20;
        const double pixel = kDistance / kFocal;
        for (const double size : {0.13, 0.03}) {
            Picture picture;
            drawPlane(kernels, {kDistance, 0}, size, kSheet, picture);
            drawPlane(kernels, {kDistance + 0.05 * pixel, 0}, 4, kBehind, picture);
            size_t wrong = 0;
            for (const uint64_t key : picture.keys) wrong += shared::keyPlace(key, 0) >= kBehind ? 1 : 0;
            EXPECT_EQ(wrong, 0u) << "triangles of " << size << " px";
        }
    });
}

}  // namespace
}  // namespace stipple
