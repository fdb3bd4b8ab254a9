#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <limits>

#include "apps/grow/grow.h"
#include "apps/grow/scan_scene.h"
#include "engine/base/executor.h"
#include "engine/base/process.h"
#include "engine/base/rng.h"

namespace stipple::grow {
namespace {

using glm::dvec3;
using scan::Hit, scan::Lanes, scan::Scene, scan::kExtent, scan::kLanes;

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
/// By the widest vectors that this machine has, up to that many bytes; the numbers are the same.
Sound widestSound(int bytes) {
    if (bytes >= 64 && __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0)
        return soundByEights;
    return bytes >= 32 && __builtin_cpu_supports("avx2") != 0 ? soundByFours : soundAnywhere;
}
#else
Sound widestSound(int) { return soundAnywhere; }
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
        : scene_(scene),
          options_(options),
          o_(o),
          position_(position),
          rows_(rows),
          columns_(columns),
          sound_(widestSound(options.vectorBytes)) {}

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
    Sound sound_;
    std::array<Lane, kLanes> lanes_;
};

}  // namespace

std::vector<ScanPoint> growScan(const ScanOptions& options) {
    const Scene scene(options.seed);
    const int positions = std::max(1, options.positions);
    const double aspect = 360.0 / 130.0;
    const auto castAll = [&](uint64_t rows, std::vector<ScanPoint>& out) {
        const auto columns = static_cast<uint64_t>(static_cast<double>(rows) * aspect);
        std::vector<std::vector<ScanPoint>> parts(rows * static_cast<uint64_t>(positions));
        const auto executor = makeTbbExecutor(options.threads);
        const uint64_t groups = (rows + kLanes - 1) / kLanes;
        executor->parallelFor(groups * static_cast<uint64_t>(positions), 1, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end && !isStopRequested(); ++i) {
                const uint64_t first = i % groups * kLanes;
                const auto position = static_cast<int>(i / groups);
                RowCaster(scene, options, scene.scanner(position, positions), position, rows, columns)
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
