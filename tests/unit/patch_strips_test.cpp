// Strips of the cpu backend, which draws the triangles of 16 cells at once, against those triangles one by one.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <vector>

#include "engine/base/rng.h"
#include "engine/cpu/kernels.h"

namespace stipple {
namespace {

struct Keys {
    std::vector<uint64_t> keys;
    std::vector<uint8_t> runs;
};

/// A block of a patch with holes, and the same triangles as a cluster: lane by lane, what is not there being a point.
struct PiercedBlock {
    shared::PatchBlock patch{};
    std::vector<shared::MeshVertex> vertices;
    std::vector<uint32_t> triangles;
    explicit PiercedBlock(Rng& rng) {
        const auto steep = 1 + rng.below(4000);
        for (uint32_t& word : patch.heights)
            word = static_cast<uint32_t>(1 + rng.below(steep)) | static_cast<uint32_t>(1 + rng.below(steep)) << 16;
        for (uint32_t& word : patch.cells) word = static_cast<uint32_t>(rng.below(uint64_t{1} << 32));
        patch.place = 16 | 8 << 16;
        const auto height = [&](uint32_t s) {
            return static_cast<int>(patch.heights[s / 2] >> (16 * (s % 2)) & 0xffffu);
        };
        for (uint32_t s = 0; s < shared::kPatchSamples; ++s) {
            shared::MeshVertex v{};
            v.x = 16 + static_cast<int>(s % shared::kPatchStride);
            v.y = 8 + static_cast<int>(s / shared::kPatchStride);
            v.z = height(s);
            v.surface = shared::kSurfaceTwoSided;
            vertices.push_back(v);
        }
        for (uint32_t lane = 0; lane < shared::kPatchTriangles; ++lane) {
            const uint32_t cell = lane / 2, at = 17 * (cell / 16) + cell % 16;
            const bool isDrawn = (patch.cells[cell / 32] >> cell % 32 & 1u) != 0;
            triangles.push_back(isDrawn ? shared::patchTriangle(at, height(at), height(at + 1), height(at + 17),
                                                                height(at + 18), lane % 2)
                                        : 0);
        }
    }
};

/// Where `size` is pixels a cell. Some reach beyond the picture, or before the near plane.
shared::DrawMesh anywhere(Rng& rng, const shared::FrameConstants& f, double size) {
    const auto direction = [&] { return glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())); };
    const glm::dvec3 u = direction(), v = glm::normalize(glm::cross(u, direction())), n = glm::cross(u, v);
    const double z = rng.uniform(2, 50), pixel = (f.orthographic != 0 ? 1 : z) / static_cast<double>(f.focal);
    const double width = f.width, height = f.height, step = size * pixel;
    const glm::dvec3 middle(rng.uniform(-0.7, 0.7) * width * pixel, rng.uniform(-0.7, 0.7) * height * pixel, z);
    shared::DrawMesh m{};
    const auto set = [](shared::vec3& to, const glm::dvec3& from) {
        to = {static_cast<float>(from.x), static_cast<float>(from.y), static_cast<float>(from.z)};
    };
    set(m.axisX, step * u);
    set(m.axisY, step * v);
    set(m.axisZ, step / 1000 * n);
    set(m.base, middle);
    m.eyeX = 24;
    m.eyeY = 12;
    m.mirror = 1;
    return m;
}

// Sixteen side by side, strips are what their triangles are one by one, to the last bit of keys and runs.
TEST(PatchStrips, AreTheirTrianglesOneByOne) {
    size_t count = 0;
    const cpu::Kernels* const* available = cpu::availableKernels(count);
    for (size_t k = 0; k < 2 * count; ++k) {
        const bool isOrthographic = k >= count;
        const cpu::Kernels& kernels = isOrthographic ? *available[k - count]->orthographic : *available[k];
        SCOPED_TRACE(kernels.name);
        Rng rng(7);
        size_t covered = 0;
        // In the smallest pictures triangles of any size show a few pixels.
        constexpr std::array<std::array<uint32_t, 2>, 3> kSizes{{{96, 64}, {8, 8}, {5, 7}}};
        for (size_t round = 0; round < 1200; ++round) {
            const auto& [width, height] = kSizes.at(round % kSizes.size());
            shared::FrameConstants f{};
            f.width = width;
            f.height = height;
            f.focal = static_cast<float>(rng.uniform(40, 300));
            f.centre = {0.5f * static_cast<float>(width), 0.5f * static_cast<float>(height)};
            f.nearPlane = 1;
            f.orthographic = isOrthographic ? 1 : 0;
            const PiercedBlock block(rng);
            const shared::DrawMesh mesh = anywhere(rng, f, std::exp2(rng.uniform(-3, 12)));
            cpu::MeshBlock cluster{};
            cluster.vertices = block.vertices.data();
            cluster.triangles = block.triangles.data();
            cluster.mesh = &mesh;
            cluster.counts = shared::kPatchSamples | shared::kPatchTriangles << 16;
            const cpu::PatchSource strips{&block.patch, &mesh, 0, 0};
            std::array<Keys, 2> pictures;
            for (size_t way = 0; way < 2; ++way) {
                Keys& p = pictures.at(way);
                std::vector<cpu::LargeTriangle> kept;
                p.keys.assign(size_t{f.width} * f.height, shared::kNoKey);
                p.runs.assign(p.keys.size() / cpu::Visibility::kRun + 1, 0);
                const cpu::Visibility to{p.keys.data(), p.runs.data()};
                const cpu::LargeSink sink{&kept, [](void* all, const cpu::LargeTriangle& t) {
                                              static_cast<std::vector<cpu::LargeTriangle>*>(all)->push_back(t);
                                          }};
                if (way == 0)
                    kernels.rasterPatch(f, strips, 512, sink, to);
                else
                    kernels.rasterCluster(f, nullptr, cluster, 512, sink, to);
                kernels.rasterLarge(f, kept.data(), kept.size(), 0, f.height - 1, to);
            }
            ASSERT_TRUE(pictures[0].keys == pictures[1].keys) << round;
            ASSERT_TRUE(pictures[0].runs == pictures[1].runs) << round;
            for (size_t i = 0; i < pictures[0].keys.size(); ++i)
                covered += pictures[0].keys[i] != shared::kNoKey ? 1 : 0;
        }
        EXPECT_GT(covered, 100'000u);
    }
}

}  // namespace
}  // namespace stipple
