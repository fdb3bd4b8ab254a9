#include "lod/builder/points/levels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "lod/builder/points/aggregate.h"
#include "lod/builder/points/aggregate_values.h"
#include "lod/builder/points/covered.h"
#include "lod/builder/points/overview.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/record_spacing.h"
#include "lod/store/attributes.h"
#include "lod/store/chunk.h"

namespace stipple::lod {
namespace {

struct Box {
    glm::dvec3 lo{1e300}, hi{-1e300};
    void add(const glm::dvec3& p, double margin = 0) {
        lo = glm::min(lo, p - margin);
        hi = glm::max(hi, p + margin);
    }
    glm::dvec3 centre() const { return 0.5 * (lo + hi); }
};

Node emptyNode(const Frame& frame, uint32_t level, Key key) {
    Node node;
    node.level = static_cast<uint8_t>(level);
    const Key cell = key >> frame.shiftOf(level);
    node.cell = {compactBits(cell), compactBits(cell >> 1), compactBits(cell >> 2)};
    node.stepShift = static_cast<int8_t>(static_cast<int>(frame.rootLog2) - static_cast<int>(level) - 16);
    return node;
}

// ---- normal cones ----

void leafCone(const LeafPoints& leaf, Node& node) {
    const std::span<const uint32_t> normals = std::span(leaf.points.normal).subspan(leaf.first, leaf.count());
    glm::dvec3 sum(0);
    for (size_t k = 0; k < leaf.count(); ++k) {
        const uint32_t flags = leaf.points.colour[leaf.first + k] >> 24;
        if ((flags & (shared::kFlagTwoSided | shared::kFlagNoNormal)) != 0) return;
        sum += glm::dvec3(shared::octDecode(normals[k]));
    }
    if (!(glm::length(sum) > 1e-3 * static_cast<double>(leaf.count()))) return;
    node.normalCone = octEncode(glm::vec3(glm::normalize(sum)));
    const glm::vec3 axis = shared::octDecode(node.normalCone);
    node.normalConeCosine = 1;
    for (const uint32_t n : normals)
        node.normalConeCosine =
            std::min(node.normalConeCosine, glm::dot(axis, glm::vec3(shared::octDecode(n))) - 1e-6f);
    node.normalConeCosine = std::max(node.normalConeCosine, -1.0f);  // all directions
}

void innerCone(std::span<const PendingNode> children, Node& node) {
    glm::dvec3 sum(0);
    for (const PendingNode& c : children) {
        if (c.node.normalConeCosine <= -1) return;
        sum += glm::dvec3(shared::octDecode(c.node.normalCone));
    }
    if (!(glm::length(sum) > 1e-3)) return;
    const uint32_t cone = octEncode(glm::vec3(glm::normalize(sum)));
    const glm::dvec3 axis(shared::octDecode(cone));
    double widest = 0;
    for (const PendingNode& c : children) {
        const glm::dvec3 child(shared::octDecode(c.node.normalCone));
        const double between = 2 * std::asin(std::min(1.0, 0.5 * glm::length(child - axis)));
        const double half = std::acos(std::clamp(static_cast<double>(c.node.normalConeCosine), -1.0, 1.0));
        widest = std::max(widest, between + half);
    }
    if (widest >= 3.14) return;
    node.normalCone = cone;
    node.normalConeCosine = std::max(static_cast<float>(std::cos(widest)) - 1e-6f, -1.0f);
}

// ---- chunks ----

uint32_t coordinate(uint64_t v, uint64_t size, int stepShift) {
    const uint64_t local = v & (size - 1);
    return static_cast<uint32_t>(stepShift >= 0 ? local >> stepShift : local << -stepShift);
}

/// Where each record goes: by its parent's code, largest first, then in order.
struct Order {
    std::array<uint32_t, 256> parents{}, own{}, next{};
    template <typename ParentCodeOf, typename CodeOf>
    Order(size_t count, const ParentCodeOf& parentCodeOf, const CodeOf& codeOf) {
        for (size_t k = 0; k < count; ++k) {
            ++parents[parentCodeOf(k)];
            ++own[codeOf(k)];
        }
        uint32_t sum = 0;
        for (size_t code = 256; code-- > 0;) {
            next[code] = sum;
            sum += parents[code];
        }
    }
};

void appendCounts(const std::array<uint32_t, 256>& histogram, NodeBatch& batch, uint16_t& codes) {
    codes = 0;
    for (uint32_t code = 0; code < 256; ++code) {
        if (histogram[code] == 0) continue;
        batch.addCount(code, histogram[code]);
        ++codes;
    }
}

using Streams = std::vector<std::vector<uint8_t>>;  ///< of each attribute its values

void putLeafRecords(const Frame& frame, const PendingNode& pending, Order& order, Chunk& chunk, Streams& streams) {
    const Node& node = pending.node;
    const LeafPoints leaf = pending.leaf();
    const Points& p = leaf.points;
    const uint64_t size = uint64_t{1} << (frame.rootLog2 - node.level);
    const bool hasLowBits = !chunk.lowBits.empty();
    RadiusCodes radii(frame.cellSize(node.level));
    for (size_t k = 0; k < leaf.count(); ++k) {
        const size_t at = order.next[pending.leafParentCode[k]]++, i = leaf.first + k;
        const Place place = p.place(i);
        const auto steps = [&](size_t a) { return coordinate(place.at(a), size, node.stepShift); };
        chunk.records[at] = {steps(0) | steps(1) << 16, steps(2) | radii.upOf(p.radius[i]) << 16, p.normal[i],
                             p.colour[i]};
        for (size_t a = 0; a < streams.size(); ++a) {
            const size_t width = bytesOf(frame.attributes[a].type);
            std::memcpy(streams[a].data() + at * width, p.attributes[a].data() + i * width, width);
        }
        if (!hasLowBits) continue;
        const uint64_t mask = (uint64_t{1} << node.stepShift) - 1;
        for (size_t a = 0; a < 3; ++a) chunk.lowBits[at * 3 + a] = static_cast<uint32_t>(place.at(a) & mask);
    }
}

void putInnerRecords(const Frame& frame, const PendingNode& pending, Order& order, Chunk& chunk, Streams& streams) {
    for (size_t k = 0; k < pending.records.size(); ++k) {
        const AggregateRecord& record = pending.records[k];
        const size_t at = order.next[record.parentCode]++;
        chunk.records[at] = record.packed;
        for (size_t a = 0; a < streams.size(); ++a)
            storeValue(frame.attributes[a], pending.values[k * streams.size() + a], record.count,
                       streams[a].data() + at * bytesOf(frame.attributes[a].type));
        for (size_t a = 0; a < 3 && !chunk.lowBits.empty(); ++a) chunk.lowBits[at * 3 + a] = 0;
    }
}

/// Writes a node whose records know their parents' codes.
void encodeNode(const Frame& frame, PendingNode& pending, NodeBatch& batch) {
    Node& node = pending.node;
    const bool isLeaf = node.isLeaf();
    const size_t count = node.records, points = isLeaf ? pending.leafParentCode.size() : 0;
    // Points of a leaf, then records, which those of a root that is a leaf may have as an overview.
    Order order(
        count,
        [&](size_t k) { return k < points ? pending.leafParentCode[k] : pending.records[k - points].parentCode; },
        [&](size_t k) { return k < points ? uint8_t{0} : pending.records[k - points].code; });
    thread_local Chunk chunk;
    chunk.records.resize(count);
    chunk.lowBits.resize(isLeaf && node.stepShift > 0 ? count * 3 : 0);
    Streams streams;
    for (const AttributeInfo& a : frame.attributes) streams.emplace_back(count * bytesOf(a.type));
    if (isLeaf) putLeafRecords(frame, pending, order, chunk, streams);
    putInnerRecords(frame, pending, order, chunk, streams);
    const std::vector<uint8_t> bytes = encodeChunk(chunk), attributes = encodeAttributes(frame.attributes, streams);
    // (Records of the overview come first, and are those of no surface beside these.)
    const auto overview = std::accumulate(order.own.begin() + node.errorCode + 1, order.own.end(), size_t{0});
    node.spacingCode = spacingCodeUp(recordSpacing(std::span(chunk.records).subspan(overview)));
    node.chunkOffset = batch.bytes.size();
    node.chunkBytes = static_cast<uint32_t>(bytes.size());
    node.chunkHash = hashBytes(bytes.data(), bytes.size());
    node.attributeBytes = static_cast<uint32_t>(attributes.size());
    node.attributeHash = hashBytes(attributes.data(), attributes.size());
    batch.bytes.insert(batch.bytes.end(), bytes.begin(), bytes.end());
    batch.bytes.insert(batch.bytes.end(), attributes.begin(), attributes.end());
    NodeBatch::Written written{node, pending.key, static_cast<uint32_t>(batch.counts.size()), 0, 0};
    appendCounts(order.parents, batch, written.parentCodes);
    appendCounts(order.own, batch, written.ownCodes);
    batch.nodes.push_back(written);
    pending = {};
}

/// Encloses the own discs and the children's spheres.
void innerSphere(const Frame& frame, std::span<const PendingNode> children, PendingNode& parent) {
    Node& node = parent.node;
    Box box;
    for (const PendingNode& c : children) box.add(c.node.centre, c.node.radius);
    node.centre = box.centre();
    for (const PendingNode& c : children)
        node.radius = std::max(node.radius, glm::length(c.node.centre - node.centre) + c.node.radius);
    for (const AggregateRecord& r : parent.records) {
        const double reach = radiusOf(recordRadiusCode(r.packed), frame.cellSize(node.level));
        node.radius = std::max(node.radius, glm::length(r.place - node.centre) + reach);
    }
    node.radius *= 1 + 1e-6;
}

PendingNode makeLeaf(const Frame& frame, SortedPoints& from, size_t begin, size_t end, uint32_t level) {
    PendingNode out;
    const double edge = frame.cellSize(level);
    RadiusCodes codes(edge);
    for (size_t i = begin; i < end; ++i)
        from.points.radius[i] = static_cast<float>(radiusOf(codes.upOf(from.points.radius[i]), edge));
    out.among = &from;
    out.firstPoint = begin;
    out.leafParentCode.assign(end - begin, static_cast<uint8_t>(ErrorScale::kNoParent));
    const uint32_t shift = frame.shiftOf(level);
    out.key = from.key[begin] >> shift << shift;
    out.node = emptyNode(frame, level, out.key);
    Box box;
    for (size_t i = begin; i < end; ++i) box.add(from.points.at(i));
    Node& node = out.node;
    node.centre = box.centre();
    double radius = 0;
    for (size_t i = begin; i < end; ++i)
        radius =
            std::max(radius, glm::length(from.points.at(i) - node.centre) + static_cast<double>(from.points.radius[i]));
    // Positions may be held in steps coarser than the lattice.
    node.radius = radius * (1 + 1e-6) + (node.stepShift > 0 ? std::exp2(node.stepShift) : 0.0);
    node.records = static_cast<uint32_t>(end - begin);
    leafCone(out.leaf(), node);
    return out;
}

/// A leaf that leaves its subtree takes its points with it.
void takePoints(PendingNode& node) {
    if (node.among == nullptr) return;
    const LeafPoints leaf = node.leaf();
    const auto part = [&](const auto& values, size_t width = 1) {
        const auto first = values.begin() + static_cast<ptrdiff_t>(leaf.first * width);
        return std::decay_t<decltype(values)>(first, first + static_cast<ptrdiff_t>(leaf.count() * width));
    };
    const Points& from = leaf.points;
    Points& to = node.own.points;
    to.x = part(from.x);
    to.y = part(from.y);
    to.z = part(from.z);
    if (!from.high.empty()) to.high = part(from.high);
    to.colour = part(from.colour);
    to.normal = part(from.normal);
    to.radius = part(from.radius);
    for (const std::vector<uint8_t>& values : from.attributes)
        to.attributes.push_back(part(values, values.size() / from.size()));
    node.own.key.assign(leaf.key.begin(), leaf.key.end());
    node.among = nullptr;
    node.firstPoint = 0;
}

/// One record for the records of a cell; two, where those lie in two cones of normals and one disc would be a poor
/// proxy for both (an edge between two walls), so that flat parts get large discs and edges keep small errors.
class ConeMerger {
  public:
    /// The last record of `out` is that of all `count` parts, which partsOf() gives where they are asked for.
    template <typename PartsOf, typename CodeOf>
    void finish(const Frame& frame, size_t count, const PartsOf& partsOf, std::span<const AggregateValue> values,
                const Around& around, const CodeOf& codeOf, PendingNode& out) {
        const AggregateRecord& one = out.records.back();
        if (!mayBeSplit(around.grid, count, one) || !isSplit(partsOf(), one, around)) {
            for (size_t k = 0; k < count; ++k) codeOf(k) = one.code;
            mergeAttributes(frame, count, values, out);
            return;
        }
        out.records.pop_back();
        for (size_t k = 0; k < count; ++k) codeOf(k) = of_.at(side_[k]).code;
        for (uint8_t g = 0; g < 2; ++g) {
            out.records.push_back(of_.at(g));
            values_.clear();
            const size_t kinds = frame.attributes.size();
            for (size_t k = 0; k < count; ++k)
                if (side_[k] == g)
                    values_.insert(values_.end(), values.begin() + static_cast<ptrdiff_t>(k * kinds),
                                   values.begin() + static_cast<ptrdiff_t>((k + 1) * kinds));
            mergeAttributes(frame, members_.at(g).size(), values_, out);
        }
    }

  private:
    static constexpr int kWorthwhile = 8;       ///< codes of error (1/8 octaves) that two records must gain
    static constexpr double kGoodAsItIs = 0.5;  ///< radii: a disc with a smaller error is not split

    static bool mayBeSplit(const RecordGrid& grid, size_t count, const AggregateRecord& one) {
        return count > 1 && (one.flags & shared::kFlagNoNormal) == 0 &&
               grid.errors.decode(one.code) >= kGoodAsItIs * static_cast<double>(one.radius);
    }
    bool isSplit(std::span<const AggregateRecord> parts, const AggregateRecord& one, const Around& around) {
        if (!splitByNormals(parts, side_)) return false;
        for (auto& m : members_) m.clear();
        for (size_t k = 0; k < parts.size(); ++k) members_.at(side_[k]).push_back(parts[k]);
        for (size_t g = 0; g < 2; ++g) {
            of_.at(g) = {};
            mergeAggregates(around.grid, members_.at(g), nullptr, around, of_.at(g));
            if (of_.at(g).code + kWorthwhile > one.code) return false;
        }
        return true;
    }
    void mergeAttributes(const Frame& frame, size_t parts, std::span<const AggregateValue> values, PendingNode& out) {
        const size_t kinds = frame.attributes.size();
        for (size_t a = 0; a < kinds; ++a) {
            column_.clear();
            for (size_t k = 0; k < parts; ++k) column_.push_back(values[k * kinds + a]);
            out.values.push_back(mergeValues(frame.attributes[a], column_));
        }
    }

    std::vector<uint8_t> side_;
    std::array<std::vector<AggregateRecord>, 2> members_;
    std::array<AggregateRecord, 2> of_;
    std::vector<AggregateValue> values_, column_;
};

const AggregateRecord kNew;  // (a copy is made faster)

/// Where the records of each cluster's cell end.
void findRuns(const PendingNode& node, uint32_t clusterShift, std::vector<uint32_t>& ends) {
    const Key above = ~Key{0} << clusterShift;
    const auto find = [&](size_t count, const auto& keyAt) {
        ends.resize(count);
        size_t found = 0;
        for (size_t k = 1; k < count; ++k) {
            ends[found] = static_cast<uint32_t>(k);
            found += ((keyAt(k) ^ keyAt(k - 1)) & above) != 0 ? 1 : 0;
        }
        ends.resize(found);
        ends.push_back(static_cast<uint32_t>(count));
    };
    if (node.node.isLeaf())
        find(node.node.records, [keys = node.leaf().key](size_t k) { return keys[k]; });
    else
        find(node.node.records, [&](size_t k) { return node.records[k].key; });
}

}  // namespace

PendingNode makeParent(const Frame& frame, std::span<PendingNode> children, NodeBatch& batch, const Leaves* leaves) {
    STIPPLE_CHECK(!children.empty(), "a parent has children");
    PendingNode out;
    const uint32_t level = children[0].node.level - 1u, shift = frame.shiftOf(level);
    out.key = children[0].key >> shift << shift;
    out.node = emptyNode(frame, level, out.key);
    const Around around(gridOf(frame, out.node), out.key, frame.shiftOf(level), leaves, children);
    const RecordGrid& grid = around.grid;
    const size_t kinds = frame.attributes.size();
    thread_local std::vector<AggregateRecord> points;
    thread_local std::vector<AggregateValue> leafValues;
    thread_local std::array<std::vector<uint32_t>, 8> ends;
    thread_local ConeMerger cones;
    size_t runs = 0;
    for (size_t c = 0; c < children.size(); ++c) {
        findRuns(children[c], grid.clusterShift, ends.at(c));
        runs += ends.at(c).size();
    }
    out.records.reserve(runs * 9 / 8);  // (some are split)
    for (size_t c = 0; c < children.size(); ++c) {
        PendingNode& child = children[c];
        const bool isLeaf = child.node.isLeaf();
        const LeafPoints leaf = child.leaf();
        out.node.childMask = static_cast<uint8_t>(
            out.node.childMask | 1u << static_cast<uint32_t>(child.key >> frame.shiftOf(level + 1) & 7u));
        size_t begin = 0;
        for (const size_t end : ends.at(c)) {
            const auto partsOf = [&]() -> std::span<const AggregateRecord> {
                if (!isLeaf) return std::span(child.records).subspan(begin, end - begin);
                points.clear();
                for (size_t k = begin; k < end; ++k)
                    points.push_back(aggregateOfLeaf(leaf.points, leaf.first + k, leaf.key[k]));
                return points;
            };
            std::span<const AggregateValue> values;
            if (isLeaf) {
                leafValues.clear();
                for (size_t k = leaf.first + begin; k < leaf.first + end; ++k)
                    for (size_t a = 0; a < kinds; ++a)
                        leafValues.push_back(leafValue(frame.attributes[a], leaf.points.attributes[a].data() +
                                                                                k * bytesOf(frame.attributes[a].type)));
                values = leafValues;
            } else {
                values = std::span(child.values).subspan(begin * kinds, (end - begin) * kinds);
            }
            const auto codeOf = [&](size_t k) -> uint8_t& {
                return isLeaf ? child.leafParentCode[begin + k] : child.records[begin + k].parentCode;
            };
            AggregateRecord& one = out.records.emplace_back(kNew);
            if (isLeaf && leaves != nullptr)
                mergeLeaves(grid, *leaves, leaf.first + begin, leaf.first + end, around, one);
            else
                mergeAggregates(grid, partsOf(), leaves, around, one);
            cones.finish(frame, end - begin, partsOf, values, around, codeOf, out);
            begin = end;
        }
    }
    if (leaves == nullptr) measureCores(out.records, around);
    out.node.records = static_cast<uint32_t>(out.records.size());
    for (const AggregateRecord& r : out.records) out.node.errorCode = std::max(out.node.errorCode, r.code);
    innerSphere(frame, children, out);
    innerCone(children, out.node);
    for (PendingNode& child : children) encodeNode(frame, child, batch);
    return out;
}

void finishRoot(const Frame& frame, PendingNode& root, NodeBatch& batch) {
    addOverview(frame, root);
    encodeNode(frame, root, batch);
}

namespace {

/// Records are drawn to the steps of their node. Would points of this leaf be off by what can be seen beside their
/// neighbours? Then it is split, until a step is one lattice unit at most:
///   - more than 4 places in the 64ths of the edge that hold any, on average: nearer to each other than 512 steps. (A
///     full leaf of evenly scanned points has 2 there.)
///   - more than 16 in one of them, or 8 in a 128th
///   - a few points, many of them as near to the next one along the curve
///   - hardly any, with small discs
/// So what lies closer together is at most eight points among many that do not; or hardly any points, no disc of which
/// is narrower than half the edge: none of them would fit a smaller cell, and a step is nothing beside it.
bool isCoarse(const Frame& frame, const SortedPoints& from, size_t begin, size_t end, uint32_t level) {
    constexpr std::array<std::pair<uint32_t, size_t>, 2> kMostBelow{{{6, 16}, {7, 8}}};  // levels, places
    constexpr size_t kMostOnAverage = 4, kFew = 64, kHardlyAny = 8;
    constexpr double kSteps = 256, kStepsOfDisc = 64, kMany = 0.25;
    const double step = std::exp2(static_cast<double>(frame.rootLog2) - level - 16);
    if (step <= 1) return false;
    const size_t count = end - begin;
    const auto radii = std::span(from.points.radius).subspan(begin, count);
    if (count <= kHardlyAny && std::none_of(radii.begin(), radii.end(), [&](float r) { return r < 0x1p15 * step; }))
        return false;
    std::array<size_t, kMostBelow.size()> places{};
    size_t different = 0, near = 0, cells = 0;
    Place before{};
    for (size_t i = begin; i < end; ++i) {
        const Place place = from.points.place(i);
        if (i > begin && isSame(place, before)) continue;
        ++different;
        for (size_t k = 0; k < places.size(); ++k) {
            const uint32_t shift = frame.shiftOf(std::min(level + kMostBelow.at(k).first, frame.keyLevels));
            const bool isBeside = i > begin && from.key[i] >> shift == from.key[i - 1] >> shift;
            places.at(k) = isBeside ? places.at(k) + 1 : 1;
            cells += k == 0 && !isBeside ? 1 : 0;
            if (places.at(k) > kMostBelow.at(k).second) return true;
        }
        uint64_t apart = 0;
        for (size_t a = 0; a < 3; ++a)
            apart = std::max(apart, std::max(place.at(a), before.at(a)) - std::min(place.at(a), before.at(a)));
        near += i > begin && static_cast<double>(apart) < kSteps * step ? 1 : 0;
        before = place;
    }
    if (different > kMostOnAverage * cells) return true;
    if (count <= kFew && static_cast<double>(near) > kMany * static_cast<double>(different)) return true;
    if (count > kHardlyAny) return false;
    for (size_t i = begin; i < end; ++i)
        if (kStepsOfDisc * step > static_cast<double>(from.points.radius[i])) return true;
    return false;
}

PendingNode subtreeOf(const Frame& frame, SortedPoints& from, size_t begin, size_t end, uint32_t level,
                      NodeBatch& batch, const Leaves& leaves) {
    const bool isSmall = end - begin <= frame.leafRecords && !isCoarse(frame, from, begin, end, level);
    if (isSmall || level >= frame.keyLevels) return makeLeaf(frame, from, begin, end, level);
    std::vector<PendingNode> children;
    children.reserve(8);
    const uint32_t shift = frame.shiftOf(level + 1);
    for (uint64_t octant = 0; octant < 8 && begin < end; ++octant) {
        const auto first = from.key.begin() + static_cast<ptrdiff_t>(begin),
                   last = from.key.begin() + static_cast<ptrdiff_t>(end);
        const auto split = std::partition_point(first, last, [&](Key k) { return (k >> shift & 7u) <= octant; });
        const auto next = static_cast<size_t>(split - from.key.begin());
        if (next == begin) continue;
        children.push_back(subtreeOf(frame, from, begin, next, level + 1, batch, leaves));
        begin = next;
    }
    return makeParent(frame, children, batch, &leaves);
}

}  // namespace

PendingNode makeSubtree(const Frame& frame, SortedPoints& from, size_t begin, size_t end, uint32_t level,
                        NodeBatch& batch) {
    Leaves leaves{from.points, from.key, begin, std::vector<glm::vec3>(end - begin, glm::vec3(0)), false};
    for (size_t i = begin; i < end; ++i)
        if ((from.points.colour[i] >> 24 & shared::kFlagNoNormal) == 0) {
            leaves.normal[i - begin] = shared::octDecode(from.points.normal[i]);
            leaves.hasNormals = true;
        }
    PendingNode root = subtreeOf(frame, from, begin, end, level, batch, leaves);
    takePoints(root);
    const Around around(gridOf(frame, root.node), root.key, frame.shiftOf(level), &leaves, {});
    measureCores(root.records, around);
    return root;
}

}  // namespace stipple::lod
