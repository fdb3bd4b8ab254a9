#include "lod/builder/points/covered.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "engine/base/wide.h"
#include "lod/builder/morton.h"
#include "lod/builder/points/fan.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kMostCells = 64 * 64 * 64;  ///< of clusters in a node
/// Runs of a node's cells; empty between nodes.
thread_local std::vector<Around::Run> cellRuns;

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

}  // namespace

/// Appends the circles of the leaves `begin`, `begin + stride`, ... that are within `error` of one.
STIPPLE_WIDE static void addLeaves(const Around& around, const DiscPlane& plane, size_t begin, size_t end,
                                   size_t stride, float error, Circles& to) {
    constexpr size_t kBlock = 32;
    alignas(64) std::array<float, kBlock> us, vs, rs;
    const glm::vec3 o(plane.place - around.corner);
    const glm::vec3 n = plane.n, t1 = plane.t1, t2 = plane.t2;
    const float *const x = around.x, *const y = around.y, *const z = around.z, *const nx = around.nx,
                       *const ny = around.ny, *const nz = around.nz, *const radius = around.radius;
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

namespace {

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

bool isWithNormals(std::span<const PendingNode> nodes) {
    const auto isNormal = [](uint32_t flags) { return (flags & shared::kFlagNoNormal) == 0; };
    return std::any_of(nodes.begin(), nodes.end(), [&](const PendingNode& node) {
        return std::any_of(node.records.begin(), node.records.end(),
                           [&](const AggregateRecord& r) { return isNormal(r.flags); }) ||
               std::any_of(node.own.points.colour.begin(), node.own.points.colour.end(),
                           [&](uint32_t colour) { return isNormal(colour >> 24); });
    });
}

}  // namespace

STIPPLE_WIDE static void placesBeside(const uint32_t* places, size_t count, double corner, float* beside) {
    for (size_t k = 0; k < count; ++k) beside[k] = static_cast<float>(places[k] - corner);
}

Around::Around(const RecordGrid& g, Key key, uint32_t keyBits, const Leaves* from,
               std::span<const PendingNode> children)
    : grid(g), leaves(from), corner(g.base), firstCell_(key >> g.clusterShift), cellsPerUnit_(g.cellsAcross / g.edge) {
    cellRuns.resize(kMostCells);
    if (!(leaves != nullptr ? leaves->hasNormals : isWithNormals(children))) return;
    if (leaves == nullptr) {
        std::vector<Key> keys;
        for (const PendingNode& child : children) {
            parts.insert(parts.end(), child.records.begin(), child.records.end());
            const LeafPoints leaf = child.leaf();
            for (size_t k = 0; k < leaf.count(); ++k)
                parts.push_back(aggregateOfLeaf(leaf.points, leaf.first + k, leaf.key[k]));
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
    for (std::vector<float>& column : columns_) column.resize(count);
    const auto at = [&](size_t k) { return columns_.at(k).data(); };
    x = at(0), y = at(1), z = at(2), nx = at(3), ny = at(4), nz = at(5), radius = at(6);
    const Points& p = leaves->points;
    if (p.high.empty()) {
        const std::array<const std::vector<uint32_t>*, 3> places{&p.x, &p.y, &p.z};
        for (int a = 0; a < 3; ++a)
            placesBeside(places.at(static_cast<size_t>(a))->data() + first, count, corner[a],
                         at(static_cast<size_t>(a)));
    } else {
        for (size_t k = 0; k < count; ++k) {
            const glm::vec3 place(p.at(first + k) - corner);
            for (int a = 0; a < 3; ++a) at(static_cast<size_t>(a))[k] = place[a];
        }
    }
    std::copy_n(p.radius.begin() + static_cast<ptrdiff_t>(first), count, at(6));
    const glm::vec3* const normals = &leaves->normalOf(first);
    for (int a = 0; a < 3; ++a)
        for (size_t k = 0; k < count; ++k) at(static_cast<size_t>(3 + a))[k] = normals[k][a];
    number(std::span(begin, end));
}

void Around::number(std::span<const Key> keys) {
    for (size_t i = 0; i < keys.size();) {
        const Key cell = keys[i] >> grid.clusterShift;
        const auto begin = static_cast<uint32_t>(i);
        while (i < keys.size() && keys[i] >> grid.clusterShift == cell) ++i;
        used_.cells.push_back(static_cast<uint32_t>(cell - firstCell_));
        cellRuns[used_.cells.back()] = {begin, static_cast<uint32_t>(i)};
    }
}
Around::UsedCells::~UsedCells() {
    for (const uint32_t cell : cells) cellRuns[cell] = {};
}

Around::Run Around::at(Key key) const { return cellRuns[static_cast<size_t>((key >> grid.clusterShift) - firstCell_)]; }

uint32_t Around::cellAt(const glm::dvec3& place) const {
    const glm::dvec3 at = (place - grid.base) * cellsPerUnit_;
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
        if (fan.add(circles_)) return error;
        // Mostly what lies just where the disc reaches out of its cell is enough.
        std::array<Near, kMostNear> near;
        size_t cells = 0;
        const bool isHeld = fan.close(circles_, [&](float u, float v) -> Circles::Range {
            const uint32_t cell = around_.cellAt(plane_.place + glm::dvec3(u * plane_.t1 + v * plane_.t2));
            for (size_t k = 0; k < cells; ++k)
                if (near[k].cell == cell) return near[k].circles;
            const Around::Run run = around_.inCell(cell);
            if (run.begin == run.end || cells == kMostNear) return {};
            const size_t first = circles_.count;
            add(run, kMostBeside, error);
            near[cells++] = {cell, {first, circles_.count}};
            return {first, circles_.count};
        });
        return isHeld ? error : heldByAllWith(error, fan);
    }

  private:
    static constexpr size_t kMostBeside = 24, kMostNear = 8;
    struct Near {
        uint32_t cell;
        Circles::Range circles;
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
        if (fan.close(circles_, [&](float, float) { return Circles::Range{first, circles_.count}; })) return error;
        return (error + fan.missing(circles_)) * (1 + 1e-5f);
    }
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

/// Balls, which are leaves or stand for those below a part: places beside a record; and of parts how many leaves each
/// stands for and how far those lie from there, of leaves their radii.
struct Balls {
    std::vector<double> x, y, z, away, weight, reach, radius;
    size_t count = 0;
    bool areLeaves = false;
    void begin(size_t balls, bool leaves) {
        count = balls;
        areLeaves = leaves;
        if (count <= x.size()) return;
        for (auto* column : {&x, &y, &z, &away, &weight, &reach, &radius}) column->resize(count);
    }
    void place(size_t k, const glm::dvec3& at) {
        x[k] = at.x;
        y[k] = at.y;
        z[k] = at.z;
    }
};
/// Of four sets of balls a value each.
using Fours [[gnu::vector_size(32), gnu::may_alias]] = double;
using FourMasks [[gnu::vector_size(32), gnu::may_alias]] = int64_t;
struct BallSets {
    static constexpr size_t kSets = 3;                  ///< the fourth is the third once more
    using Values = double[4];                           // NOLINT(modernize-avoid-c-arrays): a vector
    alignas(32) Values distances;                       ///< of their balls from the record, at most
    alignas(32) Values offX, offY, offZ, reach, least;  ///< of the leaves
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

/// Of the balls of each set the leaves' common mean, how far the farthest leaf is from that, and the least radius;
/// 1e300 of a set without balls.
STIPPLE_WIDE static void measureSets(Balls& balls, BallSets& sets) {
    const size_t count = balls.count;
    const double *const x = balls.x.data(), *const y = balls.y.data(), *const z = balls.z.data();
    double* const away = balls.away.data();
    for (size_t k = 0; k < count; ++k) away[k] = std::sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
    const bool areLeaves = balls.areLeaves;
    const Fours distances = *reinterpret_cast<const Fours*>(sets.distances);
    Fours sumX{}, sumY{}, sumZ{}, sum{}, least = Fours{} + 1e300;
    for (size_t k = 0; k < count; ++k) {
        // Nothing is added of what is not within.
        const FourMasks within = Fours{} + away[k] <= distances;
        const double weight = areLeaves ? 1 : balls.weight[k], radius = areLeaves ? balls.radius[k] : 0;
        const Fours weights = reinterpret_cast<Fours>(reinterpret_cast<FourMasks>(Fours{} + weight) & within);
        sumX += weights * x[k];
        sumY += weights * y[k];
        sumZ += weights * z[k];
        sum += weights;
        const Fours here = within ? Fours{} + radius : Fours{} + 1e300;
        least = here < least ? here : least;
    }
    const Fours each = sum == 0 ? Fours{} + 1 : sum;
    const Fours offX = sumX / each, offY = sumY / each, offZ = sumZ / each;
    Fours reach{};
    for (size_t k = 0; k < count; ++k) {
        const FourMasks within = Fours{} + away[k] <= distances;
        const Fours dx = x[k] - offX, dy = y[k] - offY, dz = z[k] - offZ;
        Fours far = dx * dx + dy * dy + dz * dz;
        if (!areLeaves)
            for (size_t s = 0; s < 4; ++s) far[s] = std::sqrt(far[s]) + balls.reach[k];
        far = reinterpret_cast<Fours>(reinterpret_cast<FourMasks>(far) & within);
        reach = far > reach ? far : reach;
    }
    *reinterpret_cast<Fours*>(sets.offX) = offX;
    *reinterpret_cast<Fours*>(sets.offY) = offY;
    *reinterpret_cast<Fours*>(sets.offZ) = offZ;
    *reinterpret_cast<Fours*>(sets.least) = least;
    for (size_t s = 0; s < 4; ++s) sets.reach[s] = areLeaves ? std::sqrt(reach[s]) : reach[s];
}

namespace {

/// The same of the few that most records stand for, one set after the other; of a set with the same balls as a larger
/// one nothing is said.
void measureFew(Balls& balls, BallSets& sets) {
    const size_t count = balls.count;
    for (size_t k = 0; k < count; ++k)
        balls.away[k] = std::sqrt(balls.x[k] * balls.x[k] + balls.y[k] * balls.y[k] + balls.z[k] * balls.z[k]);
    size_t inLarger = 0;
    for (size_t s = BallSets::kSets; s-- > 0;) {
        sets.least[s] = 1e300;
        size_t within = 0;
        glm::dvec3 sum(0);
        double weights = 0, least = 1e300, reach = 0;
        for (size_t k = 0; k < count; ++k) {
            if (!(balls.away[k] <= sets.distances[s])) continue;
            ++within;
            const double weight = balls.areLeaves ? 1 : balls.weight[k];
            sum += weight * glm::dvec3(balls.x[k], balls.y[k], balls.z[k]);
            weights += weight;
            least = std::min(least, balls.areLeaves ? balls.radius[k] : 0.0);
        }
        if (within == 0 || within == inLarger) continue;
        inLarger = within;
        const glm::dvec3 off = sum / weights;
        for (size_t k = 0; k < count; ++k) {
            if (!(balls.away[k] <= sets.distances[s])) continue;
            const glm::dvec3 d = glm::dvec3(balls.x[k], balls.y[k], balls.z[k]) - off;
            const double squared = d.x * d.x + d.y * d.y + d.z * d.z;
            reach = std::max(reach, balls.areLeaves ? squared : std::sqrt(squared) + balls.reach[k]);
        }
        sets.offX[s] = off.x;
        sets.offY[s] = off.y;
        sets.offZ[s] = off.z;
        sets.least[s] = least;
        sets.reach[s] = balls.areLeaves ? std::sqrt(reach) : reach;
    }
}

}  // namespace

double coveringErrorOfBall(const AggregateRecord& record, std::span<const AggregateRecord> parts,
                           const Leaves* leaves) {
    constexpr size_t kFew = 12;  // more are measured four sets at once
    thread_local Balls balls;
    if (leaves != nullptr) {
        balls.begin(record.count, true);
        for (size_t k = 0; k < record.count; ++k) {
            balls.place(k, leaves->points.at(record.first + k) - record.place);
            balls.radius[k] = static_cast<double>(leaves->points.radius[record.first + k]);
        }
    } else {
        balls.begin(parts.size(), false);
        for (size_t k = 0; k < parts.size(); ++k) {
            const AggregateRecord& p = parts[k];
            balls.place(k, p.mean - record.place);
            balls.weight[k] = p.count;
            balls.reach[k] = p.count == 1 ? 0.0 : glm::length(p.mean - p.place) + static_cast<double>(p.radius);
        }
    }
    const auto radius = static_cast<double>(record.radius);
    const double all = radius * (1 + 1e-6);
    BallSets sets{{0.25 * all, 0.5 * all, all, all}, {}, {}, {}, {}, {}};
    (balls.count <= kFew ? measureFew : measureSets)(balls, sets);
    // A place of the record's ball has one of the leaves on its side of their common mean.
    double error = 1e300;
    for (size_t s = 0; s < BallSets::kSets; ++s) {
        if (!(sets.least[s] < 1e300)) continue;
        const double far = radius + glm::length(glm::dvec3(sets.offX[s], sets.offY[s], sets.offZ[s]));
        error = std::min(error, std::sqrt(far * far + sets.reach[s] * sets.reach[s]) - sets.least[s]);
    }
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
    std::array<Seen, kMost> seen;
    size_t count = 0;
    for (size_t i = run.begin; i < run.end; i += stride)
        seen[count++] = around.leaves != nullptr ? seenLeaf(around, plane, i) : seenPart(around, plane, i);
    thread_local Circles circles;
    for (int k = kFinest; k > 0; --k) {
        const float hole = std::ldexp(plane.radius, -k);
        if (hole >= error) return;
        circles.count = 0;
        for (const Seen& s : std::span(seen).first(count))
            if (s.hole <= hole) circles.add(s.u, s.v, (s.core + hole - s.hole) * kRounded);
        const float core = std::min(Fan(plane.radius).addAll(circles), plane.radius);
        if (core < 0.5f * plane.radius) continue;
        record.core = core;
        record.hole = hole;
        return;
    }
}

void measureCores(std::span<AggregateRecord> records, const Around& around) {
    const uint32_t shift = around.grid.clusterShift;
    for (size_t first = 0, last = 0; first < records.size(); first = last) {
        for (last = first + 1; last < records.size(); ++last)
            if (records[last].key >> shift != records[first].key >> shift) break;
        for (size_t k = first; k < last; ++k) measureCore(records[k], around, last == first + 1);
    }
}

}  // namespace stipple::lod
