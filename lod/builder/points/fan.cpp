#include "lod/builder/points/fan.h"

#include <algorithm>
#include <cmath>

#include "engine/base/wide.h"

namespace stipple::lod {
namespace {

constexpr size_t kVectors = Fan::kRays / kLanes;
constexpr float kFar = 3e38f;

/// Directions of the rays; the first once more behind the last.
struct Rays {
    alignas(64) std::array<float, Fan::kRays + 1> c, s;
    Rays() {
        for (size_t k = 0; k <= Fan::kRays; ++k) {
            const double a = 6.283185307179586 * static_cast<double>(k) / Fan::kRays;
            c.at(k) = static_cast<float>(std::cos(a));
            s.at(k) = static_cast<float>(std::sin(a));
        }
    }
};
const Rays kFan;

/// Corners of what is open between a ray and the next one: at the place as far as it is held, and at the rim.
struct Open {
    std::array<float, 4> x, y;
    [[gnu::always_inline]] Open(size_t ray, float in, float rim) {
        for (size_t k = 0; k < 2; ++k) {
            x[k] = in * kFan.c[ray + k];
            y[k] = in * kFan.s[ray + k];
            x[2 + k] = rim * kFan.c[ray + k];
            y[2 + k] = rim * kFan.s[ray + k];
        }
    }
    /// Squared distances from the centres of circles to the farthest corner.
    [[gnu::always_inline]] void farthest(const Circles& circles, size_t first, Floats& most) const {
        const Floats u = floatsAt(circles.u.data(), first).v, v = floatsAt(circles.v.data(), first).v;
        most = Floats{};
        for (size_t k = 0; k < 4; ++k) {
            const Floats du = x[k] - u, dv = y[k] - v, off2 = du * du + dv * dv;
            most = off2 > most ? off2 : most;
        }
    }
};

}  // namespace

/// `held`: how far out the disc is held between each ray and the next; farther where a circle begins there and reaches
/// on. Returns the least.
STIPPLE_WIDE static float holdBetweenRays(float* held, const Circles& circles, float radius, float rim,
                                          bool untilHeld) {
    Floats holds[kVectors];  // NOLINT: vectors
    for (size_t k = 0; k < kVectors; ++k) holds[k] = floatsAt(held, k * kLanes).v;
    for (size_t i = 0; i < circles.count; ++i) {
        const float u = circles.u[i], v = circles.v[i], r = circles.radius[i], c2 = u * u + v * v, power = r * r - c2;
        if (power > 0 && r > radius && c2 < (r - radius) * (r - radius)) {
            for (Floats& h : holds) h = Floats{} + rim;
            if (untilHeld) break;
            continue;
        }
        // A ray that misses the circle enters and leaves it at one place, which holds nothing.
        Floats enter[kVectors + 1], leave[kVectors + 1];  // NOLINT
        for (size_t k = 0; k < kVectors; ++k) {
            const Floats along = u * floatsAt(kFan.c.data(), k * kLanes).v + v * floatsAt(kFan.s.data(), k * kLanes).v;
            Floats half = power + along * along;
            half = half > 0 ? half : Floats{};
            takeRoots(half);
            enter[k] = along - half;
            leave[k] = along + half;
        }
        enter[kVectors] = enter[0];
        leave[kVectors] = leave[0];
        Lanes isOpen{};
        for (size_t k = 0; k < kVectors; ++k) {
            const Floats nextEnter = __builtin_shufflevector(enter[k], enter[k + 1], 1, 2, 3, 4, 5, 6, 7, 8),
                         nextLeave = __builtin_shufflevector(leave[k], leave[k + 1], 1, 2, 3, 4, 5, 6, 7, 8);
            const Floats from = enter[k] > nextEnter ? enter[k] : nextEnter,
                         to = leave[k] < nextLeave ? leave[k] : nextLeave;
            const Floats reach = from <= holds[k] ? to : Floats{};
            holds[k] = reach > holds[k] ? reach : holds[k];
            isOpen |= holds[k] < rim;
        }
        if (untilHeld && !isAny(isOpen)) break;
    }
    Floats least = holds[0];
    for (size_t k = 0; k < kVectors; ++k) {
        floatsAt(held, k * kLanes).v = holds[k];
        least = holds[k] < least ? holds[k] : least;
    }
    return leastOf(least);
}

/// Of what is open between two rays, all that one of the circles to be tried there holds. True: that is all.
STIPPLE_WIDE static bool closeBetweenRays(float* held, const Circles& circles, const Circles::Range* tried, float rim) {
    bool isHeld = true;
    for (size_t k = 0; k < Fan::kRays; ++k) {
        if (held[k] >= rim) continue;
        const Open open(k, held[k], rim);
        const size_t last = tried[k].last;
        for (size_t i = tried[k].first; i < last; i += kLanes) {
            Floats most;
            open.farthest(circles, i, most);
            const Floats radius = floatsAt(circles.radius.data(), i).v;
            if (!isAny((most < radius * radius) & (kLaneNumbers < static_cast<int32_t>(last - i)))) continue;
            held[k] = rim;
            break;
        }
        isHeld = isHeld && held[k] >= rim;
    }
    return isHeld;
}

/// By how much the circle that lacks least lacks what is open between two rays, at most.
STIPPLE_WIDE static float mostLacking(const float* held, const Circles& circles, float rim) {
    float most = 0;
    for (size_t k = 0; k < Fan::kRays; ++k) {
        if (held[k] >= rim) continue;
        const Open open(k, held[k], rim);
        Floats least = Floats{} + kFar;
        for (size_t i = 0; i < circles.count; i += kLanes) {
            Floats lacks;
            open.farthest(circles, i, lacks);
            takeRoots(lacks);
            lacks -= floatsAt(circles.radius.data(), i).v;
            lacks = kLaneNumbers < static_cast<int32_t>(circles.count - i) ? lacks : Floats{} + kFar;
            least = lacks < least ? lacks : least;
        }
        most = std::max(most, leastOf(least));
    }
    return most;
}

bool Fan::add(const Circles& circles) { return holdBetweenRays(held_.data(), circles, radius_, rim_, true) >= rim_; }
float Fan::addAll(const Circles& circles) {
    return holdBetweenRays(held_.data(), circles, radius_, rim_, false) * kNarrowest;
}
const Fan::Middles& Fan::middlesOfRays() {
    static const Middles kMiddles = [] {
        Middles m;
        for (size_t k = 0; k < kRays; ++k) {
            m.x.at(k) = 0.5f * (kFan.c.at(k) + kFan.c.at(k + 1));
            m.y.at(k) = 0.5f * (kFan.s.at(k) + kFan.s.at(k + 1));
        }
        return m;
    }();
    return kMiddles;
}
bool Fan::closeBy(const Circles& circles, const std::array<Circles::Range, kRays>& tried) {
    return closeBetweenRays(held_.data(), circles, tried.data(), rim_);
}
float Fan::missing(const Circles& circles) const { return mostLacking(held_.data(), circles, rim_); }

}  // namespace stipple::lod
