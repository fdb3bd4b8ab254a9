// Views in lattice space and the codes of allowed errors: what selectCut computes of one node.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "lod/cut.h"

namespace stipple::lod {

inline constexpr int32_t kCulled = std::numeric_limits<int32_t>::min();
inline constexpr int32_t kInside = -1'000'000;  // the eye is inside the sphere: only exact records are fine enough
inline constexpr int kStepsPerOctave = 32;      // resolution of tau; error codes have 8
inline constexpr int kLargestTauStep = 40 * kStepsPerOctave;

inline LocalView makeLocalView(const Hierarchy& h, const Instance& instance, const View& view) {
    LocalView local;
    const glm::dmat3 inverse = glm::transpose(instance.rotation);
    const double unitsPerStep = instance.scale * h.unit;
    local.eye = (inverse * (view.eye - instance.translation) / instance.scale - h.origin) / h.unit;
    local.forward = inverse * view.forward;
    const glm::dvec3 right = inverse * view.right, down = inverse * view.down;
    const double halfW = 0.5 * view.width, halfH = 0.5 * view.height, f = view.focalPixels;
    local.planes = {
        glm::normalize(right * f + local.forward * halfW), glm::normalize(-right * f + local.forward * halfW),
        glm::normalize(down * f + local.forward * halfH), glm::normalize(-down * f + local.forward * halfH)};
    local.nearPlane = view.nearPlane / unitsPerStep;
    local.focal = f;
    local.cosineCorner = f / std::sqrt(f * f + halfW * halfW + halfH * halfH);
    return local;
}

/// Allowed error of N at tau = 1 px as a code of 1/32 octave, rounded down; kCulled if N is out of view.
inline int32_t allowedError(const Hierarchy& h, const Node& node, const LocalView& view, double sway) {
    const glm::dvec3 d = node.centre - view.eye;
    const double r = node.radius + sway;
    const double depth = glm::dot(d, view.forward);
    if (depth + r < view.nearPlane) return kCulled;
    for (const glm::dvec3& plane : view.planes)
        if (glm::dot(d, plane) < -r) return kCulled;
    const double distance = glm::length(d);
    const double nearest = distance - r;
    if (!(nearest > 0)) return kInside;
    // cos(alpha + beta), alpha: axis to centre, beta: angular radius.
    const double cosAlpha = depth / distance, sinAlpha = std::sqrt(std::max(0.0, 1 - cosAlpha * cosAlpha));
    const double sinBeta = r / distance, cosBeta = std::sqrt(std::max(0.0, 1 - sinBeta * sinBeta));
    const double cosine = std::max(cosAlpha * cosBeta - sinAlpha * sinBeta, view.cosineCorner);
    const double allowed = nearest * cosine * cosine / view.focal;
    const double code = std::floor(kStepsPerOctave * std::log2(allowed / h.errors.smallest));
    if (std::isnan(code)) return kInside;  // of cameras so far off that distances are infinite
    return static_cast<int32_t>(std::clamp(code, -900'000.0, 900'000.0));
}

/// Allowed error code of a node at tau = 2^(step/32).
inline uint32_t codeAt(int32_t epsilon, int step) {
    const int32_t sum = epsilon + step;
    if (sum < 0) return 0;
    return std::min<uint32_t>(static_cast<uint32_t>(sum) / (kStepsPerOctave / 8), ErrorScale::kLargest);
}

}  // namespace stipple::lod
