// What the tests of kernels against the scalar formulas of shaders/shared have in common.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "engine/base/rng.h"
#include "engine/cpu/kernels.h"
#include "shaders/shared/pyramid.h"

namespace stipple::test {

using namespace shared;

/// Floats between two of them; those of different sign are as far apart as both are from 0.
inline double ulpsBetween(float a, float b) {
    const auto place = [](float v) {
        const auto bits = std::bit_cast<int32_t>(v);
        return static_cast<double>(bits < 0 ? std::numeric_limits<int32_t>::min() - bits : bits);
    };
    return std::abs(place(a) - place(b));
}
inline float uniform(Rng& rng, double low, double high) { return static_cast<float>(rng.uniform(low, high)); }

inline FrameConstants frameOf(bool orthographic) {
    FrameConstants f{};
    f.focal = orthographic ? 90.0f : 700.0f;
    f.centre = {320, 240};
    f.width = 640;
    f.height = 480;
    f.nearPlane = 0.01f;
    f.supportScale = 1;
    f.minimumRadius = 1;
    f.orthographic = orthographic ? 1 : 0;
    f.viewX = {1, 0, 0};
    f.viewY = {0, 1, 0};
    f.viewZ = {0, 0, 1};
    return f;
}

/// A node with axes of any direction, evenly scaled, before the eye.
inline DrawNode randomNode(Rng& rng) {
    const glm::dvec3 x = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
    const glm::dvec3 y = glm::normalize(glm::cross(x, glm::dvec3(rng.normal(), rng.normal(), rng.normal())));
    const glm::dvec3 z = glm::cross(x, y);
    const double step = std::exp2(rng.uniform(-22, -14));
    DrawNode node{};
    node.axisX = glm::vec3(step * x);
    node.axisY = glm::vec3(step * y);
    node.axisZ = glm::vec3(step * z);
    node.base = {uniform(rng, -2, 2), uniform(rng, -2, 2), uniform(rng, 4, 9)};
    node.edge = static_cast<float>(65536 * step);
    node.errorCode = static_cast<uint32_t>(rng.below(256));
    node.octantMask = static_cast<uint32_t>(rng.below(256)) | kNodeTurned;
    node.count = kRecordsPerBlock;
    return node;
}
/// Of no tube.
inline Texel randomTexel(Rng& rng, bool mayBeEmpty) {
    Texel t;
    t.depth = mayBeEmpty && rng.uniform(0, 1) < 0.3 ? 0.0f : uniform(rng, 5, 6);
    t.radius = uniform(rng, 0.5, 9);
    t.thickness = t.radius * uniform(rng, 0.05, 1.2);
    t.offset = {uniform(rng, -1, 1), uniform(rng, -1, 1)};
    t.normalPerp = {uniform(rng, -0.7, 0.7), uniform(rng, -0.7, 0.7)};
    t.colour = {uniform(rng, 0, 1), uniform(rng, 0, 1), uniform(rng, 0, 1)};
    t.isRound = 0;
    t.axis = {0, 0};
    return t;
}
inline void put(cpu::TexelRow& row, size_t i, const Texel& t) {
    row.depth[i] = t.depth;
    row.radius[i] = t.radius;
    row.thickness[i] = t.thickness;
    row.x[i] = t.offset.x;
    row.y[i] = t.offset.y;
    row.perpX[i] = t.normalPerp.x;
    row.perpY[i] = t.normalPerp.y;
    row.red[i] = t.colour.x;
    row.green[i] = t.colour.y;
    row.blue[i] = t.colour.z;
}
inline double farthest(const cpu::TexelRow& row, size_t i, const Texel& t) {
    if (row.depth[i] == 0 && t.depth == 0) return 0;
    double worst = 0;
    for (const auto& [a, b] : {std::pair{row.depth[i], t.depth},
                               {row.radius[i], t.radius},
                               {row.thickness[i], t.thickness},
                               {row.x[i], t.offset.x},
                               {row.y[i], t.offset.y},
                               {row.perpX[i], t.normalPerp.x},
                               {row.perpY[i], t.normalPerp.y},
                               {row.red[i], t.colour.x},
                               {row.green[i], t.colour.y},
                               {row.blue[i], t.colour.z}})
        worst = std::max(worst, ulpsBetween(a, b));
    return worst;
}

/// Calls use(kernels, frame) for every instruction set of this machine and both kinds of view.
template <typename Use>
void forKernels(const Use& use) {
    size_t count = 0;
    const cpu::Kernels* const* const all = cpu::availableKernels(count);
    for (size_t k = 0; k < count; ++k)
        for (const bool orthographic : {false, true}) {
            SCOPED_TRACE(testing::Message() << all[k]->name << (orthographic ? ", orthographic" : ""));
            use(orthographic ? *all[k]->orthographic : *all[k], frameOf(orthographic));
        }
}

inline uint32_t wordOf(Rng& rng) { return static_cast<uint32_t>(rng.below(uint64_t{1} << 32)); }
/// Octahedral, of any direction.
inline uint32_t directionOf(Rng& rng) {
    return static_cast<uint32_t>(rng.below(65535)) | static_cast<uint32_t>(rng.below(65535)) << 16;
}

inline vec3 stretched(const vec3& v, float by) { return {v.x * by, v.y * by, v.z * by}; }
inline vec3 plus(const vec3& a, const vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline vec3 minus(const vec3& a, const vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

/// Blocks of all kinds have their ids in places of their own, so that a wrong range is seen.
inline FrameConstants withRanges(FrameConstants f) {
    f.firstBlock.of[kKindCurves] = 3;
    f.firstBlock.of[kKindTriangles] = 5;
    f.firstBlock.of[kKindPatches] = 9;  // none
    f.firstBlock.of[kKindDiscs] = 9;
    f.sunDirection = glm::normalize(glm::vec3(-0.45f, -0.55f, -0.7f));
    f.exactCurves = 2;
    return f;
}

/// Points of one block, of which a row shows some.
struct SomeShown {
    SomeShown(Rng& rng, double share) : node(randomNode(rng)), records(kRecordsPerBlock) {
        const auto word = [&] { return static_cast<uint32_t>(rng.below(uint64_t{1} << 32)); };
        for (PointRecord& r : records) {
            r = {word(), word(), word(), word()};
            r.normal = std::min(r.normal & 0xffffu, 65534u) | std::min(r.normal >> 16, 65534u) << 16;
        }
        for (uint64_t& key : keys)
            key = rng.uniform(0, 1) < share
                      ? visibilityKey(floatBitsToUint(uniform(rng, 3, 9)), rng.below(kRecordsPerBlock))
                      : kNoKey;
        keys[rng.below(cpu::kTile)] = visibilityKey(floatBitsToUint(5.0f), 0);  // one at least
        block = {.records = records.data(), .node = &node};
    }
    DrawNode node;
    std::vector<PointRecord> records;
    std::array<uint64_t, cpu::kTile> keys{};
    cpu::BlockSource block;
};

/// A row of pixels of one kind, resolved.
struct Resolved {
    std::vector<uint64_t> keys;
    std::vector<uint32_t> surface = std::vector<uint32_t>(cpu::kTile);
    float largest = 0;  ///< radius
    std::unique_ptr<cpu::TexelRow> row = std::make_unique<cpu::TexelRow>();
    std::unique_ptr<cpu::ClosedUpRow> closedUp = std::make_unique<cpu::ClosedUpRow>();

    void resolve(const cpu::Kernels& k, const FrameConstants& f, cpu::ResolveInput in, uint32_t x0, uint32_t y) {
        const cpu::Tables tables = cpu::makeTables();
        const std::array<cpu::ResolveKind, kKindNothing> none{};
        in.ofKind = none.data();
        row->hasTubes = true;
        ASSERT_TRUE(k.resolveRow(f, tables, in, keys.data(), x0, y, static_cast<uint32_t>(keys.size()), *row, *closedUp,
                                 largest, {surface.data(), nullptr, nullptr, nullptr}));
    }
};

}  // namespace stipple::test
