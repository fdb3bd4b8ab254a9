// Records of every node, bottom-up, with errors measured against the leaves.
//
// An inner node of level L has one record per occupied octree cell of level L + 6 (64 cells along its edge), so a
// cluster is a run of the Morton order and never crosses a child's cell. Its record is a disc: centre = mean of the
// points, normal = their mean, radius = what covers all their discs in the plane. Its error bounds, in lattice units:
//   e_p  the height of any leaf disc over the record's plane: with the radius covering everything sideways this is the
//        one-sided Hausdorff distance from the leaves to the record;
//   e_t  by how much the record sticks out beyond its leaves: radius - least extent of the leaves over 16 directions
//        in the plane (between two of them they may reach less far by 2 % of the radius);
// combined as sqrt(e_p^2 + e_t^2) (sequential point trees, Dachsbacher et al. 2003, but against the leaves instead of
// the children), and at least the record's diameter where the colours below it differ by more than kColourSpread.
// Codes are made monotone up the tree by maximum. Everything is measured on the values as the file will hold them.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "lod/attributes.h"
#include "lod/build/aggregate.h"
#include "lod/build/cloud.h"
#include "lod/build/counts.h"
#include "lod/build/morton.h"
#include "lod/octahedral.h"
#include "lod/store.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kClusterLevels = 6;
constexpr uint32_t kDirections = 16;
constexpr float kColourSpread = 48.0f / 255.0f;  ///< largest tolerated difference from the mean, per channel, sRGB

struct Record {
    uint32_t begin = 0, end = 0;  ///< leaf points below it
    shared::PointRecord packed{};
    uint8_t parentCode = 0;
    uint32_t code() const { return shared::recordErrorCode(packed); }
};

/// What is written of one node.
struct EncodedNode {
    std::vector<uint8_t> chunk, attributes;
};

struct Directions {
    std::array<float, kDirections> c, s;
    Directions() {
        for (uint32_t k = 0; k < kDirections; ++k) {
            const double a = 6.283185307179586 * k / kDirections;
            c.at(k) = static_cast<float>(std::cos(a));
            s.at(k) = static_cast<float>(std::sin(a));
        }
    }
};

float linearOf(uint32_t byte) {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> t{};
        for (uint32_t i = 0; i < 256; ++i) t.at(i) = shared::linearFromSrgb(static_cast<float>(i) / 255.0f);
        return t;
    }();
    return table[byte];
}
uint32_t byteOf(float linear) {
    return static_cast<uint32_t>(std::clamp(shared::srgbFromLinear(linear) * 255.0f + 0.5f, 0.0f, 255.0f));
}

/// Code of the smallest radius >= `radius` at a node of this edge; but for 2e-7 relative, so that a decoded radius that
/// was rounded to fp32 gets its own code again.
uint32_t radiusCodeUp(double radius, double edge) {
    radius *= 1 - 2e-7;
    const double code = std::ceil(255.0 + 16.0 * std::log2(std::max(radius, 1e-300) / edge));
    auto c = static_cast<uint32_t>(std::clamp(code, 0.0, 255.0));
    while (c < 255 && static_cast<double>(shared::radiusFraction(c)) * edge < radius) ++c;
    return c;
}

class Simplifier {
  public:
    Simplifier(Cloud& cloud, const Partition& partition, Hierarchy& h) : cloud_(cloud), partition_(partition), h_(h) {
        normal_.resize(cloud.size());
        parentCode_.assign(cloud.size(), static_cast<uint8_t>(ErrorScale::kNoParent));
        records_.resize(partition.nodes.size());
    }

    /// Rounds the leaf's attributes to what its records will hold; bounds and sphere of a leaf.
    void prepareLeaf(uint32_t index) {
        const BuildNode& node = partition_.nodes[index];
        const double edge = h_.cellSize(h_.nodes[index]);
        Box box;
        for (uint32_t i = node.begin; i < node.end; ++i) {
            const bool none = (cloud_.colour[i] >> 24 & shared::kFlagNoNormal) != 0;
            normal_[i] = none ? glm::vec3(0) : glm::vec3(shared::octDecode(cloud_.normal[i]));
            const uint32_t code = radiusCodeUp(cloud_.radius[i], edge);
            cloud_.radius[i] = static_cast<float>(static_cast<double>(shared::radiusFraction(code)) * edge);
            box.add(pointAt(i));
        }
        Node& out = h_.nodes[index];
        out.centre = box.centre();
        double radius = 0;
        for (uint32_t i = node.begin; i < node.end; ++i)
            radius = std::max(radius, glm::length(pointAt(i) - out.centre) + static_cast<double>(cloud_.radius[i]));
        // Positions may be held in steps coarser than the lattice.
        out.radius = radius * (1 + 1e-6) + (out.stepShift > 0 ? std::exp2(out.stepShift) : 0.0);
        out.records = node.end - node.begin;
        leafCone(node, out);
    }

    void simplifyNode(uint32_t index, Executor& executor) {
        const BuildNode& node = partition_.nodes[index];
        const uint32_t clusterLevel = std::min(node.level + kClusterLevels, partition_.keyLevels);
        const uint32_t shift = partition_.shiftOf(clusterLevel);
        std::vector<Record>& records = records_[index];
        for (uint32_t i = node.begin; i < node.end;) {
            const uint64_t cell = partition_.key[i] >> shift;
            uint32_t end = i + 1;
            uint32_t step = 1;
            while (end < node.end && partition_.key[end] >> shift == cell) {  // gallop, then bisect
                const uint32_t jump = std::min(end + step, node.end);
                if (jump < node.end && partition_.key[jump] >> shift == cell)
                    end = jump;
                else if (step == 1)
                    ++end;
                else
                    step = 0;
                step = step ? step * 2 : 1;
            }
            records.push_back({i, end, {}, static_cast<uint8_t>(ErrorScale::kNoParent)});
            i = end;
        }
        Node& out = h_.nodes[index];
        const std::vector<uint32_t> childCode = childCodes(node, records);
        executor.parallelFor(records.size(), std::max<size_t>(64, records.size() / 64), [&](size_t begin, size_t end) {
            for (size_t r = begin; r < end; ++r) simplifyRecord(records[r], out, clusterLevel, childCode[r]);
        });
        assignParentCodes(node, records);
        innerSphere(node, records, out);
        out.records = static_cast<uint32_t>(records.size());
        for (const Record& r : records) out.errorCode = std::max(out.errorCode, static_cast<uint8_t>(r.code()));
    }

    /// Sorts by parent's code (descending), then Morton order; fills the counts; returns the encoded chunk.
    EncodedNode encode(uint32_t index, std::vector<uint32_t>& parentHistogram, std::vector<uint32_t>& ownHistogram) {
        const BuildNode& node = partition_.nodes[index];
        Node& out = h_.nodes[index];
        parentHistogram.assign(256, 0);
        ownHistogram.assign(256, 0);
        Chunk chunk;
        const bool isLeaf = node.childMask == 0;
        const bool hasLowBits = isLeaf && out.stepShift > 0;
        const uint32_t count = out.records;
        for (uint32_t k = 0; k < count; ++k) {
            ++parentHistogram[isLeaf ? parentCode_[node.begin + k] : records_[index][k].parentCode];
            ++ownHistogram[isLeaf ? 0 : records_[index][k].code()];
        }
        std::vector<uint32_t> position(256);
        uint32_t sum = 0;
        for (int code = 255; code >= 0; --code) {
            position[static_cast<size_t>(code)] = sum;
            sum += parentHistogram[static_cast<size_t>(code)];
        }
        chunk.records.resize(count);
        if (hasLowBits) chunk.lowBits.resize(size_t{count} * 3);
        std::vector<std::vector<uint8_t>> streams;
        for (const CloudAttribute& a : cloud_.attributes) streams.emplace_back(count * bytesOf(a.info.type));
        for (uint32_t k = 0; k < count; ++k) {
            const uint32_t i = node.begin + k;
            const uint32_t at = position[isLeaf ? parentCode_[i] : records_[index][k].parentCode]++;
            for (size_t a = 0; a < streams.size(); ++a)
                aggregate(cloud_.attributes[a], isLeaf ? i : records_[index][k].begin,
                          isLeaf ? i + 1 : records_[index][k].end,
                          streams[a].data() + at * bytesOf(cloud_.attributes[a].info.type));
            if (!isLeaf) {
                chunk.records[at] = records_[index][k].packed;
                continue;
            }
            chunk.records[at] = leafRecord(i, out);
            if (!hasLowBits) continue;
            const uint32_t mask = (1u << out.stepShift) - 1;
            chunk.lowBits[at * 3] = cloud_.x[i] & mask;
            chunk.lowBits[at * 3 + 1] = cloud_.y[i] & mask;
            chunk.lowBits[at * 3 + 2] = cloud_.z[i] & mask;
        }
        records_[index].clear();
        records_[index].shrink_to_fit();
        std::vector<AttributeInfo> infos;
        for (const CloudAttribute& a : cloud_.attributes) infos.push_back(a.info);
        return {encodeChunk(chunk), encodeAttributes(infos, streams)};
    }

  private:
    struct Box {
        glm::dvec3 lo{1e300}, hi{-1e300};
        void add(const glm::dvec3& p) {
            lo = glm::min(lo, p);
            hi = glm::max(hi, p);
        }
        glm::dvec3 centre() const { return 0.5 * (lo + hi); }
    };

    glm::dvec3 pointAt(uint32_t i) const { return {cloud_.x[i], cloud_.y[i], cloud_.z[i]}; }

    shared::PointRecord leafRecord(uint32_t i, const Node& node) const {
        const uint64_t size = uint64_t{1} << (h_.rootLog2 - node.level);
        const auto coordinate = [&](uint32_t v) {
            const uint64_t local = v & (size - 1);
            return static_cast<uint32_t>(node.stepShift >= 0 ? local >> node.stepShift : local << -node.stepShift);
        };
        const uint32_t code = radiusCodeUp(cloud_.radius[i], h_.cellSize(node));
        return {coordinate(cloud_.x[i]) | coordinate(cloud_.y[i]) << 16, coordinate(cloud_.z[i]) | code << 16,
                cloud_.normal[i], cloud_.colour[i]};
    }

    /// Largest code among the child records below each record.
    std::vector<uint32_t> childCodes(const BuildNode& node, const std::vector<Record>& records) const {
        std::vector<uint32_t> codes(records.size(), 0);
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
            size_t at = 0;
            for (const Record& child : records_[c]) {
                if (at == 0) at = static_cast<size_t>(find(records, child.begin) - records.begin());
                while (records[at].end <= child.begin) ++at;
                codes[at] = std::max(codes[at], child.code());
            }
        }
        return codes;
    }

    static std::vector<Record>::const_iterator find(const std::vector<Record>& records, uint32_t point) {
        return std::partition_point(records.begin(), records.end(), [&](const Record& r) { return r.end <= point; });
    }

    void assignParentCodes(const BuildNode& node, const std::vector<Record>& records) {
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
            const BuildNode& child = partition_.nodes[c];
            auto at = find(records, child.begin);
            if (child.childMask == 0) {
                for (uint32_t i = child.begin; i < child.end; ++i) {
                    while (at->end <= i) ++at;
                    parentCode_[i] = static_cast<uint8_t>(at->code());
                }
            } else {
                for (Record& r : records_[c]) {
                    while (at->end <= r.begin) ++at;
                    r.parentCode = static_cast<uint8_t>(at->code());
                }
            }
        }
    }

    /// Encloses the own discs and the children's spheres.
    void innerSphere(const BuildNode& node, const std::vector<Record>& records, Node& out) {
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        Box box;
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
            box.add(h_.nodes[c].centre - glm::dvec3(h_.nodes[c].radius));
            box.add(h_.nodes[c].centre + glm::dvec3(h_.nodes[c].radius));
        }
        out.centre = box.centre();
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c)
            out.radius = std::max(out.radius, glm::length(h_.nodes[c].centre - out.centre) + h_.nodes[c].radius);
        const double step = std::exp2(out.stepShift), edge = h_.cellSize(out);
        const glm::dvec3 base = h_.recordOrigin(out);
        for (const Record& r : records) {
            const glm::dvec3 p = base + step * glm::dvec3(recordX(r.packed), recordY(r.packed), recordZ(r.packed));
            const double reach = edge * static_cast<double>(shared::radiusFraction(recordRadiusCode(r.packed)));
            out.radius = std::max(out.radius, glm::length(p - out.centre) + reach);
        }
        out.radius *= 1 + 1e-6;
        innerCone(node, out);
    }

    void leafCone(const BuildNode& node, Node& out) const {
        glm::dvec3 sum(0);
        for (uint32_t i = node.begin; i < node.end; ++i) {
            if ((cloud_.colour[i] >> 24 & (shared::kFlagTwoSided | shared::kFlagNoNormal)) != 0) return;
            sum += glm::dvec3(normal_[i]);
        }
        if (!(glm::length(sum) > 1e-3 * (node.end - node.begin))) return;
        out.normalCone = octEncode(glm::vec3(glm::normalize(sum)));
        const glm::vec3 axis = shared::octDecode(out.normalCone);
        out.normalConeCosine = 1;
        for (uint32_t i = node.begin; i < node.end; ++i)
            out.normalConeCosine = std::min(out.normalConeCosine, glm::dot(axis, normal_[i]) - 1e-6f);
    }

    void innerCone(const BuildNode& node, Node& out) const {
        glm::dvec3 sum(0);
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
            if (h_.nodes[c].normalConeCosine <= -1) return;
            sum += glm::dvec3(shared::octDecode(h_.nodes[c].normalCone));
        }
        if (!(glm::length(sum) > 1e-3)) return;
        const uint32_t cone = octEncode(glm::vec3(glm::normalize(sum)));
        const glm::dvec3 axis(shared::octDecode(cone));
        double widest = 0;
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
            const glm::dvec3 child(shared::octDecode(h_.nodes[c].normalCone));
            const double between = 2 * std::asin(std::min(1.0, 0.5 * glm::length(child - axis)));
            const double half = std::acos(std::clamp(static_cast<double>(h_.nodes[c].normalConeCosine), -1.0, 1.0));
            widest = std::max(widest, between + half);
        }
        if (widest >= 3.14) return;
        out.normalCone = cone;
        out.normalConeCosine = static_cast<float>(std::cos(widest)) - 1e-6f;
    }

    struct Means {
        glm::dvec3 position{0};
        glm::vec3 normal{0};
        glm::vec3 colour{0};  ///< linear
        uint32_t flags = 0;
        float spread = 0;  ///< largest difference of a point's channel from the mean, sRGB 0..1
    };

    Means meansOf(uint32_t begin, uint32_t end) const {
        Means m;
        const double scale = 1.0 / (end - begin);
        glm::dvec3 sum(0);
        glm::vec3 colour(0), normal(0), reference(0);
        bool allNone = true;
        for (uint32_t i = begin; i < end; ++i) {
            sum += pointAt(i) - pointAt(begin);
            const uint32_t c = cloud_.colour[i], flags = c >> 24;
            colour += glm::vec3(linearOf(c & 255u), linearOf(c >> 8 & 255u), linearOf(c >> 16 & 255u));
            m.flags |= flags & (shared::kFlagTwoSided | shared::kFlagEstimatedNormal);
            if ((flags & shared::kFlagNoNormal) != 0) continue;
            if (allNone) reference = normal_[i];
            allNone = false;
            // A two-sided normal has no sign of its own: take the one that agrees with the first.
            const bool flip = (flags & shared::kFlagTwoSided) != 0 && glm::dot(normal_[i], reference) < 0;
            normal += flip ? -normal_[i] : normal_[i];
        }
        m.position = pointAt(begin) + sum * scale;
        m.colour = colour * static_cast<float>(scale);
        const float length = glm::length(normal);
        // Opposing normals cancel: the first stands for all (hard case 30).
        if (!allNone) m.normal = length > 1e-3f * static_cast<float>(end - begin) ? normal / length : reference;
        if (allNone) m.flags |= shared::kFlagNoNormal;
        const glm::vec3 mean(shared::srgbFromLinear(m.colour.x), shared::srgbFromLinear(m.colour.y),
                             shared::srgbFromLinear(m.colour.z));
        for (uint32_t i = begin; i < end; ++i) {
            const uint32_t c = cloud_.colour[i];
            const glm::vec3 d = glm::abs(glm::vec3(c & 255u, c >> 8 & 255u, c >> 16 & 255u) / 255.0f - mean);
            m.spread = std::max({m.spread, d.x, d.y, d.z});
        }
        return m;
    }

    void simplifyRecord(Record& r, const Node& node, uint32_t clusterLevel, uint32_t childCode) const {
        Means m = meansOf(r.begin, r.end);
        const uint32_t normalCode = (m.flags & shared::kFlagNoNormal) != 0 ? 0 : octEncode(m.normal);
        if ((m.flags & shared::kFlagNoNormal) == 0) m.normal = shared::octDecode(normalCode);
        // Position: to the nearest step, inside the cluster's own cell.
        const double step = std::exp2(node.stepShift), edge = h_.cellSize(node);
        const glm::dvec3 base = h_.recordOrigin(node);
        const uint64_t key = partition_.key[r.begin] >> partition_.shiftOf(clusterLevel);
        const std::array<uint32_t, 3> cell{compactBits(key), compactBits(key >> 1), compactBits(key >> 2)};
        const uint32_t cellSteps = 65536u >> (clusterLevel - node.level);
        std::array<uint32_t, 3> q{};
        glm::dvec3 decoded(0);
        for (int a = 0; a < 3; ++a) {
            const auto at = static_cast<size_t>(a);
            const uint32_t first = (cell.at(at) & ((1u << (clusterLevel - node.level)) - 1)) * cellSteps;
            const double wanted = std::floor((m.position[a] - base[a]) / step + 0.5);
            q.at(at) = static_cast<uint32_t>(std::clamp(wanted, double(first), double(first + cellSteps - 1)));
            decoded[a] = base[a] + step * q.at(at);
        }
        const Extent x = extentOf(r, decoded, m);
        const uint32_t radiusCode = radiusCodeUp(std::max(static_cast<double>(x.reach) * (1 + 1e-6), 0.5), edge);
        const double radius = static_cast<double>(shared::radiusFraction(radiusCode)) * edge;
        const double sideways = std::max(0.0, radius - static_cast<double>(x.leastExtent));
        double error = std::hypot(static_cast<double>(x.height), sideways) * (1 + 1e-5);
        if ((m.flags & shared::kFlagNoNormal) != 0) error = std::max(error, radius);
        if (r.end - r.begin == 1)
            error = glm::length(pointAt(r.begin) - decoded) + radius - static_cast<double>(cloud_.radius[r.begin]);
        if (m.spread > kColourSpread) error = std::max(error, 2 * radius);
        const uint32_t code = std::max(h_.errors.encodeUp(error), childCode);
        r.packed = {q[0] | q[1] << 16, q[2] | radiusCode << 16 | code << 24, normalCode,
                    byteOf(m.colour.x) | byteOf(m.colour.y) << 8 | byteOf(m.colour.z) << 16 | m.flags << 24};
    }

    struct Extent {
        float reach = 0;        ///< largest distance of a leaf disc's rim from the centre, in the plane
        float height = 0;       ///< largest height of a leaf disc over the plane
        float leastExtent = 0;  ///< least over the directions of the leaves' extent in the plane
    };

    Extent extentOf(const Record& r, const glm::dvec3& centre, const Means& m) const {
        static const Directions directions;
        const bool none = (m.flags & shared::kFlagNoNormal) != 0;
        const glm::vec3 n = none ? glm::vec3(0, 0, 1) : m.normal;
        const glm::vec3 t1 = glm::normalize(std::abs(n.x) < 0.7f ? glm::vec3(0, -n.z, n.y) : glm::vec3(-n.z, 0, n.x));
        const glm::vec3 t2 = glm::cross(n, t1);
        std::array<float, kDirections> extent{};
        extent.fill(-1e30f);
        Extent result;
        float reach2 = 0;
        for (uint32_t i = r.begin; i < r.end; ++i) {
            const glm::vec3 d(static_cast<float>(cloud_.x[i] - centre.x), static_cast<float>(cloud_.y[i] - centre.y),
                              static_cast<float>(cloud_.z[i] - centre.z));
            const float radius = cloud_.radius[i];
            const float u = glm::dot(d, t1), v = glm::dot(d, t2), w = none ? 0.0f : glm::dot(d, n);
            const float along = glm::dot(n, normal_[i]);
            // Height of the disc's rim over the plane; a point without a normal is a ball.
            const float rise = radius * std::sqrt(std::max(0.0f, 1.0f - along * along));
            result.height = std::max(result.height, std::abs(w) + (none ? 0.0f : rise));
            const float distance = none ? glm::length(d) : std::sqrt(u * u + v * v);
            reach2 = std::max(reach2, distance + radius);
            // What the disc adds in any direction of the plane is at least radius * |n.n_i|.
            const float inside = radius * std::abs(along);
            for (uint32_t k = 0; k < kDirections; ++k)
                extent[k] = std::max(extent[k], u * directions.c[k] + v * directions.s[k] + inside);
        }
        result.reach = reach2;
        result.leastExtent = *std::min_element(extent.begin(), extent.end());
        return result;
    }

    Cloud& cloud_;
    const Partition& partition_;
    Hierarchy& h_;
    std::vector<glm::vec3> normal_;             ///< of each point, as decoded; zero: none
    std::vector<uint8_t> parentCode_;           ///< of each leaf record
    std::vector<std::vector<Record>> records_;  ///< of inner nodes, until they are encoded
};

}  // namespace

Result<Hierarchy> simplifyAndWrite(Cloud& cloud, const Partition& partition, StoreWriter& writer, Executor& executor,
                                   Progress& progress) {
    Hierarchy h;
    h.origin = cloud.origin;
    h.unit = cloud.unit;
    h.rootLog2 = partition.rootLog2;
    h.errors.smallest = std::exp2(static_cast<double>(partition.rootLog2) + 2) / std::exp2(ErrorScale::kLargest / 8.0);
    h.nodes.resize(partition.nodes.size());
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        const BuildNode& from = partition.nodes[i];
        Node& to = h.nodes[i];
        to.parent = from.parent;
        to.firstChild = from.firstChild;
        to.cell = from.cell;
        to.level = from.level;
        to.childMask = from.childMask;
        to.stepShift = static_cast<int8_t>(static_cast<int>(partition.rootLog2) - from.level - 16);
    }
    Simplifier simplifier(cloud, partition, h);
    std::vector<std::vector<uint32_t>> parentHistograms(h.nodes.size()), ownHistograms(h.nodes.size());
    // Level by level from the finest: make the records, which fixes the parent codes of the level below; write that.
    const auto levels = static_cast<uint32_t>(partition.levelBegin.size() - 1);
    for (int level = static_cast<int>(levels) - 1; level >= -1; --level) {
        if (level >= 0) {
            const uint32_t begin = partition.levelBegin[static_cast<size_t>(level)];
            executor.parallelFor(partition.levelBegin[static_cast<size_t>(level) + 1] - begin, 1,
                                 [&](size_t b, size_t e) {
                                     for (size_t k = b; k < e; ++k) {
                                         const auto index = static_cast<uint32_t>(begin + k);
                                         if (h.nodes[index].isLeaf())
                                             simplifier.prepareLeaf(index);
                                         else
                                             simplifier.simplifyNode(index, executor);
                                     }
                                 });
        }
        const int below = level + 1;
        if (below >= static_cast<int>(levels)) continue;
        const uint32_t first = partition.levelBegin[static_cast<size_t>(below)];
        const uint32_t count = partition.levelBegin[static_cast<size_t>(below) + 1] - first;
        constexpr uint32_t kBatch = 512;  // encoded chunks held at once
        for (uint32_t batch = 0; batch < count; batch += kBatch) {
            const uint32_t batchCount = std::min(kBatch, count - batch);
            std::vector<EncodedNode> encoded(batchCount);
            executor.parallelFor(batchCount, 1, [&](size_t b, size_t e) {
                for (size_t k = b; k < e; ++k) {
                    const auto index = static_cast<uint32_t>(first + batch + k);
                    encoded[k] = simplifier.encode(index, parentHistograms[index], ownHistograms[index]);
                }
            });
            for (uint32_t k = 0; k < batchCount; ++k)
                STIPPLE_TRY(writer.appendChunk(encoded[k].chunk, encoded[k].attributes, h.nodes[first + batch + k]));
        }
        progress.update("simplify", levels - static_cast<uint32_t>(below), levels);
    }
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        h.nodes[i].parentCounts = makeCodeCounts(parentHistograms[i], h.nodes[i].records, h.greaterThan);
        h.nodes[i].ownCounts = makeCodeCounts(ownHistograms[i], h.nodes[i].records, h.greaterThan);
    }
    return h;
}

}  // namespace stipple::lod
