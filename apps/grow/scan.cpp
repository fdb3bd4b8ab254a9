#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <thread>

#include "apps/grow/grow.h"
#include "engine/base/executor.h"
#include "engine/base/process.h"
#include "engine/base/rng.h"

namespace stipple::grow {
namespace {

using glm::dvec3;

constexpr double kExtent = 30;  ///< metres, half
constexpr double kMaximumRange = 60;

/// Smooth value noise in [-1, 1]; a hash of the cell's corners.
double noise(double x, double y, uint64_t seed) {
    const double fx = std::floor(x), fy = std::floor(y);
    const auto corner = [&](double cx, double cy) {
        Rng rng(seed ^ static_cast<uint64_t>(static_cast<int64_t>(cx)) * 0x9e3779b1u ^
                static_cast<uint64_t>(static_cast<int64_t>(cy)) * 0x85ebca6bull << 20);
        rng.next();
        return rng.uniform(-1, 1);
    };
    const double u = x - fx, v = y - fy, su = u * u * (3 - 2 * u), sv = v * v * (3 - 2 * v);
    return glm::mix(glm::mix(corner(fx, fy), corner(fx + 1, fy), su),
                    glm::mix(corner(fx, fy + 1), corner(fx + 1, fy + 1), su), sv);
}
double fractal(double x, double y, uint64_t seed, int octaves) {
    double sum = 0, amplitude = 1;
    for (int i = 0; i < octaves; ++i, amplitude *= 0.5, x *= 2.03, y *= 2.03)
        sum += amplitude * noise(x, y, seed + static_cast<uint64_t>(i));
    return sum;
}

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

/// Everything that is not the ground, in a uniform grid over the plan.
class Scene {
  public:
    explicit Scene(uint64_t seed) : seed_(seed) {
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
        grid_.resize(size_t{kCells} * kCells);
        for (uint32_t i = 0; i < spheres_.size(); ++i) insert(spheres_[i].centre, spheres_[i].radius, i, 0);
        for (uint32_t i = 0; i < cones_.size(); ++i)
            insert(0.5 * (cones_[i].a + cones_[i].b), 0.5 * glm::length(cones_[i].b - cones_[i].a) + cones_[i].ra, i,
                   1);
        for (uint32_t i = 0; i < leaves_.size(); ++i) insert(leaves_[i].centre, leaves_[i].radius, i, 2);
    }

    double ground(double x, double y) const {
        return 1.1 * fractal(x * 0.06, y * 0.06, seed_, 4) + 0.03 * fractal(x * 1.7, y * 1.7, seed_ + 9, 2);
    }

    Hit trace(const dvec3& o, const dvec3& d) const {
        Hit hit;
        traceHouse(o, d, hit);
        traceGrid(o, d, hit);
        traceGround(o, d, hit);
        return hit;
    }

    dvec3 colourAt(const Hit& hit, const dvec3& p) const {
        const double n = fractal(p.x * 3, p.y * 3 + p.z * 2, seed_ + 31, 3);
        dvec3 c;
        switch (hit.material) {
            case 0:
                c = glm::mix(dvec3(0.25, 0.33, 0.12), dvec3(0.42, 0.34, 0.22),
                             std::clamp(0.5 + 0.6 * fractal(p.x * 0.3, p.y * 0.3, seed_ + 5, 3), 0.0, 1.0));
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
    static constexpr int kCells = 120;
    static constexpr double kCell = 2 * kExtent / kCells;

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

    void insert(const dvec3& c, double r, uint32_t index, uint32_t kind) {
        const auto cell = [](double v) { return std::clamp(static_cast<int>((v + kExtent) / kCell), 0, kCells - 1); };
        for (int y = cell(c.y - r); y <= cell(c.y + r); ++y)
            for (int x = cell(c.x - r); x <= cell(c.x + r); ++x)
                grid_[static_cast<size_t>(y) * kCells + static_cast<size_t>(x)].push_back(index << 2 | kind);
    }

    static bool windowAt(const dvec3& p) {
        const double u = std::fmod(std::abs(p.x) + std::abs(p.y), 2.5);
        return p.z > 1.4 && p.z < 2.6 && u > 0.8 && u < 1.8;
    }

    void traceGround(const dvec3& o, const dvec3& d, Hit& hit) const {
        double t = 0.5;
        double above = o.z + d.z * t - ground(o.x + d.x * t, o.y + d.y * t);
        while (t < hit.t) {
            const double step = std::max(0.02, 0.4 * above);
            const double next = t + step;
            const dvec3 p = o + next * d;
            if (std::abs(p.x) > kExtent || std::abs(p.y) > kExtent) return;
            const double nextAbove = p.z - ground(p.x, p.y);
            if (nextAbove < 0) {
                double lo = t, hi = next;
                for (int i = 0; i < 24; ++i) {
                    const double m = 0.5 * (lo + hi);
                    const dvec3 q = o + m * d;
                    (q.z < ground(q.x, q.y) ? hi : lo) = m;
                }
                if (hi >= hit.t) return;
                const dvec3 q = o + hi * d;
                const double e = 0.05;
                hit = {hi,
                       glm::normalize(dvec3(ground(q.x - e, q.y) - ground(q.x + e, q.y),
                                            ground(q.x, q.y - e) - ground(q.x, q.y + e), 2 * e)),
                       0, 0};
                return;
            }
            t = next;
            above = nextAbove;
        }
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
            const dvec3 n = glm::normalize(dvec3(0, side, 1.1));
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

    void traceGrid(const dvec3& o, const dvec3& d, Hit& hit) const {
        // Walk the plan's cells (Amanatides and Woo).
        int x = static_cast<int>(std::floor((o.x + kExtent) / kCell)),
            y = static_cast<int>(std::floor((o.y + kExtent) / kCell));
        const int stepX = d.x > 0 ? 1 : -1, stepY = d.y > 0 ? 1 : -1;
        const double deltaX = kCell / std::max(1e-12, std::abs(d.x)), deltaY = kCell / std::max(1e-12, std::abs(d.y));
        double nextX = ((x + (stepX > 0)) * kCell - kExtent - o.x) / d.x,
               nextY = ((y + (stepY > 0)) * kCell - kExtent - o.y) / d.y;
        double t = 0;
        while (x >= 0 && y >= 0 && x < kCells && y < kCells && t < hit.t) {
            for (const uint32_t item : grid_[static_cast<size_t>(y) * kCells + static_cast<size_t>(x)]) {
                if ((item & 3u) == 0)
                    traceSphere(spheres_[item >> 2], o, d, hit);
                else if ((item & 3u) == 1)
                    traceCone(cones_[item >> 2], o, d, hit);
                else
                    traceLeaf(item >> 2, o, d, hit);
            }
            if (nextX < nextY) {
                t = nextX;
                nextX += deltaX;
                x += stepX;
            } else {
                t = nextY;
                nextY += deltaY;
                y += stepY;
            }
        }
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
    std::vector<std::vector<uint32_t>> grid_;
};

}  // namespace

std::vector<ScanPoint> growScan(const ScanOptions& options) {
    const Scene scene(options.seed);
    const int positions = std::max(1, options.positions);
    const auto scanner = [&](int s) {
        const double a = 6.2831853 * s / positions + 0.4, r = positions == 1 ? 0 : 12;
        const double x = r * std::cos(a) - 2, y = r * std::sin(a) - 2;
        return dvec3(x, y, scene.ground(x, y) + 1.7);
    };
    // One row of rays per elevation; each row has its own generator, so rows can run in parallel.
    const auto castRow = [&](int s, uint64_t row, uint64_t rows, uint64_t columns, std::vector<ScanPoint>& out) {
        const dvec3 o = scanner(s);
        Rng rng(options.seed * 1315423911u + static_cast<uint64_t>(s) * 2654435761u + row);
        const double elevation =
            (-60.0 + 130.0 * (static_cast<double>(row) + 0.5) / static_cast<double>(rows)) * 0.017453292519943295;
        for (uint64_t c = 0; c < columns; ++c) {
            const double azimuth =
                6.283185307179586 * (static_cast<double>(c) + rng.uniform(-0.05, 0.05)) / static_cast<double>(columns);
            const dvec3 d(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                          std::sin(elevation));
            const Hit hit = scene.trace(o, d);
            if (hit.material < 0) continue;
            const dvec3 p = o + (hit.t + options.noiseMetres * rng.normal()) * d;
            const dvec3 colour = glm::clamp(scene.colourAt(hit, o + hit.t * d) * 255.0 + 0.5, 0.0, 255.0);
            out.push_back(
                {{p.x, p.y, p.z},
                 {static_cast<uint8_t>(colour.x), static_cast<uint8_t>(colour.y), static_cast<uint8_t>(colour.z)}});
        }
    };
    const double aspect = 360.0 / 130.0;
    const auto castAll = [&](uint64_t rows, std::vector<ScanPoint>& out) {
        const auto columns = static_cast<uint64_t>(static_cast<double>(rows) * aspect);
        std::vector<std::vector<ScanPoint>> parts(rows * static_cast<uint64_t>(positions));
        const auto executor = makeTbbExecutor(0);
        executor->parallelFor(parts.size(), 4, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end && !isStopRequested(); ++i)
                castRow(static_cast<int>(i / rows), i % rows, rows, columns, parts[i]);
        });
        for (const auto& part : parts) out.insert(out.end(), part.begin(), part.end());
    };
    std::vector<ScanPoint> points;
    const uint64_t pilotRows = 64;
    castAll(pilotRows, points);
    const double perRay = std::max(
        1e-3, static_cast<double>(points.size()) / (static_cast<double>(pilotRows * pilotRows) * aspect * positions));
    points.clear();
    const double rays = static_cast<double>(options.points) / perRay / positions;
    castAll(std::max<uint64_t>(1, static_cast<uint64_t>(std::ceil(std::sqrt(rays * 1.02 / aspect)))), points);
    // To the exact number, by dropping evenly.
    if (points.size() > options.points) {
        for (uint64_t i = 0; i < options.points; ++i)
            points[i] = points[static_cast<size_t>(static_cast<double>(i) * static_cast<double>(points.size()) /
                                                   static_cast<double>(options.points))];
        points.resize(options.points);
    }
    return points;
}

}  // namespace stipple::grow
