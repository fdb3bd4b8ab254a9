#include "lod/builder/points/covered.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "lod/builder/morton.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kMostCells = 64 * 64 * 64;  ///< of clusters in a node
/// Runs of a node's cells; empty between nodes.
thread_local std::vector<Around::Run> cellRuns;

/// Circles in a disc's plane, around its centre.
struct Circles {
    static constexpr size_t kMost = 1024;
    alignas(64) std::array<float, kMost> u, v, radius;
    size_t count = 0;
    void add(float atU, float atV, float r) {
        if (!(r > 0) || count == kMost) return;
        u[count] = atU;
        v[count] = atV;
        radius[count++] = r;
    }
};

struct DiscPlane {
    glm::dvec3 place;
    glm::vec3 n, t1, t2;
    float radius;
    explicit DiscPlane(const AggregateRecord& r) : place(r.place), n(r.normal), radius(r.radius) {
        t1 = glm::normalize(std::abs(n.x) < 0.7f ? glm::vec3(0, -n.z, n.y) : glm::vec3(-n.z, 0, n.x));
        t2 = glm::cross(n, t1);
    }
};

/// How far from its rim a part of a disc may be left so that a leaf is within `error`; -1: not at all.
float reachOf(float extent, float height, float hole, float error) {
    const float left = error * error - height * height;
    const float beside = (left > 0 ? std::sqrt(left) : -1) - hole;
    return beside >= 0 ? extent + beside : -1;
}
constexpr float kRounded = 1 - 1e-5f;

/// Appends the circles of the leaves `begin`, `begin + stride`, ... that are within `error` of one.
void addLeaves(const Around& around, const DiscPlane& plane, size_t begin, size_t end, size_t stride, float error,
               Circles& to) {
    constexpr size_t kBlock = 32;
    alignas(64) std::array<float, kBlock> us, vs, rs;
    const glm::vec3 o(plane.place - around.corner);
    const glm::vec3 n = plane.n, t1 = plane.t1, t2 = plane.t2;
    const float *const x = around.x.data(), *const y = around.y.data(), *const z = around.z.data(),
                       *const nx = around.nx.data(), *const ny = around.ny.data(), *const nz = around.nz.data(),
                       *const radius = around.radius.data();
    const float e2 = error * error;
    const auto one = [&](size_t i, size_t k) {
        const float dx = x[i] - o.x, dy = y[i] - o.y, dz = z[i] - o.z, r = radius[i];
        const float w = std::abs(dx * n.x + dy * n.y + dz * n.z);
        // A leaf without a normal (zero) turns with the view: its centre is there in all of them.
        const float dot = std::abs(nx[i] * n.x + ny[i] * n.y + nz[i] * n.z), along = dot < 1 ? dot : 1.0f;
        us[k] = dx * t1.x + dy * t1.y + dz * t1.z;
        vs[k] = dx * t2.x + dy * t2.y + dz * t2.z;
        // All of the leaf, or only its centre, which may be nearer to the plane than its rim.
        const float rim = w + r * std::sqrt(1 - along * along), rest = e2 - rim * rim, restCentre = e2 - w * w;
        const float all = r * along + std::sqrt(rest > 0 ? rest : 0),
                    centre = std::sqrt(restCentre > 0 ? restCentre : 0);
        rs[k] = (rest > 0 ? all : centre) * kRounded;
    };
    for (size_t first = begin; first < end; first += kBlock * stride) {
        const size_t count = std::min(kBlock, (end - first + stride - 1) / stride);
        if (stride == 1)
            for (size_t k = 0; k < count; ++k) one(first + k, k);
        else
            for (size_t k = 0; k < count; ++k) one(first + k * stride, k);
        if (to.count + count > Circles::kMost) return;
        // Those that reach the disc.
        for (size_t k = 0; k < count; ++k) {
            to.u[to.count] = us[k];
            to.v[to.count] = vs[k];
            to.radius[to.count] = rs[k];
            const float outside = rs[k] + plane.radius;
            // (Without a branch.)
            const unsigned isDisc = rs[k] > 0 ? 1 : 0,
                           reaches = us[k] * us[k] + vs[k] * vs[k] < outside * outside ? 1 : 0;
            to.count += isDisc & reaches;
        }
    }
}

/// Of a part of a node whose leaves are not at hand: its disc as far as its core.
struct Patch {
    float u, v, w, core, rise, below, hole;
    Patch(const DiscPlane& plane, const AggregateRecord& part) {
        const glm::vec3 d(part.place - plane.place);
        u = glm::dot(d, plane.t1);
        v = glm::dot(d, plane.t2);
        w = std::abs(glm::dot(d, plane.n));
        const bool isBall = (part.flags & shared::kFlagNoNormal) != 0;
        const float along = isBall ? 0.0f : std::min(std::abs(glm::dot(plane.n, part.normal)), 1.0f);
        const float sine = std::sqrt(1 - along * along), slab = std::max(part.above, part.below);
        core = part.core * along;
        rise = part.core * sine;
        // How far over or under a place of it and how far beside it the next leaf is, at most.
        below = std::max(slab * along + part.hole * sine, part.hole);
        hole = part.hole + slab * sine;
    }
};
void addParts(const Around& around, const DiscPlane& plane, size_t begin, size_t end, size_t stride, float error,
              Circles& to) {
    for (size_t i = begin; i < end; i += stride) {
        const Patch p(plane, around.parts[i]);
        to.add(
            p.u, p.v,
            std::max(reachOf(p.core, p.w + p.below + p.rise, p.hole, error), reachOf(0, p.w + p.below, p.hole, error)) *
                kRounded);
    }
}

/// Rays from the disc's centre, and how far out circles hold it between each two.
class Fan {
  public:
    explicit Fan(float radius) : radius_(radius), rim_(radius / kNarrowest) {}
    void add(float u, float v, float r) {
        const float c2 = u * u + v * v, power = r * r - c2;
        if (power > 0 && r > radius_ && c2 < (r - radius_) * (r - radius_)) {
            held_.fill(rim_);
            return;
        }
        // A ray that misses the circle enters and leaves it at one place, which holds nothing.
        alignas(64) std::array<float, kRays + 16> enter, leave;
        for (size_t k = 0; k < kRays; ++k) {
            const float along = u * kDirections.c[k] + v * kDirections.s[k], left = power + along * along;
            const float half = std::sqrt(left > 0 ? left : 0);
            enter[k] = along - half;
            leave[k] = along + half;
        }
        enter[kRays] = enter[0];
        leave[kRays] = leave[0];
        for (size_t k = 0; k < kRays; ++k) {
            const float from = enter[k] > enter[k + 1] ? enter[k] : enter[k + 1];
            const float to = leave[k] < leave[k + 1] ? leave[k] : leave[k + 1];
            const float reach = from <= held_[k] ? to : 0;
            held_[k] = reach > held_[k] ? reach : held_[k];
        }
    }
    /// Of what is still open between two rays, all that a single one of those circles holds. `circlesAt(u, v)`: which
    /// of them to try for that place of the rim, [first, last).
    template <typename CirclesAt>
    void close(const Circles& circles, const CirclesAt& circlesAt) {
        for (size_t k = 0; k < kRays; ++k) {
            if (held_[k] >= rim_) continue;
            const float c0 = kDirections.c[k], s0 = kDirections.s[k], c1 = kDirections.c[k + 1],
                        s1 = kDirections.s[k + 1], in = held_[k];
            const auto [first, last] = circlesAt(0.5f * (c0 + c1) * radius_, 0.5f * (s0 + s1) * radius_);
            int32_t isClosed = 0;
            for (size_t i = first; i < last; ++i) {
                const float u = circles.u[i], v = circles.v[i], r2 = circles.radius[i] * circles.radius[i];
                const auto off2 = [&](float x, float y) { return (x - u) * (x - u) + (y - v) * (y - v); };
                const float a = off2(in * c0, in * s0), b = off2(in * c1, in * s1), c = off2(rim_ * c0, rim_ * s0),
                            d = off2(rim_ * c1, rim_ * s1);
                const float near = a > b ? a : b, far = c > d ? c : d, most = near > far ? near : far;
                isClosed |= most < r2 ? 1 : 0;
            }
            if (isClosed != 0) held_[k] = rim_;
        }
    }
    /// By how much circles would have to be wider for a single one to hold what is open between each two rays, at most.
    float missing(const Circles& circles) const {
        float most = 0;
        for (size_t k = 0; k < kRays; ++k) {
            if (held_[k] >= rim_) continue;
            const float c0 = kDirections.c[k], s0 = kDirections.s[k], c1 = kDirections.c[k + 1],
                        s1 = kDirections.s[k + 1], in = held_[k];
            float least = 3e38f;
            for (size_t i = 0; i < circles.count; ++i) {
                const float u = circles.u[i], v = circles.v[i];
                const auto off2 = [&](float x, float y) { return (x - u) * (x - u) + (y - v) * (y - v); };
                const float a = off2(in * c0, in * s0), b = off2(in * c1, in * s1), c = off2(rim_ * c0, rim_ * s0),
                            d = off2(rim_ * c1, rim_ * s1);
                const float near = a > b ? a : b, far = c > d ? c : d;
                const float lacks = std::sqrt(near > far ? near : far) - circles.radius[i];
                least = lacks < least ? lacks : least;
            }
            most = least > most ? least : most;
        }
        return most;
    }
    bool isHeld() const { return least() >= rim_; }
    /// Radius of a disc that is held.
    float core() const { return least() * kNarrowest; }

  private:
    static constexpr size_t kRays = 32;
    static constexpr float kNarrowest = 0.99518f;  ///< cosine of half the angle between two rays
    float least() const {
        float least = 3e38f;
        for (size_t k = 0; k < kRays; ++k) least = held_[k] < least ? held_[k] : least;
        return least;
    }
    struct Directions {
        alignas(64) std::array<float, kRays + 1> c, s;
        Directions() {
            for (size_t k = 0; k <= kRays; ++k) {
                const double a = 6.283185307179586 * static_cast<double>(k) / kRays;
                c.at(k) = static_cast<float>(std::cos(a));
                s.at(k) = static_cast<float>(std::sin(a));
            }
        }
    };
    static const Directions kDirections;
    float radius_, rim_;
    alignas(64) std::array<float, kRays> held_{};
};
const Fan::Directions Fan::kDirections;

}  // namespace

Around::Around(const RecordGrid& g, Key key, uint32_t keyBits, const Leaves* from,
               std::span<const PendingNode> children)
    : grid(g), leaves(from), corner(g.base), firstCell_(key >> g.clusterShift) {
    if (leaves == nullptr) {
        std::vector<Key> keys;
        for (const PendingNode& child : children) {
            parts.insert(parts.end(), child.records.begin(), child.records.end());
            for (size_t k = 0; k < child.leaf.size(); ++k)
                parts.push_back(aggregateOfLeaf(child.leaf, k, child.leafKey[k]));
        }
        for (const AggregateRecord& p : parts) keys.push_back(p.key);
        number(keys);
        return;
    }
    const auto all = leaves->key.subspan(leaves->first, leaves->normal.size());
    const auto begin = std::lower_bound(all.begin(), all.end(), key),
               end = std::lower_bound(begin, all.end(), key + (Key{1} << keyBits));
    const size_t first = leaves->first + static_cast<size_t>(begin - all.begin()),
                 count = static_cast<size_t>(end - begin);
    for (auto* column : {&x, &y, &z, &nx, &ny, &nz, &radius}) column->resize(count);
    for (size_t k = 0; k < count; ++k) {
        const Points& p = leaves->points;
        x[k] = static_cast<float>(p.x[first + k] - corner.x);
        y[k] = static_cast<float>(p.y[first + k] - corner.y);
        z[k] = static_cast<float>(p.z[first + k] - corner.z);
        radius[k] = p.radius[first + k];
        const glm::vec3& n = leaves->normalOf(first + k);
        nx[k] = n.x;
        ny[k] = n.y;
        nz[k] = n.z;
    }
    number(std::span(begin, end));
}

void Around::number(std::span<const Key> keys) {
    cellRuns.resize(kMostCells);
    for (size_t i = 0; i < keys.size();) {
        const Key cell = keys[i] >> grid.clusterShift;
        const auto begin = static_cast<uint32_t>(i);
        while (i < keys.size() && keys[i] >> grid.clusterShift == cell) ++i;
        used_.push_back(static_cast<uint32_t>(cell - firstCell_));
        cellRuns[used_.back()] = {begin, static_cast<uint32_t>(i)};
    }
}
Around::~Around() {
    for (const uint32_t cell : used_) cellRuns[cell] = {};
}

Around::Run Around::at(Key key) const { return cellRuns[static_cast<size_t>((key >> grid.clusterShift) - firstCell_)]; }

uint32_t Around::cellAt(const glm::dvec3& place) const {
    const glm::dvec3 at = (place - grid.base) * (grid.cellsAcross / grid.edge);
    const double most = grid.cellsAcross;
    if (!(at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < most && at.y < most && at.z < most)) return kMostCells;
    return static_cast<uint32_t>(
        shortMortonCode(static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y), static_cast<uint32_t>(at.z)));
}
Around::Run Around::inCell(uint32_t cell) const { return cell < kMostCells ? cellRuns[cell] : Run{}; }

template <typename Use>
void Around::forBeside(Key key, const Use& use) const {
    const auto cell = static_cast<uint64_t>((key >> grid.clusterShift) - firstCell_);
    const double edge = grid.edge / grid.cellsAcross;
    std::array<std::array<uint64_t, 3>, 3> code{};
    const std::array<uint32_t, 3> at{static_cast<uint32_t>(compactShort(cell)),
                                     static_cast<uint32_t>(compactShort(cell >> 1)),
                                     static_cast<uint32_t>(compactShort(cell >> 2))};
    for (size_t a = 0; a < 3; ++a)
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t to = at[a] + static_cast<uint32_t>(k) - 1;  // (of -1: too large)
            code[a][k] = to < grid.cellsAcross ? spreadBits(to) << a : ~uint64_t{0};
        }
    for (size_t k = 0; k < 27; ++k) {
        const std::array<size_t, 3> to{k % 3, k / 3 % 3, k / 9};
        const uint64_t number = code[0][to[0]] | code[1][to[1]] | code[2][to[2]];
        if (number >= kMostCells || k == 13) continue;
        const Run run = cellRuns[number];
        if (run.begin == run.end) continue;
        const glm::dvec3 middle(at[0] + static_cast<double>(to[0]) - 0.5, at[1] + static_cast<double>(to[1]) - 0.5,
                                at[2] + static_cast<double>(to[2]) - 0.5);
        use(grid.base + edge * middle, 0.8661 * edge, run);
    }
}

namespace {

/// What a record's disc is held by at one error.
class Holding {
  public:
    Holding(const AggregateRecord& record, const Around& around) : around_(around), plane_(record), key_(record.key) {}
    /// `error`, or one that is enough: circles widen at least as fast as it.
    float heldWith(float error) {
        constexpr size_t kMostOwn = 64;
        Fan fan(plane_.radius);
        circles_.count = 0;
        add(around_.at(key_), kMostOwn, error);
        for (size_t k = 0; k < circles_.count; ++k) add(k, fan);
        if (fan.isHeld()) return error;
        // Mostly what lies just where the disc reaches out of its cell is enough.
        std::array<Near, kMostNear> near;
        size_t cells = 0;
        fan.close(circles_, [&](float u, float v) -> std::pair<size_t, size_t> {
            const uint32_t cell = around_.cellAt(plane_.place + glm::dvec3(u * plane_.t1 + v * plane_.t2));
            for (size_t k = 0; k < cells; ++k)
                if (near.at(k).cell == cell) return {near.at(k).first, near.at(k).last};
            const Around::Run run = around_.inCell(cell);
            if (run.begin == run.end || cells == kMostNear) return {0, 0};
            const size_t first = circles_.count;
            add(run, kMostBeside, error);
            near.at(cells++) = {cell, first, circles_.count};
            return {first, circles_.count};
        });
        return fan.isHeld() ? error : heldByAllWith(error, fan);
    }

  private:
    static constexpr size_t kMostBeside = 24, kMostNear = 8;
    struct Near {
        uint32_t cell;
        size_t first, last;
    };

    float heldByAllWith(float error, Fan& fan) {
        if (!knowsBeside_)
            around_.forBeside(key_, [&](const glm::dvec3& middle, double reach, Around::Run run) {
                const double height = std::abs(glm::dot(middle - plane_.place, glm::dvec3(plane_.n)));
                if (height <= reach + std::max(error, plane_.radius)) beside_.at(count_++) = run;
            });
        knowsBeside_ = true;
        const size_t first = circles_.count;
        for (size_t k = 0; k < count_; ++k) add(beside_.at(k), kMostBeside, error);
        fan.close(circles_, [&](float, float) { return std::pair(first, circles_.count); });
        if (fan.isHeld()) return error;
        return (error + fan.missing(circles_)) * (1 + 1e-5f);
    }
    void add(size_t k, Fan& fan) const { fan.add(circles_.u[k], circles_.v[k], circles_.radius[k]); }
    void add(Around::Run run, size_t most, float error) {
        const size_t stride = (run.end - run.begin + most - 1) / most;
        if (stride == 0) return;
        (around_.leaves != nullptr ? addLeaves : addParts)(around_, plane_, run.begin, run.end, stride, error,
                                                           circles_);
    }
    const Around& around_;
    DiscPlane plane_;
    Key key_;
    Circles circles_;
    std::array<Around::Run, 26> beside_;
    size_t count_ = 0;
    bool knowsBeside_ = false;
};

/// As much of a leaf or part as is seen from above.
struct Seen {
    float u, v, core, hole;
};
Seen seenLeaf(const Around& around, const DiscPlane& plane, size_t i) {
    const glm::vec3 d = glm::vec3(around.x[i], around.y[i], around.z[i]) - glm::vec3(plane.place - around.corner);
    const float along = std::abs(glm::dot(plane.n, glm::vec3(around.nx[i], around.ny[i], around.nz[i])));
    return {glm::dot(d, plane.t1), glm::dot(d, plane.t2), around.radius[i] * std::min(along, 1.0f), 0};
}
Seen seenPart(const Around& around, const DiscPlane& plane, size_t i) {
    const Patch p(plane, around.parts[i]);
    return {p.u, p.v, p.core, p.hole};
}

/// Of balls, which are leaves or stand for those below a part, the ones whose means are within a distance of a record.
struct Balls {
    double distance = 0;
    glm::dvec3 sum{0};  ///< of the leaves' means beside the record
    double weight = 0, least = 1e300;
    glm::dvec3 off{0};  ///< of their common mean
    double reach = 0;   ///< of the farthest leaf from that
    /// How far a place of the record's ball is from the next of the leaves, at most: on its side of their common mean
    /// there is one.
    double farthest(double radius) const {
        return weight == 0 ? 1e300 : std::hypot(radius + glm::length(off), reach) - least;
    }
};
/// `place`: beside the record; `reach`: how far the leaves that it stands for lie from there.
struct Ball {
    glm::dvec3 place;
    double reach;
    size_t first;  ///< of the sets of balls, of which each holds all of the one before
};

}  // namespace

uint32_t coveringCode(const AggregateRecord& record, const Around& around, uint32_t code) {
    if ((record.flags & shared::kFlagNoNormal) != 0) return code;
    thread_local std::optional<Holding> holding;
    holding.emplace(record, around);
    // Far more than that is less than what a single circle has to hold.
    constexpr uint32_t kAtOnce = 3;
    const ErrorScale& scale = around.grid.errors;
    while (code < ErrorScale::kLargest) {
        const auto error = static_cast<float>(scale.decode(code));
        const float wanted = holding->heldWith(error);
        if (wanted <= error) break;
        const uint32_t enough = scale.encodeUp(static_cast<double>(wanted));
        if (enough <= code + kAtOnce) return enough;
        code = std::min(code + kAtOnce, ErrorScale::kLargest);
    }
    return code;
}

double coveringErrorOfBall(const AggregateRecord& record, std::span<const AggregateRecord> parts,
                           const Leaves* leaves) {
    const auto radius = static_cast<double>(record.radius);
    std::array<Balls, 3> within;
    for (size_t k = 0; const double share : {0.25, 0.5, 1.0}) within.at(k++).distance = share * radius * (1 + 1e-6);
    thread_local std::vector<Ball> balls;
    balls.clear();
    // `least`: radius of the leaves at least, where they are known.
    const auto add = [&](const glm::dvec3& mean, double weight, double reach, double least) {
        const glm::dvec3 place = mean - record.place;
        const double away = glm::length(place);
        size_t first = 0;
        while (first < within.size() && !(away <= within[first].distance)) ++first;
        for (size_t k = first; k < within.size(); ++k) {
            within[k].sum += weight * place;
            within[k].weight += weight;
            within[k].least = std::min(within[k].least, least);
        }
        if (first < within.size()) balls.push_back({place, reach, first});
    };
    if (leaves != nullptr)
        for (size_t at = record.first; at < size_t{record.first} + record.count; ++at)
            add(leaves->points.at(at), 1, 0, static_cast<double>(leaves->points.radius[at]));
    else
        for (const AggregateRecord& p : parts)
            add(p.mean, p.count, p.count == 1 ? 0.0 : glm::length(p.mean - p.place) + static_cast<double>(p.radius), 0);
    for (Balls& b : within)
        if (b.weight > 0) b.off = b.sum / b.weight;
    for (const Ball& b : balls)
        for (size_t k = b.first; k < within.size(); ++k)
            within[k].reach = std::max(within[k].reach, glm::length(b.place - within[k].off) + b.reach);
    double error = 1e300;
    for (const Balls& b : within) error = std::min(error, b.farthest(radius));
    return std::max(error, radius);
}

void measureCore(AggregateRecord& record, const Around& around, bool isAll) {
    constexpr int kFinest = 3;  ///< holes of 2^-k radii are looked for first
    constexpr size_t kMost = 96;
    const auto error = static_cast<float>(around.grid.errors.decode(record.code));
    // Whatever the leaves are like, the disc keeps its error.
    record.core = record.radius;
    record.hole = error;
    if ((record.flags & shared::kFlagNoNormal) != 0) {
        record.core = 0;
        record.hole = record.radius;
        return;
    }
    if (!isAll) return;
    const DiscPlane plane(record);
    const Around::Run run = around.at(record.key);
    const size_t stride = (run.end - run.begin + kMost - 1) / kMost;
    for (int k = kFinest; k > 0; --k) {
        const float hole = std::ldexp(plane.radius, -k);
        if (hole >= error) return;
        Fan fan(plane.radius);
        for (size_t i = run.begin; i < run.end; i += stride) {
            const auto [u, v, core, beside] =
                around.leaves != nullptr ? seenLeaf(around, plane, i) : seenPart(around, plane, i);
            if (beside <= hole) fan.add(u, v, (core + hole - beside) * kRounded);
        }
        const float core = std::min(fan.core(), plane.radius);
        if (core < 0.5f * plane.radius) continue;
        record.core = core;
        record.hole = hole;
        return;
    }
}

}  // namespace stipple::lod
