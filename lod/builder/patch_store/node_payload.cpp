#include "lod/builder/patch_store/node_payload.h"

#include <algorithm>
#include <cmath>

#include "lod/builder/points/aggregate.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_blocks.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/chunk.h"

namespace stipple::lod {
namespace {

/// The nearest place to `p` in the cells of [corner, corner + edge) that are marked.
glm::dvec3 nearestIn(const glm::dvec3& p, const glm::dvec3& corner, double edge, uint32_t mask, double last) {
    const double half = 0.5 * edge;
    glm::dvec3 best = p;
    double least = 1e300;
    for (uint32_t octant = 0; octant < 8; ++octant) {
        if ((mask >> octant & 1u) == 0) continue;
        glm::dvec3 q = p;
        for (int a = 0; a < 3; ++a) {
            const double lo = corner[a] + ((octant >> a & 1u) != 0 ? half : 0.0);
            q[a] = std::clamp(q[a], lo, lo + half - last);
        }
        const double d = glm::distance(p, q);
        if (d >= least) continue;
        least = d;
        best = q;
    }
    return best;
}

template <typename Use>
void forSamples(const std::vector<Patch>& patches, const glm::dvec3& corner, const Use& use) {
    for (const Patch& p : patches) {
        const PatchSurface surface(p);
        for (size_t s = 0; s < p.heights.size(); ++s)
            if (p.heights[s] != 0) use(corner + surface.position(s));
    }
}

}  // namespace

uint32_t blocksIn(const std::vector<Patch>& patches) {
    uint32_t blocks = 0;
    for (const Patch& p : patches) blocks += countBlocks(p);
    return blocks;
}

DiscPayload encodeDiscs(std::vector<LeftDisc>& discs, const Frame& frame, const Node& node, uint32_t code) {
    DiscPayload out;
    const double edge = frame.cellSize(node.level);
    const int shift = static_cast<int>(frame.rootLog2) - node.level - 16;
    const double step = std::exp2(shift);
    const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * edge;
    const glm::dvec3 base = corner + glm::dvec3(shift > 0 ? 0.5 * (step - 1) : 0.0);
    const uint32_t mask = node.isLeaf() ? 255u : node.childMask;
    Chunk chunk;
    for (LeftDisc& d : discs) {
        const glm::dvec3 inside = nearestIn(d.place, corner, edge, mask, step);
        const glm::dvec3 q = glm::clamp(glm::floor((inside - corner) / step), glm::dvec3(0), glm::dvec3(65535));
        const glm::dvec3 at = base + step * q;
        const double moved = glm::distance(at, d.place);
        out.moved = std::max(out.moved, moved);
        d.place = at;
        const uint32_t radius = radiusCodeUp(double{d.radius} + moved, edge);
        d.radius = static_cast<float>(radiusOf(radius, edge) * (1 + 1e-6));
        const auto word = [&](int a) { return static_cast<uint32_t>(q[a]); };
        chunk.records.push_back({word(0) | word(1) << 16, word(2) | radius << 16 | code << 24, octEncode(d.normal),
                                 (withEmission(d.colour, d.light) & 0xffffffu) | shared::kFlagTwoSided << 24});
    }
    out.bytes = encodeChunk(chunk);
    return out;
}

void addSamples(const std::vector<Patch>& patches, const glm::dvec3& corner, glm::dvec3& lo, glm::dvec3& hi) {
    forSamples(patches, corner, [&](const glm::dvec3& p) {
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    });
}

double farthestSample(const std::vector<Patch>& patches, const glm::dvec3& corner, const glm::dvec3& centre) {
    double far = 0;
    forSamples(patches, corner, [&](const glm::dvec3& p) { far = std::max(far, glm::distance(p, centre)); });
    return far;
}

}  // namespace stipple::lod
