// What the tests of kernels against the scalar formulas of shaders/shared have in common.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

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

}  // namespace stipple::test
