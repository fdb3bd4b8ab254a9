#include "lod/verify/patches.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lod/primitives/triangle.h"
#include "lod/store/patch_bytes.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kMostPlaces = 512;

double squaredDistance(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    const glm::dvec2 w = closestWeights(p, a, b, c);
    const glm::dvec3 d = p - (a + w.x * (b - a) + w.y * (c - a));
    return glm::dot(d, d);
}

/// Of the nearest place of a patch, where that is nearer than `limit`; `enough`: nobody asks for less.
double distanceTo(const Patch& patch, const glm::dvec3& p, double limit, double enough) {
    const double step = double{patch.step}, quantum = patch.quantum();
    const glm::dvec3 q = glm::transpose(patch.frame()) * (p - patch.origin);  // along the patch's axes
    const auto first = [&](double at) { return std::max(0.0, std::floor((at - limit) / step)); };
    const auto last = [&](double at, uint32_t n) { return std::min(std::floor((at + limit) / step), n - 2.0); };
    for (double j = first(q.y); j <= last(q.y, patch.height); ++j)
        for (double i = first(q.x); i <= last(q.x, patch.width); ++i) {
            const auto u = static_cast<uint32_t>(i), v = static_cast<uint32_t>(j);
            if (!patch.hasCell(u, v)) continue;
            const size_t w = patch.width;
            const uint16_t* const h = patch.heights.data() + patch.at(u, v);
            const auto [low, high] = std::minmax({h[0], h[1], h[w], h[w + 1]});
            if (q.z < low * quantum - limit || q.z > high * quantum + limit) continue;
            const auto corner = [&](size_t k) {
                const double right = k % 2 != 0 ? 1 : 0, up = k / 2 != 0 ? 1 : 0;
                return glm::dvec3((i + right) * step, (j + up) * step, h[k % 2 + w * (k / 2)] * quantum);
            };
            const auto& t = cellTriangles(h[0], h[1], h[w], h[w + 1]);
            for (size_t k = 0; k < 6; k += 3)
                limit =
                    std::min(limit, std::sqrt(squaredDistance(q, corner(t[k]), corner(t[k + 1]), corner(t[k + 2]))));
            if (limit <= enough) return limit;
        }
    return limit;
}

double sizeOf(const Hierarchy& h, uint32_t node) { return h.cellSize(h.nodes[node]); }
glm::dvec3 cornerOf(const Hierarchy& h, uint32_t node) {
    const Node& n = h.nodes[node];
    return glm::dvec3(n.cell[0], n.cell[1], n.cell[2]) * h.cellSize(n);
}
bool isIn(const glm::dvec3& p, const glm::dvec3& corner, double edge) {
    return glm::all(glm::lessThanEqual(corner, p)) && glm::all(glm::lessThanEqual(p, corner + edge));
}

/// Nodes for which use(node) is true and whose spheres meet that of `of`.
template <typename Use>
std::vector<uint32_t> nodesAround(const Hierarchy& h, uint32_t of, const Use& use) {
    std::vector<uint32_t> found, stack{0};
    const Node& own = h.nodes[of];
    while (!stack.empty()) {
        const uint32_t n = stack.back();
        stack.pop_back();
        const Node& node = h.nodes[n];
        if (glm::distance(node.centre, own.centre) > node.radius + own.radius) continue;
        if (use(n)) found.push_back(n);
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
    }
    std::sort(found.begin(), found.end());
    return found;
}

Result<std::vector<NodeSurface>> readAll(const Store& store, const std::vector<uint32_t>& nodes) {
    std::vector<NodeSurface> out;
    for (const uint32_t n : nodes) {
        STIPPLE_ASSIGN(NodeSurface surface, NodeSurface::read(store, n));
        out.push_back(std::move(surface));
    }
    return out;
}

}  // namespace

Result<std::vector<Patch>> readPatches(const Store& store, uint32_t chunk) {
    const ChunkPlace place = chunkPlace(store.hierarchy, chunk);
    std::vector<uint8_t> bytes(place.bytes);
    STIPPLE_TRY(store.file->readAt(place.offset, bytes.data(), bytes.size()));
    const Payload& payload = store.hierarchy.payload(chunk);
    return decodePatches(bytes, fmt::format("{}: node {}", store.path, store.hierarchy.nodeOf(chunk)),
                         {payload.records, payload.maps});
}

Result<NodeSurface> NodeSurface::read(const Store& store, uint32_t node) {
    const Hierarchy& h = store.hierarchy;
    NodeSurface out;
    out.corner_ = cornerOf(h, node);
    std::vector<uint32_t> chunks;
    h.forEachPayload(node, [&](uint32_t chunk) { chunks.push_back(chunk); });
    for (const uint32_t chunk : chunks) {
        const Payload& payload = h.payload(chunk);
        if (payload.kind == Kind::patches) {
            STIPPLE_ASSIGN(out.patches_, readPatches(store, chunk));
        } else if (payload.kind == Kind::points) {
            STIPPLE_ASSIGN(const Chunk points, readChunk(store, chunk));
            const glm::dvec3 base = h.recordOrigin(h.nodes[node], payload);
            const double step = std::exp2(payload.stepShift), edge = sizeOf(h, node);
            for (const shared::PointRecord& r : points.records)
                out.discs_.push_back(
                    {base + step * glm::dvec3(shared::recordX(r), shared::recordY(r), shared::recordZ(r)),
                     edge * static_cast<double>(shared::radiusFraction(shared::recordRadiusCode(r)))});
        }
    }
    std::sort(out.discs_.begin(), out.discs_.end(), [](const Disc& a, const Disc& b) { return a.place.x < b.place.x; });
    for (const Disc& d : out.discs_) out.largestDisc_ = std::max(out.largestDisc_, d.radius);
    return out;
}

std::span<const NodeSurface::Disc> NodeSurface::discsNear(double x, double distance) const {
    const double reach = (distance + largestDisc_) * (1 + 1e-9);
    const auto first = std::lower_bound(discs_.begin(), discs_.end(), x - reach,
                                        [](const Disc& d, double at) { return d.place.x < at; });
    const auto last =
        std::upper_bound(first, discs_.end(), x + reach, [](double at, const Disc& d) { return at < d.place.x; });
    return {first, last};
}

bool NodeSurface::isWithin(const glm::dvec3& p, double distance) const {
    // (A little more than asked for, so that "none" is told from "just as far".)
    const double limit = distance * (1 + 1e-12) + 1e-300;
    for (const Patch& patch : patches_)
        if (distanceTo(patch, p - corner_, limit, distance) <= distance) return true;
    for (const Disc& d : discsNear(p.x, distance))
        if (glm::distance(p, d.place) <= distance + d.radius) return true;
    return false;
}

double NodeSurface::distance(const glm::dvec3& p, double limit) const {
    for (const Patch& patch : patches_) limit = distanceTo(patch, p - corner_, limit, 0);
    for (const Disc& d : discsNear(p.x, limit))
        limit = std::min(limit, std::max(0.0, glm::distance(p, d.place) - d.radius));
    return limit;
}

Result<uint64_t> measurePatches(const Store& store, uint32_t chunk, uint64_t most) {
    const Hierarchy& h = store.hierarchy;
    const uint32_t number = h.nodeOf(chunk);
    const Node& node = h.nodes[number];
    if (node.isLeaf()) return 0;
    const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
    for (uint32_t c = 0; c < children; ++c)
        if (!h.nodes[node.firstChild + c].isLeaf()) return 0;
    const uint64_t places = std::min(most, kMostPlaces);
    const std::vector<uint32_t> leaves = nodesAround(h, number, [&](uint32_t n) { return h.nodes[n].isLeaf(); });
    // (Of both from what they were made of.)
    uint32_t ofLeaves = 0;
    for (const uint32_t n : leaves) ofLeaves = std::max<uint32_t>(ofLeaves, h.nodes[n].sourceCode);
    const double error = (h.errors.decode(node.errorCode) + h.errors.decode(ofLeaves)) * (1 + 1e-9) + 1e-6;
    const std::vector<uint32_t> level = nodesAround(h, number, [&](uint32_t n) {
        return h.nodes[n].level == node.level || (h.nodes[n].isLeaf() && h.nodes[n].level < node.level);
    });
    STIPPLE_ASSIGN(const std::vector<NodeSurface> fine, readAll(store, leaves));
    STIPPLE_ASSIGN(const std::vector<NodeSurface> coarse, readAll(store, level));
    uint64_t measured = 0, far = 0;
    const auto check = [&](const NodeSurface& from, const std::vector<NodeSurface>& to, const glm::dvec3& corner,
                           double edge) {
        from.forPlaces(places, [&](const glm::dvec3& p) {
            if (!isIn(p, corner, edge)) return;
            ++measured;
            far +=
                std::none_of(to.begin(), to.end(), [&](const NodeSurface& s) { return s.isWithin(p, error); }) ? 1 : 0;
        });
    };
    for (size_t k = 0; k < level.size(); ++k)
        if (level[k] == number) check(coarse[k], fine, cornerOf(h, number), sizeOf(h, number));
    for (size_t k = 0; k < leaves.size(); ++k)
        if (h.nodes[leaves[k]].parent == number) check(fine[k], coarse, cornerOf(h, leaves[k]), sizeOf(h, leaves[k]));
    if (far == 0) return measured;
    return fail(ErrorKind::input,
                fmt::format("{} of {} places lie farther from the leaves than their errors, together {:.3g} units, say",
                            far, measured, error * h.unit),
                fmt::format("{}: node {}", store.path, number),
                "this is a fault of the build; please report it with the input");
}

}  // namespace stipple::lod
