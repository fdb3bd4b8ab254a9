// Views in lattice space and the codes of allowed errors: what selectCut computes of one node.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "lod/cut/cut.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

inline constexpr int32_t kCulled = std::numeric_limits<int32_t>::min();
inline constexpr int32_t kInside = -1'000'000;   // the eye is inside the sphere: only exact records are fine enough
inline constexpr int32_t kAnyError = 1'000'000;  // of a node that is not refined
inline constexpr int kStepsPerOctave = 32;       // resolution of tau; error codes have 8
inline constexpr int kLargestTauStep = 40 * kStepsPerOctave;

inline LocalView makeLocalView(const Hierarchy& h, const Instance& instance, const View& view) {
    LocalView local;
    const glm::dmat3 inverse = glm::transpose(instance.rotation);
    const double unitsPerStep = instance.scale * h.unit;
    local.eye = (inverse * (view.eye - instance.translation) / instance.scale - h.origin) / h.unit;
    local.forward = inverse * view.forward;
    const glm::dvec3 right = inverse * view.right, down = inverse * view.down;
    const glm::dvec2 before = view.principal(), behind = glm::dvec2(view.width, view.height) - before;
    const double f = view.focalPixels;
    local.nearPlane = view.nearPlane / unitsPerStep;
    local.isOrthographic = view.isOrthographic;
    if (view.isOrthographic) {
        local.focal = f * unitsPerStep;
        local.planes = {right, -right, down, -down};
        local.off = {before.x / local.focal, behind.x / local.focal, before.y / local.focal, behind.y / local.focal};
        local.cosineCorner = 1;
        return local;
    }
    local.planes = {
        glm::normalize(right * f + local.forward * before.x), glm::normalize(-right * f + local.forward * behind.x),
        glm::normalize(down * f + local.forward * before.y), glm::normalize(-down * f + local.forward * behind.y)};
    local.focal = f;
    const glm::dvec2 farthest = glm::max(before, behind);
    local.cosineCorner = f / std::sqrt(f * f + farthest.x * farthest.x + farthest.y * farthest.y);
    return local;
}

/// Steps of the lattice that a pixel shows at the nearest place of a node.
inline double stepsPerPixel(const Node& node, const LocalView& view) {
    if (view.isOrthographic) return 1 / view.focal;
    return std::max(glm::length(node.centre - view.eye) - node.radius, view.nearPlane) / view.focal;
}

/// Room for the rounding of normals beyond the cone of a node, radians.
inline constexpr double kConeMargin = 0.05;

/// Do all discs of N and of the nodes below it face away from the eye? `d`: from the eye to the centre of N's sphere of
/// radius r, `distance` its length. A disc at p with normal n is not drawn if n.p >= 0 from the eye; |p - d| <= r, and
/// n is within the cone's half-angle of its axis, hence  n.p >= |d| cos(angle(axis, d) + half-angle) - r. Means of
/// normals stay in a cone, but each is rounded by up to 0.12 degrees once more: kConeMargin has room for 20 generations
/// of them.
inline bool facesAway(const Node& node, const glm::dvec3& d, double distance, double r) {
    if (!(node.normalConeCosine > 0)) return false;
    const glm::dvec3 axis(shared::octDecode(node.normalCone));
    const double along = glm::dot(axis, d);
    if (!(along > 0)) return false;
    const double between = std::acos(std::min(along / (glm::length(axis) * distance), 1.0));
    const double widest = between + std::acos(std::min(double{node.normalConeCosine}, 1.0)) + kConeMargin;
    return widest < 1.5 && distance * std::cos(widest) > r * (1 + 1e-6);
}
/// The same where all is seen along `forward`, wherever it lies: n.forward >= cos(angle(axis, forward) + half-angle).
inline bool facesAlong(const Node& node, const glm::dvec3& forward) {
    return facesAway(node, forward, glm::length(forward), 0);
}

/// How much longer wind makes a distance at most. It moves what stands `height` above the foot by sway (height / 2R)^2:
/// a shear of no more than 2 s with s = sway / 2R, whose largest singular value is s + sqrt(1 + s^2).
inline double longestIn(const Hierarchy& h, double sway) {
    const double s = sway / (2 * h.nodes[0].radius);
    return s + std::sqrt(1 + s * s);
}

/// Allowed error of N at tau = 1 px as a code of 1/32 octave, rounded down; kCulled if nothing of N can be seen.
inline int32_t allowedError(const Hierarchy& h, const Node& node, const LocalView& view, double sway) {
    const glm::dvec3 d = node.centre - view.eye;
    const double r = node.radius + sway, stretch = sway > 0 ? longestIn(h, sway) : 1;
    const double depth = glm::dot(d, view.forward);
    if (depth + r < view.nearPlane) return kCulled;
    if (view.isBeside(d, r)) return kCulled;
    if (view.isOrthographic) {
        if (!h.hasOverlappingCells() && facesAlong(node, view.forward)) return kCulled;
        const double code = std::floor(kStepsPerOctave * std::log2(1 / (view.focal * stretch * h.errors.smallest)));
        return std::isnan(code) ? kInside : static_cast<int32_t>(std::clamp(code, -900'000.0, 900'000.0));
    }
    const double distance = glm::length(d);
    const double nearest = distance - r;
    if (!(nearest > 0)) return kInside;
    // (Of curves the field of the cone holds another number.)
    if (!h.hasOverlappingCells() && facesAway(node, d, distance, r)) return kCulled;
    // cos(alpha + beta), alpha: axis to centre, beta: angular radius.
    const double cosAlpha = depth / distance, sinAlpha = std::sqrt(std::max(0.0, 1 - cosAlpha * cosAlpha));
    const double sinBeta = r / distance, cosBeta = std::sqrt(std::max(0.0, 1 - sinBeta * sinBeta));
    const double cosine = std::max(cosAlpha * cosBeta - sinAlpha * sinBeta, view.cosineCorner);
    const double allowed = nearest * cosine * cosine / view.focal / stretch;
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
