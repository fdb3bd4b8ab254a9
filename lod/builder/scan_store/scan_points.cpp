#include "lod/builder/scan_store/scan_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "lod/primitives/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

Key keyOfPlace(const Frame& frame, const glm::dvec3& p) {
    const double most = std::exp2(static_cast<double>(frame.rootLog2)) - 1;
    const glm::dvec3 q = glm::clamp(glm::floor(p), glm::dvec3(0), glm::dvec3(most));
    return frame.keyOf(static_cast<uint64_t>(q.x), static_cast<uint64_t>(q.y), static_cast<uint64_t>(q.z));
}

void append(PointBlock& to, const PointBlock& from, size_t i) {
    to.position.push_back(from.position[i]);
    to.colour.push_back(from.colour[i]);
    if (!from.normal.empty()) to.normal.push_back(from.normal[i]);
}

PointBlock blockOf(const std::vector<ScanPoint>& points) {
    PointBlock out;
    bool hasNormals = true;
    for (const ScanPoint& p : points) {
        out.position.emplace_back(p.x, p.y, p.z);
        out.colour.push_back(p.colour & 0xffffffu);
        hasNormals = hasNormals && (p.colour >> 24 & shared::kFlagNoNormal) == 0;
        out.normal.emplace_back(glm::vec3(shared::octDecode(p.normal)));
    }
    if (!hasNormals) out.normal.clear();
    return out;
}

void putBlock(const PointBlock& block, ByteWriter& to) {
    to.put(block.position);
    to.put(block.colour);
    to.put(block.normal);
}

bool getBlock(ByteReader& from, PointBlock& to) {
    PointBlock block;
    from.get(block.position);
    from.get(block.colour);
    from.get(block.normal);
    const size_t n = block.position.size();
    if (from.isBroken() || block.colour.size() != n || (!block.normal.empty() && block.normal.size() != n))
        return false;
    for (size_t i = 0; i < n; ++i) append(to, block, i);
    return true;
}

PointBlock thinned(const PointBlock& block, double edge) {
    struct InCell {
        int64_t z, y, x;
        uint32_t point;
        bool isInThatOf(const InCell& o) const { return z == o.z && y == o.y && x == o.x; }
    };
    std::vector<InCell> order;
    order.reserve(block.position.size());
    for (uint32_t i = 0; i < block.position.size(); ++i) {
        const glm::dvec3 c = glm::floor(block.position[i] / edge);
        order.push_back({static_cast<int64_t>(c.z), static_cast<int64_t>(c.y), static_cast<int64_t>(c.x), i});
    }
    const auto place = [&](uint32_t i) {
        const glm::dvec3& p = block.position[i];
        return std::tie(p.z, p.y, p.x);
    };
    std::sort(order.begin(), order.end(), [&](const InCell& a, const InCell& b) {
        if (a.z != b.z) return a.z < b.z;
        if (a.y != b.y) return a.y < b.y;
        return a.x != b.x ? a.x < b.x : place(a.point) < place(b.point);
    });
    PointBlock out;
    for (size_t first = 0, end = 0; first < order.size(); first = end) {
        glm::dvec3 sum(0);
        for (end = first; end < order.size() && order[end].isInThatOf(order[first]); ++end)
            sum += block.position[order[end].point];
        const glm::dvec3 mean = sum / static_cast<double>(end - first);
        uint32_t best = order[first].point;
        for (size_t k = first; k < end; ++k)
            if (glm::distance(block.position[order[k].point], mean) < glm::distance(block.position[best], mean))
                best = order[k].point;
        append(out, block, best);
    }
    return out;
}

}  // namespace stipple::lod
