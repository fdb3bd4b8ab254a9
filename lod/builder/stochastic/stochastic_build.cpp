// A stochastic build as a straight line.
#include "lod/builder/stochastic/stochastic_build.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/builder/counts.h"
#include "lod/primitives/octahedral.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kRootLog2 = 24;

struct Sample {
    glm::dvec3 p{0};  ///< lattice units
    uint32_t normal = 0, colour = 0;
    double radius = 0;
};
/// Discs in their order, and the radius that each has: of a few kinds, as items are scaled.
using Samples = std::vector<Sample>;

glm::dvec3 placed(const Instance& place, const glm::dvec3& p) {
    return place.translation + place.rotation * (place.scale * p);
}

/// Octant of a lattice place in a node's children, of a node of this level.
uint32_t octantOf(const glm::dvec3& lattice, uint32_t level) {
    uint32_t octant = 0;
    for (int a = 0; a < 3; ++a) {
        const auto at = static_cast<uint32_t>(std::clamp(lattice[a], 0.0, std::exp2(kRootLog2) - 1));
        octant |= (at >> (kRootLog2 - 1 - level) & 1u) << a;
    }
    return octant;
}

class StochasticBuilder {
  public:
    StochasticBuilder(const std::vector<StochasticItem>& items, const StochasticSettings& settings)
        : items_(items), settings_(settings) {
        glm::dvec3 lo(1e300), hi(-1e300);
        double reach = 0;
        for (const StochasticItem& item : items) {
            const glm::dvec3 c = placed(item.place, item.centre);
            lo = glm::min(lo, c);
            hi = glm::max(hi, c);
            reach = std::max(reach, item.reach * item.place.scale);
        }
        boundsMin = lo - reach;
        boundsMax = hi + reach;
        const double extent = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z, 2.02 * reach, 1e-30});
        h.isStochastic = true;
        h.rootLog2 = kRootLog2;
        h.unit = std::exp2(std::floor(std::log2(extent)) + 1 - kRootLog2);
        h.origin = lo;
        h.errors.smallest = std::exp2(kRootLog2 + 2.0) / std::exp2(ErrorScale::kLargest / 8.0);
        smallestCell_ = 2.02 * reach / h.unit;
    }

    void partition() {
        h.nodes.resize(1);
        of_.resize(1);
        for (uint32_t k = 0; k < items_.size(); ++k) of_[0].push_back(k);
        for (size_t i = 0; i < h.nodes.size(); ++i) {
            h.nodes[i].stepShift = static_cast<int8_t>(static_cast<int>(kRootLog2) - h.nodes[i].level - 15);
            uint64_t shown = 0;
            for (const uint32_t k : of_[i]) shown += items_[k].count;
            const double half = 0.5 * h.cellSize(h.nodes[i]);
            if (of_[i].size() == 1 || shown <= settings_.nodeRecords || half < smallestCell_) continue;
            std::array<std::vector<uint32_t>, 8> octants;
            for (const uint32_t k : of_[i]) octants.at(octantOf(latticeOf(k), h.nodes[i].level)).push_back(k);
            h.nodes[i].firstChild = static_cast<uint32_t>(h.nodes.size());
            for (uint32_t o = 0; o < 8; ++o) {
                if (octants.at(o).empty()) continue;
                h.nodes[i].childMask = static_cast<uint8_t>(h.nodes[i].childMask | 1u << o);
                Node child;
                child.parent = static_cast<uint32_t>(i);
                child.level = static_cast<uint8_t>(h.nodes[i].level + 1);
                const auto& cell = h.nodes[i].cell;
                child.cell = {cell[0] * 2 + (o & 1u), cell[1] * 2 + (o >> 1 & 1u), cell[2] * 2 + (o >> 2 & 1u)};
                h.nodes.push_back(child);
                of_.push_back(std::move(octants.at(o)));
            }
            of_[i] = {};
        }
    }

    /// Writes a node after its children; its samples are left in `out`.
    Result<void> write(uint32_t index, StoreWriter& writer, Samples& out) {
        const bool isLeaf = h.nodes[index].isLeaf();
        out.clear();
        glm::dvec3 lo(1e300), hi(-1e300);
        if (isLeaf) {
            gather(index, out);
            leafRecords += out.size();
        } else {
            std::vector<Samples> below(static_cast<size_t>(__builtin_popcount(h.nodes[index].childMask)));
            for (uint32_t c = 0; c < below.size(); ++c) {
                STIPPLE_TRY(write(h.nodes[index].firstChild + c, writer, below[c]));
                const Node& child = h.nodes[h.nodes[index].firstChild + c];
                lo = glm::min(lo, child.centre - child.radius);
                hi = glm::max(hi, child.centre + child.radius);
            }
            share(below, out);
        }
        Node& node = h.nodes[index];
        double largest = 0;
        for (const Sample& s : out) {
            largest = std::max(largest, s.radius);
            lo = glm::min(lo, s.p - s.radius);
            hi = glm::max(hi, s.p + s.radius);
        }
        node.centre = 0.5 * (lo + hi);
        node.records = static_cast<uint32_t>(out.size());
        const double step = std::exp2(node.stepShift);
        constexpr double kCoded = 1.045;  // radii are rounded up to a code
        for (const Sample& s : out)
            node.radius = std::max(node.radius, glm::length(s.p - node.centre) + kCoded * s.radius + step);
        for (int c = 0; !isLeaf && c < __builtin_popcount(node.childMask); ++c) {
            const Node& child = h.nodes[node.firstChild + static_cast<uint32_t>(c)];
            node.radius = std::max(node.radius, glm::length(child.centre - node.centre) + child.radius);
            node.errorCode = std::max(node.errorCode, child.errorCode);
        }
        node.radius *= 1 + 1e-6;
        node.errorCode = std::max(node.errorCode, static_cast<uint8_t>(h.errors.encodeUp(kCoded * largest)));
        records += out.size();
        return writer.appendChunk(encode(node, out), {}, node);
    }

    /// All records of a node have its own code, and its parent's as their parent's.
    void count() {
        for (size_t i = 0; i < h.nodes.size(); ++i) {
            Node& node = h.nodes[i];
            std::vector<uint32_t> own(256, 0), parent(256, 0);
            own[node.errorCode] = parent[i == 0 ? ErrorScale::kNoParent : h.nodes[node.parent].errorCode] =
                node.records;
            node.parentCounts = makeCodeCounts(parent, node.records, h.greaterThan);
            node.ownCounts = makeCodeCounts(own, node.records, h.greaterThan);
        }
    }

    Hierarchy h;
    uint64_t records = 0, leafRecords = 0;
    glm::dvec3 boundsMin{0}, boundsMax{0};

  private:
    glm::dvec3 latticeOf(uint32_t item) const {
        return (placed(items_[item].place, items_[item].centre) - h.origin) / h.unit;
    }

    /// Samples of a leaf's items: all first ones, all second ones, ... The items in an order that is spread in space.
    void gather(uint32_t index, Samples& out) const {
        std::vector<uint32_t> order = of_[index];
        std::sort(order.begin(), order.end(), [](uint32_t a, uint32_t b) { return spread(a) < spread(b); });
        uint32_t most = 0;
        for (const uint32_t k : order) most = std::max(most, items_[k].count);
        // Of different numbers, each as far along as the others: rank over number.
        struct At {
            double share;
            uint32_t item, rank;
        };
        std::vector<At> at;
        for (const uint32_t k : order)
            for (uint32_t r = 0; r < items_[k].count; ++r) at.push_back({(r + 0.5) / items_[k].count, k, r});
        std::stable_sort(at.begin(), at.end(), [](const At& a, const At& b) { return a.share < b.share; });
        for (const At& a : at) {
            const StochasticItem& item = items_[a.item];
            const PointBlock& from = item.samples->points;
            const double all = static_cast<double>(from.position.size());
            out.push_back({(placed(item.place, from.position[a.rank]) - h.origin) / h.unit,
                           octEncode(glm::vec3(item.place.rotation * glm::dvec3(from.normal[a.rank]))),
                           from.colour[a.rank],
                           item.samples->radius * std::sqrt(all / item.count) * item.place.scale / h.unit});
        }
    }
    static uint32_t spread(uint32_t k) {
        k *= 0x9e3779b1u;
        k ^= k >> 15;
        k *= 0x85ebca6bu;
        return k ^ k >> 13;
    }

    /// A beginning of each child's samples, mixed evenly: as many as keep the discs of all children equally large.
    void share(const std::vector<Samples>& below, Samples& out) const {
        const auto sizeOf = [](const Samples& s) {
            double sum = 0;
            for (const Sample& x : s) sum += x.radius * x.radius;
            return sum;  // n r^2
        };
        double area = 0, largest = 0;
        for (const Samples& s : below) {
            area += sizeOf(s);
            for (const Sample& x : s) largest = std::max(largest, x.radius);
        }
        const double radius = std::max(largest, std::sqrt(area / settings_.nodeRecords));
        struct At {
            double share;
            const Sample* sample;
            double larger;
        };
        std::vector<At> at;
        for (const Samples& s : below) {
            const double all = static_cast<double>(s.size());
            const auto count = static_cast<size_t>(std::clamp(std::round(sizeOf(s) / (radius * radius)), 1.0, all));
            const double larger = std::sqrt(all / static_cast<double>(count));
            for (size_t k = 0; k < count; ++k)
                at.push_back({(static_cast<double>(k) + 0.5) / static_cast<double>(count), &s[k], larger});
        }
        std::stable_sort(at.begin(), at.end(), [](const At& a, const At& b) { return a.share < b.share; });
        for (const At& a : at) {
            out.push_back(*a.sample);
            out.back().radius *= a.larger;
        }
    }

    std::vector<uint8_t> encode(const Node& node, const Samples& samples) const {
        const double step = std::exp2(node.stepShift), cell = h.cellSize(node);
        const glm::dvec3 base = h.recordOrigin(node);
        Chunk chunk;
        chunk.records.reserve(samples.size());
        for (const Sample& s : samples) {
            const glm::dvec3 exact = glm::floor((s.p - base) / step + 0.5);
            const glm::dvec3 q = glm::clamp(exact, glm::dvec3(0), glm::dvec3(65535));
            STIPPLE_CHECK(glm::length(q - exact) < 4, "a sample outside of its node");
            const double code = std::ceil(255.0 + 16.0 * std::log2(s.radius / cell) - 1e-6);
            const auto radius = static_cast<uint32_t>(std::clamp(code, 0.0, 255.0));
            chunk.records.push_back({static_cast<uint32_t>(q.x) | static_cast<uint32_t>(q.y) << 16,
                                     static_cast<uint32_t>(q.z) | radius << 16 | uint32_t{node.errorCode} << 24,
                                     s.normal, s.colour});
        }
        return encodeChunk(chunk);
    }

    const std::vector<StochasticItem>& items_;
    const StochasticSettings& settings_;
    std::vector<std::vector<uint32_t>> of_;  ///< items of each leaf
    double smallestCell_ = 0;
};

}  // namespace

void describeDiscs(const std::vector<DiscFactors>& models, StoreDescription& description) {
    double least = 1e300, greatest = 0;
    for (const DiscFactors& m : models) {
        least = std::min(least, m.radius);
        greatest = std::max(greatest, m.radius * std::exp2(0.5 * static_cast<double>(m.factors.size() - 1)));
    }
    description.smallestDisc = least;
    description.discFactors.clear();
    const auto steps = static_cast<size_t>(std::lround(2 * std::log2(greatest / least)));
    for (size_t k = 0; k <= steps; ++k) {
        const double radius = least * std::exp2(0.5 * static_cast<double>(k));
        double sum = 0, weights = 0;
        for (const DiscFactors& m : models) {
            Hierarchy own;
            own.discFactors = m.factors;
            own.smallestDisc = m.radius;
            sum += m.weight * double{own.discFactor(radius)};
            weights += m.weight;
        }
        description.discFactors.push_back(static_cast<float>(sum / weights));
    }
}

uint32_t leafOf(const Hierarchy& h, const glm::dvec3& centre) {
    const glm::dvec3 lattice = (centre - h.origin) / h.unit;
    uint32_t index = 0;
    while (!h.nodes[index].isLeaf()) {
        const Node& node = h.nodes[index];
        const uint32_t octant = octantOf(lattice, node.level);
        index = node.firstChild + static_cast<uint32_t>(__builtin_popcount(node.childMask & ((1u << octant) - 1)));
    }
    return index;
}

Result<BuildReport> buildStochasticStore(const std::vector<StochasticItem>& items, const std::string& output,
                                         const StochasticSettings& settings, Executor& executor, Progress& progress) {
    BuildReport report;
    StageClock clock(report);
    if (items.empty()) return fail(ErrorKind::input, "holds nothing to sample", settings.description.source);
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(output));
    for (const StochasticItem& item : items) report.pointsIn += item.count;
    progress.update("samples", 0, report.pointsIn);
    StochasticBuilder builder(items, settings);
    builder.partition();
    Samples root;
    STIPPLE_TRY(builder.write(0, writer, root));
    builder.count();
    clock.ends("samples");
    StoreDescription description = settings.description;
    description.isStochastic = description.hasColour = description.hasNormals = description.isReflectance = true;
    description.points = report.pointsOut = builder.leafRecords;
    description.records = report.records = builder.records;
    description.boundsMin = description.focusMin = builder.boundsMin;
    description.boundsMax = description.focusMax = builder.boundsMax;
    STIPPLE_TRY(writer.finish(builder.h, description));
    STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
    STIPPLE_TRY(verifyStore(store, executor));
    clock.ends("verify");
    report.bytesOut = writer.bytes();
    STIPPLE_TRY(writer.commit());
    report.nodes = builder.h.nodes.size();
    report.contentHash = writer.contentHash();
    report.seconds = clock.seconds();
    return report;
}

}  // namespace stipple::lod
