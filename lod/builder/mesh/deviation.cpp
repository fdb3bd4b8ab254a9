// The distance between two triangle surfaces with the same border, both ways.
//
// Measured are the corners, the middles of the edges and the centre of every triangle that is not in both. Between them
// the distance to a piecewise flat surface rises from two sides like a tent; where its top is not at the middle, the
// middle still has half of what the tent rises above the corners, so that excess counts twice. (A bound by convexity,
// min over the target's triangles of the largest corner distance, was tried: it needs deep subdivision wherever a
// triangle straddles two coplanar ones, cost ten times as much and gave errors a third larger.) The tests attack the
// result with dense samples.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "lod/builder/mesh/mesh_work.h"
#include "lod/builder/mesh/triangle_grid.h"
#include "lod/primitives/triangle.h"

namespace stipple::lod {
namespace {

constexpr int kColourStep = 48;  ///< sRGB steps from which colours count as different, as for points

struct Nearest {
    float distance = 3e38f;
    uint32_t triangle = 0;  ///< or one that is probably not far
};

using Triple = std::array<uint32_t, 3>;

/// Triangles in an order and form that lets equal ones be found: the smallest corner first, turned as before.
std::vector<Triple> sorted(const std::vector<uint32_t>& indices) {
    std::vector<Triple> out(indices.size() / 3);
    uint32_t any = 0;
    for (size_t i = 0; i < out.size(); ++i) {
        const uint32_t a = indices[3 * i], b = indices[3 * i + 1], c = indices[3 * i + 2];
        out[i] = a <= b && a <= c ? Triple{a, b, c} : b <= c ? Triple{b, c, a} : Triple{c, a, b};
        any |= a | b | c;
    }
    constexpr int kBits = 21;  // three to a word, in the same order
    constexpr uint64_t kMask = (uint64_t{1} << kBits) - 1;
    if (any > kMask) {
        std::sort(out.begin(), out.end());
        return out;
    }
    std::vector<uint64_t> words(out.size());
    for (size_t i = 0; i < out.size(); ++i)
        words[i] = uint64_t{out[i][0]} << 2 * kBits | uint64_t{out[i][1]} << kBits | out[i][2];
    std::sort(words.begin(), words.end());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = {static_cast<uint32_t>(words[i] >> 2 * kBits), static_cast<uint32_t>(words[i] >> kBits & kMask),
                  static_cast<uint32_t>(words[i] & kMask)};
    return out;
}

/// Of the two triangles at an edge, which turn round it in opposite directions, one measures its middle. By position:
/// at a seam they have vertices of their own. An edge with one triangle is a border, which simplification keeps.
bool isMeasuredHere(const glm::vec3& a, const glm::vec3& b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

/// Largest distance of `triangles` from the target, whose own are `others`; what stands in both needs no look.
/// `nearest`: of the vertices. Not below `worst`.
float measureSurface(const TriangleGrid& target, const std::vector<glm::vec3>& position,
                     const std::vector<Triple>& triangles, const std::vector<Triple>& others,
                     const std::vector<Nearest>& nearest, bool isBorderKept, float worst) {
    auto other = others.begin();
    for (const Triple& t : triangles) {
        while (other != others.end() && *other < t) ++other;
        if (other != others.end() && *other == t) continue;
        const auto take = [&](const glm::vec3& p, float corners, uint32_t hint) {
            const float harmless = 0.5f * (worst + corners);
            const float distance = target.leastDistance(p, hint, harmless);
            if (distance > harmless) worst = std::max(worst, corners + 2 * std::max(0.0f, distance - corners));
        };
        float all = 0;
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t v = t.at(k), w = t.at((k + 1) % 3);
            all = std::max(all, nearest[v].distance);
            if (!isBorderKept || isMeasuredHere(position[v], position[w]))
                take(0.5f * (position[v] + position[w]), std::max(nearest[v].distance, nearest[w].distance),
                     nearest[v].triangle);
        }
        take((position[t[0]] + position[t[1]] + position[t[2]]) * (1.0f / 3), all, nearest[t[0]].triangle);
    }
    return worst;
}

/// Do no two vertices look so different that shiftOf() is more than nothing?
bool areAlike(const WeldedMesh& mesh, const LocalMesh& local) {
    const shared::MeshVertex& first = mesh.vertex(local.global[0]);
    std::array<uint32_t, 3> least{255, 255, 255}, greatest{};
    for (const uint32_t v : local.global) {
        const shared::MeshVertex& vertex = mesh.vertex(v);
        if ((vertex.surface & shared::kSurfaceTextured) != 0) return false;
        if (((vertex.surface ^ first.surface) & shared::kSurfaceMaterialMask) != 0) return false;
        for (size_t k = 0; k < 3; ++k) {
            least.at(k) = std::min(least.at(k), vertex.colour >> 8 * k & 255u);
            greatest.at(k) = std::max(greatest.at(k), vertex.colour >> 8 * k & 255u);
        }
    }
    for (size_t k = 0; k < 3; ++k)
        if (greatest.at(k) - least.at(k) >= uint32_t{kColourStep}) return false;
    return true;
}

/// How far the look of vertex `v` moves along the surface if triangle `t` of the target stands in its place.
float shiftOf(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& coarse, uint32_t v,
              const TriangleGrid& target, uint32_t t, float& distance) {
    const glm::vec3 &p = local.position[v], &a = target.corner(t, 0), &b = target.corner(t, 1),
                    &c = target.corner(t, 2);
    const glm::vec2 w = closestWeights(p, a, b, c);
    distance = glm::length(p - (a + w.x * (b - a) + w.y * (c - a)));
    const std::array<float, 3> weights{1 - w.x - w.y, w.x, w.y};
    const shared::MeshVertex& own = mesh.vertex(local.global[v]);
    std::array<const shared::MeshVertex*, 3> corners{};
    for (size_t k = 0; k < 3; ++k) corners.at(k) = &mesh.vertex(local.global[coarse[3 * size_t{t} + k]]);
    const glm::vec3 e1 = b - a, e2 = c - a;
    const float longest = std::max({glm::length(e1), glm::length(e2), glm::length(c - b)});
    float shift = (own.surface & shared::kSurfaceMaterialMask) == (corners[0]->surface & shared::kSurfaceMaterialMask)
                      ? 0
                      : longest;
    for (uint32_t bits = 0; bits < 24; bits += 8) {
        float mean = 0;
        for (size_t k = 0; k < 3; ++k) mean += weights.at(k) * static_cast<float>(corners.at(k)->colour >> bits & 255u);
        if (std::abs(mean - static_cast<float>(own.colour >> bits & 255u)) > kColourStep) shift = longest;
    }
    if ((own.surface & shared::kSurfaceTextured) == 0) return shift;
    glm::vec2 uv(0);
    for (size_t k = 0; k < 3; ++k) uv += weights.at(k) * glm::vec2(corners.at(k)->u, corners.at(k)->v);
    const glm::vec2 f1(corners[1]->u - corners[0]->u, corners[1]->v - corners[0]->v),
        f2(corners[2]->u - corners[0]->u, corners[2]->v - corners[0]->v);
    const float inTexture = std::abs(f1.x * f2.y - f1.y * f2.x), inSpace = glm::length(glm::cross(e1, e2));
    const float moved = glm::length(uv - glm::vec2(own.u, own.v));
    if (moved == 0) return shift;
    return shift + std::min(inTexture > 0 ? moved * std::sqrt(inSpace / inTexture) : longest, 4 * longest);
}

/// Places near zero, so that fp32 keeps its precision (the group is small), in units in which products of four lengths
/// are numbers.
struct NearZero {
    std::vector<glm::vec3> position;
    float unit = 1;    ///< lattice units
    float extent = 0;  ///< largest coordinate
};
NearZero nearZero(const LocalMesh& local) {
    NearZero out;
    const glm::vec3 shift = local.position[0];
    for (const glm::vec3& p : local.position) {
        const glm::vec3 off = glm::abs(p - shift);
        while (std::max({off.x, off.y, off.z}) > 0x1p31f * out.unit) out.unit *= 2;
    }
    out.position.reserve(local.position.size());
    for (const glm::vec3& p : local.position) {
        const glm::vec3& q = out.position.emplace_back((p - shift) / out.unit);
        out.extent = std::max({out.extent, std::abs(q.x), std::abs(q.y), std::abs(q.z)});
    }
    return out;
}

}  // namespace

double measureDeviation(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& coarse,
                        double unimportant, bool isBorderKept) {
    const NearZero placed = nearZero(local);
    const std::vector<glm::vec3>& position = placed.position;
    const float unit = placed.unit, extent = placed.extent;
    LocalMesh near = local;
    near.position = position;
    const bool isAlike = areAlike(mesh, local);
    const TriangleGrid toCoarse(position, coarse, !isAlike);
    std::vector<Nearest> nearest(position.size());
    std::vector<uint8_t> isKept(position.size());
    for (uint32_t i = 0; i < coarse.size(); ++i) {
        nearest[coarse[i]] = {0, i / 3};
        isKept[coarse[i]] = 1;
    }
    // What moved starts from where it went.
    std::vector<uint32_t> went(position.size(), ~0u);
    for (uint32_t i = 0; i < coarse.size(); ++i)
        if (coarse[i] >= local.firstMoved()) went[local.beforeMove(coarse[i])] = i / 3;
    // So far a true distance, or not worth a closer look: what rounding makes of flat surfaces is not.
    auto worst = std::max(static_cast<float>(unimportant) / unit, 1.0f / unit + 2e-6f * extent);
    // A vertex that is gone starts from the nearest triangle of a neighbour, so that few are looked at. Looked for is
    // the least of distance and shift: beside a seam the nearest triangle may be the wrong one.
    std::vector<uint8_t>& isKnown = isKept;
    const auto find = [&](uint32_t v, uint32_t hint) {
        isKnown[v] = 1;
        if (isAlike) {
            nearest[v] = {toCoarse.leastDistance(position[v], hint), hint};
            worst = std::max(worst, nearest[v].distance);
            return;
        }
        Nearest best{3e38f, hint};
        float look = 3e38f;
        const auto visit = [&](uint32_t t) {
            float d = 0;
            const float moved = shiftOf(mesh, near, coarse, v, toCoarse, t, d);
            if (d < best.distance) best = {d, t};
            look = std::min(look, d + moved);
            return false;
        };
        visit(hint);
        toCoarse.inBall(position[v], look, visit);
        nearest[v] = best;
        worst = std::max(worst, look);
    };
    for (uint32_t v = 0; v < local.firstMoved(); ++v)
        if (!isKnown[v] && went[v] != ~0u) find(v, went[v]);
    for (bool isMore = true; isMore;) {
        isMore = false;
        for (size_t i = 0; i < near.indices.size(); ++i) {
            const uint32_t v = near.indices[i], w = near.indices[i % 3 == 2 ? i - 2 : i + 1];
            if (isKnown[v] == isKnown[w]) continue;
            find(isKnown[v] ? w : v, nearest[isKnown[v] ? v : w].triangle);
            isMore = true;
        }
    }
    for (uint32_t v = 0; v < local.firstMoved(); ++v)
        if (!isKnown[v]) find(v, 0);  // a part of its own that is gone altogether
    const std::vector<Triple> fine = sorted(near.indices), left = sorted(coarse);
    worst = measureSurface(toCoarse, position, fine, left, nearest, isBorderKept, worst);
    const TriangleGrid toFine(position, near.indices, false);
    for (uint32_t i = 0; i < near.indices.size(); ++i) nearest[near.indices[i]] = {0, i / 3};
    for (uint32_t v = local.firstMoved(); v < position.size(); ++v) {
        const uint32_t hint = nearest[local.beforeMove(v)].triangle;
        nearest[v] = {toFine.leastDistance(position[v], hint), hint};
        worst = std::max(worst, nearest[v].distance);
    }
    worst = measureSurface(toFine, position, left, fine, nearest, isBorderKept, worst);
    return (static_cast<double>(worst) * (1 + 1e-5) + static_cast<double>(extent) * 1e-6) *
           double{unit};  // fp32's share
}

}  // namespace stipple::lod
