// One coarse record from the finer ones in its cell.
#include "lod/builder/points/aggregate.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "engine/base/lanes.h"
#include "engine/base/numbers.h"
#include "engine/base/wide.h"
#include "lod/builder/points/covered.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/border.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kPlaneDirections = 16;
constexpr float kColourSpread = 48.0f / 255.0f;  ///< largest tolerated difference from the mean, per channel, sRGB

struct Directions {
    alignas(64) std::array<float, kPlaneDirections> c, s;
    Directions() {
        for (uint32_t k = 0; k < kPlaneDirections; ++k) {
            const double a = 6.283185307179586 * k / kPlaneDirections;
            c.at(k) = static_cast<float>(std::cos(a));
            s.at(k) = static_cast<float>(std::sin(a));
        }
    }
};
const Directions kPlane;

struct LinearTable {
    std::array<float, 256> of;
    LinearTable() {
        for (uint32_t i = 0; i < 256; ++i) of.at(i) = shared::linearFromSrgb(static_cast<float>(i) / 255.0f);
    }
};
const LinearTable kLinear;

struct RadiusTable {
    std::array<double, 256> of;
    RadiusTable() {
        for (uint32_t c = 0; c < 256; ++c) of.at(c) = static_cast<double>(shared::radiusFraction(c));
    }
};
const RadiusTable kRadii;

/// 16 log2(m), rounded, for 64 mantissas m from 1 to 2.
struct SixteenthTable {
    std::array<int, 64> of;
    SixteenthTable() {
        for (size_t i = 0; i < of.size(); ++i)
            of.at(i) = static_cast<int>(std::lround(16 * std::log2(1 + (static_cast<double>(i) + 0.5) / 64)));
    }
};
const SixteenthTable kSixteenths;

template <typename Part>
bool hasNormal(const Part& r) {
    return (r.flags & shared::kFlagNoNormal) == 0;
}

std::array<uint8_t, 3> channelsOf(uint32_t colour) {
    return {static_cast<uint8_t>(colour), static_cast<uint8_t>(colour >> 8), static_cast<uint8_t>(colour >> 16)};
}
glm::vec3 linearOf(const std::array<uint8_t, 3>& channels) {
    return {kLinear.of[channels[0]], kLinear.of[channels[1]], kLinear.of[channels[2]]};
}

/// As much of a point that stands for itself as means and ranges ask for.
struct LeafPart {
    static constexpr uint32_t count = 1;
    static constexpr uint8_t code = 0;
    uint32_t first;
    uint8_t flags;
    std::array<uint8_t, 3> least, greatest;
    glm::dvec3 mean;
    glm::vec3 meanColour, normal, meanNormal;
    LeafPart(const Leaves& leaves, size_t i)
        : first(static_cast<uint32_t>(i)),
          flags(static_cast<uint8_t>(leaves.points.colour[i] >> 24)),
          least(channelsOf(leaves.points.colour[i])),
          greatest(least),
          mean(leaves.points.at(i)),
          meanColour(linearOf(least)),
          normal(leaves.normalOf(i)),
          meanNormal(normal) {}
};

/// Means, ranges and flags of `parts` of them, partAt(0) and so on.
template <typename PartAt>
void addUp(size_t parts, const PartAt& partAt, AggregateRecord& out) {
    constexpr std::array<uint32_t, 3> kOfMost{shared::kFlagLeaf, shared::kFlagScattered, shared::kFlagBorder};
    std::array<double, kOfMost.size()> such{};
    double count = 0;
    glm::dvec3 sum(0);
    glm::vec3 colour(0), normal(0), reference(0);
    bool allNone = true;
    const auto& at0 = partAt(0);
    const glm::dvec3 mean0 = at0.mean;
    out.first = at0.first;
    out.least = at0.least;
    out.greatest = at0.greatest;
    for (size_t i = 0; i < parts; ++i) {
        const auto& p = partAt(i);
        const double weight = p.count;
        const auto w = static_cast<float>(p.count);
        count += weight;
        sum += weight * (p.mean - mean0);
        colour += w * p.meanColour;
        for (size_t k = 0; k < 3; ++k) {
            out.least[k] = std::min(out.least[k], p.least[k]);
            out.greatest[k] = std::max(out.greatest[k], p.greatest[k]);
        }
        out.flags =
            static_cast<uint8_t>(out.flags | (p.flags & (shared::kFlagTwoSided | shared::kFlagEstimatedNormal)));
        out.code = std::max(out.code, p.code);
        out.first = std::min(out.first, p.first);
        out.count += p.count;
        for (size_t k = 0; k < kOfMost.size(); ++k) such[k] += (p.flags & kOfMost[k]) != 0 ? weight : 0;
        if (!hasNormal(p)) continue;
        if (allNone) reference = p.normal;
        allNone = false;
        // A two-sided normal has no sign of its own: take the one that agrees with the first.
        const bool flip = (p.flags & shared::kFlagTwoSided) != 0 && glm::dot(p.normal, reference) < 0;
        normal += flip ? -w * p.meanNormal : w * p.meanNormal;
    }
    // What most of the leaves are.
    for (size_t k = 0; k < kOfMost.size(); ++k)
        if (2 * such[k] > count) out.flags = static_cast<uint8_t>(out.flags | kOfMost[k]);
    out.mean = mean0 + sum / count;
    out.meanColour = colour / static_cast<float>(count);
    out.meanNormal = normal / static_cast<float>(count);
    const float length = glm::length(out.meanNormal);
    // Opposing normals cancel: the first stands for all (hard case 30).
    if (!allNone) out.normal = length > 1e-3f ? out.meanNormal / length : reference;
    if (!allNone && !(length > 1e-3f)) out.meanNormal = 1e-3f * reference;
    if (allNone) out.flags = static_cast<uint8_t>(out.flags | shared::kFlagNoNormal);
}

/// Largest difference of a leaf's channel from the mean; both sRGB.
float colourSpread(const AggregateRecord& r, const glm::vec3& mean) {
    float spread = 0;
    for (int k = 0; k < 3; ++k) {
        const auto at = static_cast<size_t>(k);
        spread = std::max({spread, static_cast<float>(r.greatest.at(at)) / 255.0f - mean[k],
                           mean[k] - static_cast<float>(r.least.at(at)) / 255.0f});
    }
    return spread;
}

}  // namespace

/// Of leaves whose coordinates are 32 bits. (Distances are not negative: they have the order of their bits.)
STIPPLE_WIDE static float reachOfNarrow(const Points& leaves, size_t begin, size_t end, const double (&from)[3]) {
    const uint32_t *const x = leaves.x.data(), *const y = leaves.y.data(), *const z = leaves.z.data();
    const float* const radius = leaves.radius.data();
    int32_t most = 0;
    for (size_t i = begin; i < end; ++i) {
        const auto dx = static_cast<float>(x[i] - from[0]), dy = static_cast<float>(y[i] - from[1]),
                   dz = static_cast<float>(z[i] - from[2]);
        const auto reach = std::bit_cast<int32_t>(std::sqrt(dx * dx + dy * dy + dz * dz) + radius[i]);
        most = reach > most ? reach : most;
    }
    return std::bit_cast<float>(most);
}

namespace {

/// Axes of a disc's plane.
struct Plane {
    glm::vec3 n, t1, t2;
    explicit Plane(const AggregateRecord& out) : n(out.normal) {
        t1 = glm::normalize(std::abs(n.x) < 0.7f ? glm::vec3(0, -n.z, n.y) : glm::vec3(-n.z, 0, n.x));
        t2 = glm::cross(n, t1);
    }
};

/// How far the balls of leaves [begin, end) reach from a place.
float reachOfBalls(const Points& leaves, size_t begin, size_t end, const glm::dvec3& from) {
    float reach = 0;
    if (leaves.high.empty()) return reachOfNarrow(leaves, begin, end, {from.x, from.y, from.z});
    for (size_t i = begin; i < end; ++i)
        reach = std::max(reach, glm::length(glm::vec3(leaves.at(i) - from)) + leaves.radius[i]);
    return reach;
}

/// Leaves' discs beside a place, whole vectors of them.
struct LeafDiscs {
    static constexpr size_t kMost = 64;
    using Column = std::array<float, kMost>;
    alignas(64) Column x, y, z, nx, ny, nz, radius;
    size_t count = 0;
    void set(const Leaves& leaves, size_t begin, size_t end, const glm::dvec3& place) {
        count = end - begin;
        for (size_t k = 0; k < count; ++k) {
            const glm::vec3 d(leaves.points.at(begin + k) - place), &n = leaves.normalOf(begin + k);
            x[k] = d.x;
            y[k] = d.y;
            z[k] = d.z;
            nx[k] = n.x;
            ny[k] = n.y;
            nz[k] = n.z;
            radius[k] = leaves.points.radius[begin + k];
        }
        for (; count % kLanes != 0; ++count)  // the last one once more changes nothing
            for (Column* column : {&x, &y, &z, &nx, &ny, &nz, &radius}) (*column)[count] = (*column)[count - 1];
    }
};
/// What discs reach in the directions of a plane, over and under it, and from its middle; several values of each.
struct DiscExtent {
    static constexpr float kLeast = -1e30f;
    alignas(64) std::array<float, kPlaneDirections> directions;
    alignas(64) std::array<float, kLanes> above, below, reach{};
    DiscExtent() {
        directions.fill(kLeast);
        above.fill(kLeast);
        below.fill(kLeast);
    }
    void giveTo(Extent& e) const {
        e.inner = *std::min_element(directions.begin(), directions.end());
        e.above = *std::max_element(above.begin(), above.end());
        e.below = *std::max_element(below.begin(), below.end());
        e.reach = *std::max_element(reach.begin(), reach.end());
    }
};

}  // namespace

STIPPLE_WIDE static void addLeafDiscs(const LeafDiscs& discs, const Plane& plane, DiscExtent& extent) {
    static_assert(kPlaneDirections == 2 * kLanes);
    const glm::vec3 n = plane.n, t1 = plane.t1, t2 = plane.t2;
    const auto keepMost = [](Floats& most, const Floats& value) { most = value > most ? value : most; };
    Floats above = floatsAt(extent.above.data(), 0).v, below = floatsAt(extent.below.data(), 0).v,
           reach = floatsAt(extent.reach.data(), 0).v;
    alignas(64) LeafDiscs::Column us, vs, insides;
    for (size_t k = 0; k < discs.count; k += kLanes) {
        const Floats x = floatsAt(discs.x.data(), k).v, y = floatsAt(discs.y.data(), k).v,
                     z = floatsAt(discs.z.data(), k).v, radius = floatsAt(discs.radius.data(), k).v;
        const Floats u = x * t1.x + y * t1.y + z * t1.z, v = x * t2.x + y * t2.y + z * t2.z,
                     w = x * n.x + y * n.y + z * n.z;
        const Floats along = n.x * floatsAt(discs.nx.data(), k).v + n.y * floatsAt(discs.ny.data(), k).v +
                             n.z * floatsAt(discs.nz.data(), k).v;
        Floats sine = 1.0f - along * along, far = u * u + v * v;
        sine = sine > 0.0f ? sine : Floats{};
        takeRoots(sine);
        takeRoots(far);
        const Floats rise = radius * sine;
        keepMost(above, w + rise);
        keepMost(below, rise - w);
        keepMost(reach, far + radius);
        floatsAt(us.data(), k).v = u;
        floatsAt(vs.data(), k).v = v;
        floatsAt(insides.data(), k).v = radius * (along > 0.0f ? along : -along);
    }
    const Floats c0 = floatsAt(kPlane.c.data(), 0).v, c1 = floatsAt(kPlane.c.data(), kLanes).v,
                 s0 = floatsAt(kPlane.s.data(), 0).v, s1 = floatsAt(kPlane.s.data(), kLanes).v;
    Floats first = floatsAt(extent.directions.data(), 0).v, second = floatsAt(extent.directions.data(), kLanes).v;
    for (size_t k = 0; k < discs.count; ++k) {
        keepMost(first, us[k] * c0 + vs[k] * s0 + insides[k]);
        keepMost(second, us[k] * c1 + vs[k] * s1 + insides[k]);
    }
    floatsAt(extent.directions.data(), 0).v = first;
    floatsAt(extent.directions.data(), kLanes).v = second;
    floatsAt(extent.above.data(), 0).v = above;
    floatsAt(extent.below.data(), 0).v = below;
    floatsAt(extent.reach.data(), 0).v = reach;
}

Extent extentOfLeaves(const Leaves& leaves, size_t begin, size_t end, const AggregateRecord& out) {
    Extent e;
    if (!hasNormal(out)) {  // a ball has no plane
        e.reach = reachOfBalls(leaves.points, begin, end, out.place);
        return e;
    }
    const Plane plane(out);
    DiscExtent extent;
    LeafDiscs discs;
    for (size_t first = begin; first < end; first += LeafDiscs::kMost) {
        discs.set(leaves, first, std::min(first + LeafDiscs::kMost, end), out.place);
        addLeafDiscs(discs, plane, extent);
    }
    extent.giveTo(e);
    return e;
}

namespace {

/// Of the leaves of all parts, against the disc's plane through out.place.
Extent extentOf(std::span<const AggregateRecord> parts, const AggregateRecord& out) {
    if (!hasNormal(out)) {
        Extent e;
        for (const AggregateRecord& p : parts)
            e.reach =
                std::max(e.reach, glm::length(glm::vec3(p.place - out.place)) + std::max(p.above, p.below) + p.radius);
        return e;
    }
    const Plane plane(out);
    const glm::vec3 n = plane.n, t1 = plane.t1, t2 = plane.t2;
    alignas(64) std::array<float, kPlaneDirections> extent{};
    extent.fill(-1e30f);
    Extent e;
    e.above = e.below = -1e30f;
    for (const AggregateRecord& p : parts) {
        const glm::vec3 d(p.place - out.place);
        const float u = glm::dot(d, t1), v = glm::dot(d, t2), w = glm::dot(d, n);
        const float along = hasNormal(p) ? glm::dot(n, p.normal) : 0.0f;
        // A record without a normal is a ball: its rim rises by its whole radius.
        const float sine = std::sqrt(std::max(0.0f, 1.0f - along * along));
        const float slab = std::max(p.above, p.below);
        const float rise = p.radius * sine;
        e.above = std::max(e.above, w + rise + std::max(p.above * along, -p.below * along));
        e.below = std::max(e.below, -w + rise + std::max(p.below * along, -p.above * along));
        e.reach = std::max(e.reach, std::sqrt(u * u + v * v) + slab * sine + p.radius);
        // In any direction of the plane the leaves reach at least that far from the part's centre.
        const float moved = p.count == 1 ? static_cast<float>(glm::length(p.mean - p.place)) : 0.0f;
        const float inside = std::max(p.inner * std::abs(along) - slab * sine - moved, -p.radius);
        for (uint32_t k = 0; k < kPlaneDirections; ++k)
            extent[k] = std::max(extent[k], u * kPlane.c[k] + v * kPlane.s[k] + inside);
    }
    e.inner = *std::min_element(extent.begin(), extent.end());
    return e;
}

}  // namespace

namespace {

constexpr uint32_t kClusterLevels = 6;

/// Lattice position of record coordinate 0: see Hierarchy::recordOrigin.
glm::dvec3 recordBase(const Frame& frame, const Node& node) {
    const double half = node.stepShift > 0 ? 0.5 * (std::exp2(node.stepShift) - 1) : 0.0;
    return glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * frame.cellSize(node.level) + half;
}

}  // namespace

RecordGrid gridOf(const Frame& frame, const Node& node) {
    const uint32_t clusterLevel = std::min(node.level + kClusterLevels, frame.keyLevels);
    RecordGrid grid;
    grid.base = recordBase(frame, node);
    grid.step = std::exp2(node.stepShift);
    grid.edge = frame.cellSize(node.level);
    grid.clusterShift = frame.shiftOf(clusterLevel);
    grid.cellsAcross = 1u << (clusterLevel - node.level);
    grid.cellSteps = 65536u / grid.cellsAcross;
    grid.errors = frame.errors;
    return grid;
}

uint32_t radiusCodeUp(double radius, double edge) {
    const double share = radius * (1 - 2e-7) / edge;
    // 16 codes an octave: from the exponent and the bits after it; the table has the last word.
    const auto bits = std::bit_cast<uint64_t>(std::max(share, 1e-300));
    const int octave = static_cast<int>(bits >> 52) - 1023;
    auto c = static_cast<uint32_t>(std::clamp(255 + 16 * octave + kSixteenths.of[bits >> 46 & 63u], 0, 255));
    while (c > 0 && kRadii.of[c - 1] >= share) --c;
    while (c < 255 && kRadii.of[c] < share) ++c;
    return c;
}
double radiusOf(uint32_t code, double edge) { return kRadii.of.at(code) * edge; }

AggregateRecord aggregateOfLeaf(const Points& points, size_t i, Key key) {
    AggregateRecord r;
    r.first = static_cast<uint32_t>(i);
    r.key = key;
    r.count = 1;
    r.mean = r.place = points.at(i);
    const uint32_t c = points.colour[i];
    r.flags = static_cast<uint8_t>(c >> 24);
    if (hasNormal(r)) r.normal = r.meanNormal = shared::octDecode(points.normal[i]);
    r.least = r.greatest = channelsOf(c);
    r.meanColour = linearOf(r.least);
    r.radius = points.radius[i];
    r.inner = r.core = hasNormal(r) ? r.radius : 0.0f;
    return r;
}

namespace {

/// What follows from the means. `parts`: where no leaves are at hand. `wish`: of the disc, which reaches round all
/// leaves if it may be as large.
void complete(const RecordGrid& grid, std::span<const AggregateRecord> parts, const Leaves* leaves,
              const Around& around, const DiscWish& wish, AggregateRecord& out) {
    const uint32_t normalCode = hasNormal(out) ? roundedNormal(out.normal) : 0;
    if (hasNormal(out)) out.normal = shared::octDecode(normalCode);
    // Position: to the nearest step, inside the cluster's own cell.
    std::array<uint32_t, 3> q{};
    const Key cluster = out.key >> grid.clusterShift;
    const auto inNode =
        static_cast<uint64_t>(cluster) & (uint64_t{grid.cellsAcross} * grid.cellsAcross * grid.cellsAcross - 1);
    const std::array<uint64_t, 3> index{compactShort(inNode), compactShort(inNode >> 1), compactShort(inNode >> 2)};
    const double stepsPerUnit = 1 / grid.step;  // exact
    for (int a = 0; a < 3; ++a) {
        const auto at = static_cast<size_t>(a);
        const uint32_t first = static_cast<uint32_t>(index[at]) * grid.cellSteps;
        const double wanted = std::floor((wish.place[a] - grid.base[a]) * stepsPerUnit + 0.5);
        q[at] = toWhole<uint32_t>(std::clamp(wanted, double(first), double(first + grid.cellSteps - 1)));
        out.place[a] = grid.base[a] + grid.step * q[at];
    }
    const Extent x = leaves != nullptr ? extentOfLeaves(*leaves, out.first, size_t{out.first} + out.count, out)
                                       : extentOf(parts, out);
    const double reach = std::max(static_cast<double>(x.reach) * (1 + 1e-6), 0.5);
    const uint32_t radiusCode = radiusCodeUp(std::min(reach, wish.mostRadius), grid.edge);
    const double radius = radiusOf(radiusCode, grid.edge);
    out.radius = static_cast<float>(radius);
    out.inner = x.inner;
    double error = 0;
    if (hasNormal(out)) {
        out.above = x.above * (1 + 1e-5f);
        out.below = x.below * (1 + 1e-5f);
        const double sideways = std::max({0.0, radius - static_cast<double>(x.inner), reach - radius});
        const auto slab = static_cast<double>(std::max(out.above, out.below));
        error = std::sqrt(slab * slab + sideways * sideways) * (1 + 1e-5);
    } else {
        out.inner = 0;
        error = out.count == 1 ? 0.0 : coveringErrorOfBall(out, parts, leaves);
    }
    if (out.count == 1) {  // the same disc, moved and rounded up
        out.inner = leaves == nullptr ? parts[0].inner : hasNormal(out) ? leaves->points.radius[out.first] : 0.0f;
        error = glm::length(out.mean - out.place) + radius - static_cast<double>(out.inner);
    }
    std::array<uint32_t, 3> colour{out.least[0], out.least[1], out.least[2]};  // of all of them, if of one
    if (out.least != out.greatest) {
        const glm::vec3 mean(shared::srgbFromLinear(out.meanColour.x), shared::srgbFromLinear(out.meanColour.y),
                             shared::srgbFromLinear(out.meanColour.z));
        if (colourSpread(out, mean) > kColourSpread)
            error = std::max(error, std::min(2 * std::max(radius, reach), wish.extent));
        colour = {unitToByte(mean.x), unitToByte(mean.y), unitToByte(mean.z)};
    }
    out.code = std::max(static_cast<uint8_t>(grid.errors.encodeUp(error)), out.code);
    if (out.count > 1) out.code = static_cast<uint8_t>(coveringCode(out, around, out.code));
    out.packed = {q[0] | q[1] << 16, q[2] | radiusCode << 16 | uint32_t{out.code} << 24, normalCode,
                  colour[0] | colour[1] << 8 | colour[2] << 16 | uint32_t{out.flags} << 24};
}

}  // namespace

void mergeAggregates(const RecordGrid& grid, std::span<const AggregateRecord> parts, const Leaves* leaves,
                     const Around& around, AggregateRecord& out) {
    out.key = parts[0].key;
    addUp(
        parts.size(), [&](size_t i) -> const AggregateRecord& { return parts[i]; }, out);
    complete(grid, parts, leaves, around, {out.mean}, out);
}

void mergeAtFace(const RecordGrid& grid, std::span<const AggregateRecord> parts, const Around& around,
                 const DiscWish& wish, AggregateRecord& out) {
    out.key = parts[0].key;
    addUp(
        parts.size(), [&](size_t i) -> const AggregateRecord& { return parts[i]; }, out);
    out.normal = out.meanNormal = wish.normal;
    out.flags = static_cast<uint8_t>((out.flags & ~(shared::kFlagTwoSided | shared::kFlagNoNormal)) |
                                     (wish.isTwoSided ? shared::kFlagTwoSided : 0u));
    complete(grid, parts, nullptr, around, wish, out);
}

void mergeLeaves(const RecordGrid& grid, const Leaves& leaves, size_t begin, size_t end, const Around& around,
                 AggregateRecord& out) {
    out.key = leaves.key[begin];
    addUp(
        end - begin, [&](size_t i) { return LeafPart(leaves, begin + i); }, out);
    complete(grid, {}, &leaves, around, {out.mean}, out);
}

bool splitByNormals(std::span<const AggregateRecord> parts, std::vector<uint8_t>& side) {
    constexpr float kOneCone = 0.82f;  // cosine of 35 degrees
    constexpr int kRounds = 2;
    if (parts.size() < 2) return false;
    // How well a normal agrees with an axis; a two-sided one has no sign.
    const auto agrees = [](const AggregateRecord& p, const glm::vec3& axis) {
        const float d = glm::dot(p.normal, axis);
        return (p.flags & shared::kFlagTwoSided) != 0 ? std::abs(d) : d;
    };
    const auto farthestFrom = [&](const glm::vec3& axis) {
        size_t worst = 0;
        float least = 2;
        for (size_t k = 0; k < parts.size(); ++k) {
            if (!hasNormal(parts[k])) return parts.size();
            const float d = agrees(parts[k], axis);
            if (d < least) {
                least = d;
                worst = k;
            }
        }
        return worst;
    };
    const size_t a = farthestFrom(parts[0].normal);
    if (a == parts.size()) return false;
    const size_t b = farthestFrom(parts[a].normal);
    std::array<glm::vec3, 2> axis{parts[a].normal, parts[b].normal};
    if (agrees(parts[b], axis[0]) > kOneCone) return false;
    side.resize(parts.size());
    std::array<size_t, 2> members{};
    for (int round = 0; round < kRounds; ++round) {
        std::array<glm::vec3, 2> sum{glm::vec3(0), glm::vec3(0)};
        members = {};
        for (size_t k = 0; k < parts.size(); ++k) {
            side[k] = agrees(parts[k], axis[1]) > agrees(parts[k], axis[0]) ? 1 : 0;
            const bool flip = glm::dot(parts[k].normal, axis.at(side[k])) < 0;
            sum.at(side[k]) += static_cast<float>(parts[k].count) * (flip ? -parts[k].normal : parts[k].normal);
            ++members.at(side[k]);
        }
        for (size_t g = 0; g < 2; ++g)
            if (glm::length(sum.at(g)) > 0) axis.at(g) = glm::normalize(sum.at(g));
    }
    return members[0] > 0 && members[1] > 0;
}

}  // namespace stipple::lod
