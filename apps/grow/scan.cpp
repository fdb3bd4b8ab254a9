#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <limits>

#include "apps/grow/grow.h"
#include "engine/base/box_tree.h"
#include "engine/base/executor.h"
#include "engine/base/process.h"
#include "engine/base/rng.h"

namespace stipple::grow {
namespace {

using glm::dvec3;

constexpr double kExtent = 30;  ///< metres, half
constexpr size_t kLanes = 16;   ///< rays side by side that look for the ground together
using Lanes = std::array<double, kLanes>;
constexpr double kMaximumRange = 60;

/// Of a corner of a cell of noise, in [-1, 1].
double cornerOf(int64_t x, int64_t y, uint64_t seed) {
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
double noise(double x, double y, uint64_t seed) {
    return noiseOf(x, y, [seed](int32_t cx, int32_t cy) { return cornerOf(cx, cy, seed); });
}
double fractal(double x, double y, uint64_t seed, int octaves) {
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

    [[gnu::always_inline]] void groundLanes(const Lanes& x, const Lanes& y, Lanes& out) const {
        out = {};
        hills_.addTo(x, y, 1.1, out);
        tufts_.addTo(x, y, 0.03, out);
    }

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

/// How high the ground is under places of rays.
struct Soundings {
    Lanes x{}, y{};  ///< directions
    Lanes t{}, height{};
};
[[gnu::always_inline]] inline void sound(const Scene& scene, const dvec3& o, Soundings& s) {
    Lanes x, y;
    for (size_t i = 0; i < kLanes; ++i) {
        x[i] = std::min(std::max(o.x + s.t[i] * s.x[i], -kExtent), kExtent);
        y[i] = std::min(std::max(o.y + s.t[i] * s.y[i], -kExtent), kExtent);
    }
    scene.groundLanes(x, y, s.height);
}
using Sound = void (*)(const Scene& scene, const dvec3& o, Soundings& s);
void soundAnywhere(const Scene& scene, const dvec3& o, Soundings& s) { sound(scene, o, s); }
#if defined(__x86_64__)
[[gnu::target("avx2")]] void soundByFours(const Scene& scene, const dvec3& o, Soundings& s) { sound(scene, o, s); }
[[gnu::target("avx512f,avx512dq,avx512vl")]] void soundByEights(const Scene& scene, const dvec3& o, Soundings& s) {
    sound(scene, o, s);
}
/// By the widest vectors that this machine has; the numbers are the same.
Sound widestSound() {
    if (__builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0) return soundByEights;
    return __builtin_cpu_supports("avx2") != 0 ? soundByFours : soundAnywhere;
}
#else
Sound widestSound() { return soundAnywhere; }
#endif

/// A ray on its way to the ground: in steps until it is below, then the last one is halved.
class GroundSearch {
  public:
    GroundSearch() = default;
    GroundSearch(const dvec3& o, const dvec3& d, double limit) : o_(o), d_(d), limit_(limit) {}
    /// Where the ground is asked for next.
    double next() const {
        return phase_ == Phase::starts    ? from_
               : phase_ == Phase::marches ? from_ + std::max(0.02, 0.4 * above_)
                                          : 0.5 * (from_ + to_);
    }
    /// `height`: of the ground there. True: it is over.
    bool take(double t, double height) {
        const dvec3 p = o_ + t * d_;
        if (phase_ == Phase::halves) {
            (p.z < height ? to_ : from_) = t;
            return --left_ == 0;
        }
        const double above = p.z - height;
        if (phase_ == Phase::marches) {
            if (std::abs(p.x) > kExtent || std::abs(p.y) > kExtent) return true;
            if (above < 0) {
                to_ = t;
                phase_ = Phase::halves;
                return false;
            }
        }
        phase_ = Phase::marches;
        from_ = t;
        above_ = above;
        return !(t < limit_);
    }
    /// Once it is over; not below the limit: there is none.
    double found() const { return left_ == 0 ? to_ : std::numeric_limits<double>::infinity(); }

  private:
    enum class Phase : uint8_t { starts, marches, halves };
    dvec3 o_{0}, d_{0};
    double limit_ = 0, from_ = 0.5, to_ = 0, above_ = 0;
    int left_ = 24;
    Phase phase_ = Phase::starts;
};

/// Rows of rays from one place, one per elevation. Each has its own generator, so that rows can run in parallel, and
/// side by side: each in a lane, at its own pace.
class RowCaster {
  public:
    RowCaster(const Scene& scene, const ScanOptions& options, const dvec3& o, int position, uint64_t rows,
              uint64_t columns)
        : scene_(scene), options_(options), o_(o), position_(position), rows_(rows), columns_(columns) {}

    void cast(uint64_t first, std::vector<ScanPoint>* out) {
        const size_t count = std::min<uint64_t>(kLanes, rows_ - first);
        Soundings s;
        size_t onTheirWay = count;
        for (size_t i = 0; i < count; ++i) {
            const uint64_t row = first + i;
            Lane& lane = lanes_[i];
            lane.rng = Rng(options_.seed * 1315423911u + static_cast<uint64_t>(position_) * 2654435761u + row);
            const double elevation =
                (-60.0 + 130.0 * (static_cast<double>(row) + 0.5) / static_cast<double>(rows_)) * 0.017453292519943295;
            lane.level = std::cos(elevation);
            lane.rise = std::sin(elevation);
            begin(lane);
        }
        while (onTheirWay > 0) {
            for (size_t i = 0; i < count; ++i) {
                s.x[i] = lanes_[i].direction.x;
                s.y[i] = lanes_[i].direction.y;
                s.t[i] = lanes_[i].search.next();
            }
            sound_(scene_, o_, s);
            for (size_t i = 0; i < count; ++i) {
                Lane& lane = lanes_[i];
                if (lane.column == columns_ || !lane.search.take(s.t[i], s.height[i])) continue;
                finish(lane, out[i]);
                if (++lane.column < columns_)
                    begin(lane);
                else
                    --onTheirWay;
            }
        }
    }

  private:
    struct Lane {
        Rng rng{0};
        double level = 0, rise = 0;  ///< cosine and sine of the elevation
        uint64_t column = 0;
        dvec3 direction{0};
        Hit hit;
        GroundSearch search;
    };
    void begin(Lane& lane) const {
        const double azimuth = 6.283185307179586 * (static_cast<double>(lane.column) + lane.rng.uniform(-0.05, 0.05)) /
                               static_cast<double>(columns_);
        lane.direction = {std::cos(azimuth) * lane.level, std::sin(azimuth) * lane.level, lane.rise};
        lane.hit = scene_.traceThings(o_, lane.direction);
        lane.search = {o_, lane.direction, lane.hit.t};
    }
    void finish(Lane& lane, std::vector<ScanPoint>& out) const {
        Hit& hit = lane.hit;
        const double t = lane.search.found();
        if (t < hit.t) hit = scene_.groundAt(t, o_ + t * lane.direction);
        if (hit.material < 0) return;
        const dvec3 p = o_ + (hit.t + options_.noiseMetres * lane.rng.normal()) * lane.direction;
        const dvec3 colour = glm::clamp(scene_.colourAt(hit, o_ + hit.t * lane.direction) * 255.0 + 0.5, 0.0, 255.0);
        out.push_back(
            {{p.x, p.y, p.z},
             {static_cast<uint8_t>(colour.x), static_cast<uint8_t>(colour.y), static_cast<uint8_t>(colour.z)}});
    }

    const Scene& scene_;
    const ScanOptions& options_;
    dvec3 o_;
    int position_;
    uint64_t rows_, columns_;
    Sound sound_ = widestSound();
    std::array<Lane, kLanes> lanes_;
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
    const double aspect = 360.0 / 130.0;
    const auto castAll = [&](uint64_t rows, std::vector<ScanPoint>& out) {
        const auto columns = static_cast<uint64_t>(static_cast<double>(rows) * aspect);
        std::vector<std::vector<ScanPoint>> parts(rows * static_cast<uint64_t>(positions));
        const auto executor = makeTbbExecutor(0);
        const uint64_t groups = (rows + kLanes - 1) / kLanes;
        executor->parallelFor(groups * static_cast<uint64_t>(positions), 1, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end && !isStopRequested(); ++i) {
                const uint64_t first = i % groups * kLanes;
                const auto position = static_cast<int>(i / groups);
                RowCaster(scene, options, scanner(position), position, rows, columns)
                    .cast(first, &parts[i / groups * rows + first]);
            }
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
