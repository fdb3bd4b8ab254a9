// What `grow scan` scans: hills, rocks, trees and a house, and how rays meet them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <vector>

#include "engine/base/box_tree.h"
#include "engine/base/rng.h"

namespace stipple::grow::scan {

using glm::dvec3;

inline constexpr double kExtent = 30;  ///< metres, half
inline constexpr size_t kLanes = 16;   ///< rays side by side that look for the ground together
using Lanes = std::array<double, kLanes>;
inline constexpr double kMaximumRange = 60;

/// Of a corner of a cell of noise, in [-1, 1].
inline double cornerOf(int64_t x, int64_t y, uint64_t seed) {
    Rng rng(seed ^ static_cast<uint64_t>(x) * 0x9e3779b1u ^ static_cast<uint64_t>(y) * 0x85ebca6bull << 20);
    rng.next();
    return rng.uniform(-1, 1);
}
[[gnu::always_inline]] inline int32_t floorOf(double v) {
    const auto whole = static_cast<int32_t>(v);
    return whole - (static_cast<double>(whole) > v ? 1 : 0);
}
/// Smooth value noise in [-1, 1]: corner(x, y) of the cell's corners.
template <typename Corner>
[[gnu::always_inline]] inline double noiseOf(double x, double y, const Corner& corner) {
    const int32_t cx = floorOf(x), cy = floorOf(y);
    const double u = x - static_cast<double>(cx), v = y - static_cast<double>(cy), su = u * u * (3 - 2 * u),
                 sv = v * v * (3 - 2 * v);
    return glm::mix(glm::mix(corner(cx, cy), corner(cx + 1, cy), su),
                    glm::mix(corner(cx, cy + 1), corner(cx + 1, cy + 1), su), sv);
}
inline double noise(double x, double y, uint64_t seed) {
    return noiseOf(x, y, [seed](int32_t cx, int32_t cy) { return cornerOf(cx, cy, seed); });
}
inline double fractal(double x, double y, uint64_t seed, int octaves) {
    double sum = 0, amplitude = 1;
    for (int i = 0; i < octaves; ++i, amplitude *= 0.5, x *= 2.03, y *= 2.03)
        sum += amplitude * noise(x, y, seed + static_cast<uint64_t>(i));
    return sum;
}

/// The same of one place's surroundings, whose corners are kept: rays ask for them again and again.
class KeptFractal {
  public:
    /// Of places up to `reach` from the origin, times `scale`.
    KeptFractal(double scale, uint64_t seed, int octaves, double reach) : scale_(scale) {
        double edge = reach * scale;
        for (int i = 0; i < octaves; ++i, edge *= 2.03) {
            Octave& o = octaves_.emplace_back();
            o.least = floorOf(-edge) - 1;
            o.count = floorOf(edge) + 3 - o.least;
            for (int32_t y = 0; y < o.count; ++y)
                for (int32_t x = 0; x < o.count; ++x)
                    o.corners.push_back(cornerOf(o.least + x, o.least + y, seed + static_cast<uint64_t>(i)));
        }
    }
    double operator()(double x, double y) const {
        x *= scale_;
        y *= scale_;
        double sum = 0, amplitude = 1;
        for (const Octave& o : octaves_) {
            sum += amplitude * noiseOf(x, y, o);
            amplitude *= 0.5;
            x *= 2.03;
            y *= 2.03;
        }
        return sum;
    }
    /// The same of several places side by side, times `share`, added to `out`.
    [[gnu::always_inline]] void addTo(Lanes x, Lanes y, double share, Lanes& out) const {
        Lanes sum{};
        for (size_t i = 0; i < kLanes; ++i) {
            x[i] *= scale_;
            y[i] *= scale_;
        }
        double amplitude = 1;
        for (const Octave& o : octaves_) {
            const auto corner = [ at = o.corners.data(), least = o.least, count = o.count ](int32_t cx, int32_t cy)
                __attribute__((always_inline)) {
                return at[(cy - least) * count + (cx - least)];
            };
#pragma GCC ivdep
            for (size_t i = 0; i < kLanes; ++i) {
                sum[i] += amplitude * noiseOf(x[i], y[i], corner);
                x[i] *= 2.03;
                y[i] *= 2.03;
            }
            amplitude *= 0.5;
        }
        for (size_t i = 0; i < kLanes; ++i) out[i] += share * sum[i];
    }

  private:
    struct Octave {
        int32_t least = 0, count = 0;
        std::vector<double> corners;  ///< from (least, least) on, row by row
        double operator()(int32_t cx, int32_t cy) const {
            return corners[static_cast<size_t>((cy - least) * count + (cx - least))];
        }
    };
    double scale_;
    std::vector<Octave> octaves_;
};

struct Hit {
    double t = kMaximumRange;
    dvec3 normal{0, 0, 1};
    int material = -1;  ///< 0 ground, 1 rock, 2 bark, 3 leaf, 4 wall, 5 roof
    uint64_t id = 0;
};

struct Sphere {
    dvec3 centre;
    double radius;
    int material;
};
struct Cone {  ///< round-less cone frustum between two points
    dvec3 a, b;
    double ra, rb;
};
struct Leaf {
    dvec3 centre, normal;
    double radius;
};

/// The ground, a house, and all else in a tree of boxes.
class Scene {
  public:
    explicit Scene(uint64_t seed)
        : seed_(seed),
          hills_(0.06, seed, 4, kExtent + 1),
          tufts_(1.7, seed + 9, 2, kExtent + 1),
          earth_(0.3, seed + 5, 3, kExtent + 1) {
        Rng rng(seed);
        for (int i = 0; i < 14; ++i) {
            const double x = rng.uniform(-20, 20), y = rng.uniform(-20, 20), r = rng.uniform(0.3, 1.1);
            spheres_.push_back({{x, y, ground(x, y) + 0.1 * r}, r, 1});
        }
        for (int i = 0; i < 16; ++i) {
            double x = 0, y = 0;
            do {
                x = rng.uniform(-22, 22);
                y = rng.uniform(-22, 22);
            } while (x > 2 && x < 15 && y > 2 && y < 13);  // not in the house
            plantTree(rng, {x, y, ground(x, y) - 0.1}, rng.uniform(6, 10));
        }
        std::vector<Box> boxes;
        const auto insert = [&](const dvec3& c, double r) {
            constexpr double kRounding = 1e-9;
            boxes.push_back({c - (r + kRounding), c + (r + kRounding)});
        };
        for (const Sphere& s : spheres_) insert(s.centre, s.radius);
        for (const Cone& k : cones_) insert(0.5 * (k.a + k.b), 0.5 * glm::length(k.b - k.a) + k.ra);
        for (const Leaf& l : leaves_) insert(l.centre, l.radius);
        tree_ = BoxTree(boxes);
    }

    /// At most a metre beyond kExtent.
    double ground(double x, double y) const { return 1.1 * hills_(x, y) + 0.03 * tufts_(x, y); }

    /// Scanner number `i` of so many.
    dvec3 scanner(int i, int count) const {
        const double a = 6.2831853 * i / count + 0.4, r = count == 1 ? 0 : 12;
        const double x = r * std::cos(a) - 2, y = r * std::sin(a) - 2;
        return {x, y, ground(x, y) + 1.7};
    }

    [[gnu::always_inline]] void groundLanes(const Lanes& x, const Lanes& y, Lanes& out) const {
        out = {};
        hills_.addTo(x, y, 1.1, out);
        tufts_.addTo(x, y, 0.03, out);
    }

    const std::vector<Sphere>& spheres() const { return spheres_; }
    const std::vector<Cone>& cones() const { return cones_; }
    const std::vector<Leaf>& leaves() const { return leaves_; }

    /// All but the ground.
    Hit traceThings(const dvec3& o, const dvec3& d) const {
        Hit hit;
        traceHouse(o, d, hit);
        traceTree(o, d, hit);
        return hit;
    }
    Hit groundAt(double t, const dvec3& q) const {
        const double e = 0.05;
        return {t,
                glm::normalize(dvec3(ground(q.x - e, q.y) - ground(q.x + e, q.y),
                                     ground(q.x, q.y - e) - ground(q.x, q.y + e), 2 * e)),
                0, 0};
    }

    dvec3 colourAt(const Hit& hit, const dvec3& p) const {
        const double n = fractal(p.x * 3, p.y * 3 + p.z * 2, seed_ + 31, 3);
        dvec3 c;
        switch (hit.material) {
            case 0:
                c = glm::mix(dvec3(0.25, 0.33, 0.12), dvec3(0.42, 0.34, 0.22),
                             std::clamp(0.5 + 0.6 * earth_(p.x, p.y), 0.0, 1.0));
                break;
            case 1:
                c = dvec3(0.45, 0.44, 0.42);
                break;
            case 2:
                c = dvec3(0.33, 0.24, 0.16);
                break;
            case 3:
                c = glm::mix(dvec3(0.16, 0.32, 0.08), dvec3(0.35, 0.45, 0.12), static_cast<double>(hit.id % 97) / 97.0);
                break;
            case 4:
                c = windowAt(p) ? dvec3(0.12, 0.16, 0.22)
                                : dvec3(0.78, 0.72, 0.6) * (std::fmod(std::abs(p.z) * 4, 1.0) < 0.06 ? 0.75 : 1.0);
                break;
            default:
                c = dvec3(0.55, 0.2, 0.14) * (std::fmod(std::abs(p.x) * 3, 1.0) < 0.12 ? 0.7 : 1.0);
                break;
        }
        return glm::clamp(c * (1.0 + 0.16 * n) * (0.75 + 0.25 * std::abs(hit.normal.z)), 0.0, 1.0);
    }

  private:
    void plantTree(Rng& rng, const dvec3& foot, double height) {
        dvec3 at = foot;
        double radius = height * 0.028;
        const int segments = 7;
        for (int s = 0; s < segments; ++s) {
            const dvec3 next = at + dvec3(rng.uniform(-0.12, 0.12), rng.uniform(-0.12, 0.12), height / segments);
            cones_.push_back({at, next, radius, radius * 0.8});
            if (s >= 2)
                for (int b = 0; b < 4; ++b) {
                    const double azimuth = rng.uniform(0, 6.2831853), length = height * 0.26 * (1.1 - 0.1 * s);
                    const dvec3 tip = next + dvec3(std::cos(azimuth) * length, std::sin(azimuth) * length,
                                                   rng.uniform(0.1, 0.5) * length);
                    cones_.push_back({next, tip, radius * 0.35, radius * 0.1});
                    for (int l = 0; l < 55; ++l) {
                        const dvec3 c = glm::mix(next, tip, rng.uniform(0.35, 1.1)) +
                                        0.35 * dvec3(rng.normal(), rng.normal(), rng.normal());
                        leaves_.push_back({c, glm::normalize(dvec3(rng.normal(), rng.normal(), 0.7 + rng.normal())),
                                           rng.uniform(0.05, 0.11)});
                    }
                }
            at = next;
            radius *= 0.8;
        }
    }

    static bool windowAt(const dvec3& p) {
        const double u = std::fmod(std::abs(p.x) + std::abs(p.y), 2.5);
        return p.z > 1.4 && p.z < 2.6 && u > 0.8 && u < 1.8;
    }

    void traceHouse(const dvec3& o, const dvec3& d, Hit& hit) const {
        const dvec3 lo(4, 4, -2), hi(13, 11, 3.4);
        const dvec3 a = (lo - o) / d, b = (hi - o) / d, enter = glm::min(a, b), leave = glm::max(a, b);
        const double t0 = std::max({enter.x, enter.y, enter.z}), t1 = std::min({leave.x, leave.y, leave.z});
        if (t0 > 0 && t0 < t1 && t0 < hit.t && enter.z < t0) {
            dvec3 n(0);
            n[enter.x == t0 ? 0 : 1] = 1;
            hit = {t0, n, 4, 0};
        }
        // Two roof planes over the ridge y = 7.5.
        for (const double side : {-1.0, 1.0}) {
            const dvec3& n = side < 0 ? roof_[0] : roof_[1];
            const double t = glm::dot(dvec3(8.5, 7.5, 6.6) - o, n) / glm::dot(d, n);
            const dvec3 p = o + t * d;
            if (t > 0 && t < hit.t && p.x > 3.6 && p.x < 13.4 && (p.y - 7.5) * side > 0 && (p.y - 7.5) * side < 3.9)
                hit = {t, n, 5, 0};
        }
        // Gables.
        for (const double x : {4.0, 13.0}) {
            const double t = (x - o.x) / d.x;
            const dvec3 p = o + t * d;
            if (t > 0 && t < hit.t && p.z >= 3.4 && p.z < 6.6 - std::abs(p.y - 7.5) / 1.1) hit = {t, {1, 0, 0}, 4, 0};
        }
    }

    void traceTree(const dvec3& o, const dvec3& d, Hit& hit) const {
        const auto spheres = static_cast<uint32_t>(spheres_.size()),
                   cones = spheres + static_cast<uint32_t>(cones_.size());
        tree_.visit(o, d, 0, hit.t, [&](uint32_t item) {
            if (item < spheres)
                traceSphere(spheres_[item], o, d, hit);
            else if (item < cones)
                traceCone(cones_[item - spheres], o, d, hit);
            else
                traceLeaf(item - cones, o, d, hit);
        });
    }

    static void traceSphere(const Sphere& s, const dvec3& o, const dvec3& d, Hit& hit) {
        const dvec3 m = o - s.centre;
        const double b = glm::dot(m, d), c = glm::dot(m, m) - s.radius * s.radius, q = b * b - c;
        if (q < 0) return;
        const double t = -b - std::sqrt(q);
        if (t > 0.3 && t < hit.t) hit = {t, (m + t * d) / s.radius, s.material, 0};
    }
    static void traceCone(const Cone& k, const dvec3& o, const dvec3& d, Hit& hit) {
        const dvec3 axis = k.b - k.a, m = o - k.a;
        const double l2 = glm::dot(axis, axis), slope = (k.rb - k.ra) / l2;
        const double md = glm::dot(m, axis), dd = glm::dot(d, axis);
        const double r0 = k.ra + slope * md, r1 = slope * dd;
        const double a = glm::dot(d, d) - dd * dd / l2 - r1 * r1, b = glm::dot(m, d) - md * dd / l2 - r0 * r1,
                     c = glm::dot(m, m) - md * md / l2 - r0 * r0, q = b * b - a * c;
        if (q < 0) return;
        const double t = (-b - std::sqrt(q)) / a, s = md + t * dd;
        if (t > 0.3 && t < hit.t && s > 0 && s < l2) hit = {t, glm::normalize(m + t * d - axis * (s / l2)), 2, 0};
    }
    void traceLeaf(uint32_t i, const dvec3& o, const dvec3& d, Hit& hit) const {
        const Leaf& leaf = leaves_[i];
        const double t = glm::dot(leaf.centre - o, leaf.normal) / glm::dot(d, leaf.normal);
        if (!(t > 0.3 && t < hit.t)) return;
        const dvec3 p = o + t * d - leaf.centre;
        if (glm::dot(p, p) < leaf.radius * leaf.radius) hit = {t, leaf.normal, 3, i};
    }

    uint64_t seed_;
    std::vector<Sphere> spheres_;
    std::vector<Cone> cones_;
    std::vector<Leaf> leaves_;
    const std::array<dvec3, 2> roof_{glm::normalize(dvec3(0, -1, 1.1)), glm::normalize(dvec3(0, 1, 1.1))};
    BoxTree tree_;  ///< spheres, cones and leaves, one after another
    KeptFractal hills_, tufts_, earth_;
};

}  // namespace stipple::grow::scan
