#include "tests/support/drawn_discs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace stipple::test {
namespace {

using glm::dvec3;
using reference::Disc;

lod::Chunk chunkOf(const lod::Store& store, uint32_t node) {
    auto chunk = lod::readChunk(store, node);
    if (!chunk) throw std::runtime_error(chunk.error().line());
    return std::move(*chunk);
}

}  // namespace

std::vector<TestPoint> anyDiscs(size_t count, uint64_t seed) {
    Rng rng(seed);
    std::vector<TestPoint> points;
    while (points.size() < count) {
        const auto any = [&] { return rng.uniform(-1, 1); };
        const glm::dvec3 n = glm::normalize(glm::dvec3(any(), any(), any()));
        points.push_back({{any(), any(), any()},
                          glm::vec3(n),
                          static_cast<uint32_t>(rng.below(1u << 24)),
                          static_cast<float>(0.01 * std::exp2(rng.uniform(0, 4)))});
    }
    return points;
}

std::vector<Disc> leafDiscs(const lod::Store& store) {
    std::vector<Disc> discs;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        for (const shared::PointRecord& r : chunkOf(store, n).records)
            discs.push_back(reference::decodeDisc(h, h.nodes[n], r));
    }
    return discs;
}

std::vector<Disc> discsOfCut(const lod::Store& store, const render::FrameState& state) {
    std::vector<Disc> discs;
    const lod::Hierarchy& h = store.hierarchy;
    for (const lod::CutDraw& cut : state.draws.cut) {
        const auto chunk = lod::readDrawnChunk(store, cut.node);
        if (!chunk) continue;
        for (uint32_t i = cut.first; i < cut.first + cut.count; ++i) {
            Disc d = reference::decodeDisc(h, h.nodes[cut.node], chunk->records[i]);
            if (d.errorCode > cut.errorCode && (cut.octantMask >> d.octant & 1u) == 0) continue;
            d.radius *= cut.radiusScale;
            discs.push_back(d);
        }
    }
    return discs;
}

dvec3 rayThrough(const lod::View& view, double x, double y) {
    return view.forward + view.right * ((x - 0.5 * view.width) / view.focalPixels) +
           view.down * ((y - 0.5 * view.height) / view.focalPixels);
}

RayHits hitDiscs(const std::vector<Disc>& discs, const lod::View& view, double leastPixels) {
    RayHits hits{view.width, view.height, {}};
    hits.depths.resize(size_t{view.width} * view.height);
    for (const Disc& d : discs) {
        const dvec3 at = d.position - view.eye;
        const double z = glm::dot(at, view.forward);
        if (!(z > view.nearPlane)) continue;
        dvec3 n = d.normal;
        if ((d.flags & shared::kFlagNoNormal) != 0) n = -glm::normalize(at);
        if ((d.flags & (shared::kFlagTwoSided | shared::kFlagNoNormal)) == 0 && glm::dot(n, at) >= 0) continue;
        double pixels = std::max(d.radius * view.focalPixels / z, leastPixels);
        if ((d.flags & shared::kFlagScattered) != 0) pixels = std::min(pixels, std::max(view.height / 128.0, 4.0));
        const double radius = pixels * z / view.focalPixels;
        // The ball around the disc lies within this box of the image.
        const double nearest = std::max(z - radius, 0.05 * z),
                     reach = 1.5 * radius / nearest * view.focalPixels * glm::length(at) / z;
        const double x = glm::dot(at, view.right) / z * view.focalPixels + 0.5 * view.width,
                     y = glm::dot(at, view.down) / z * view.focalPixels + 0.5 * view.height;
        const auto first = [](double v) { return static_cast<int64_t>(std::floor(std::max(v, 0.0))); };
        for (int64_t py = first(y - reach); py < view.height && static_cast<double>(py) < y + reach; ++py)
            for (int64_t px = first(x - reach); px < view.width && static_cast<double>(px) < x + reach; ++px) {
                const dvec3 ray = rayThrough(view, static_cast<double>(px) + 0.5, static_cast<double>(py) + 0.5);
                const double t = glm::dot(n, at) / glm::dot(n, ray);
                if (!(t > view.nearPlane)) continue;
                const dvec3 off = t * ray - at;
                if (glm::dot(off, off) > radius * radius) continue;
                hits.depths[static_cast<size_t>(py) * view.width + static_cast<size_t>(px)].push_back(t);
            }
    }
    for (auto& depths : hits.depths) std::sort(depths.begin(), depths.end());
    return hits;
}

double distanceTo(const Disc& d, const dvec3& place) {
    const dvec3 off = place - d.position;
    if (d.normal == dvec3(0)) return std::max(glm::length(off) - d.radius, 0.0);
    const double above = glm::dot(off, d.normal), aside = glm::length(off - above * d.normal);
    return std::hypot(above, std::max(aside - d.radius, 0.0));
}

}  // namespace stipple::test
