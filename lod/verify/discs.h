// Discs of records as a store's file has them, and how far places are off them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "lod/store/store.h"

namespace stipple::lod {

/// Lattice units.
struct Disc {
    std::array<uint64_t, 3> cell;  ///< of the clusters
    glm::dvec3 place, normal;
    double radius;
    uint32_t code;
    bool hasNormal;
};

/// Of records [first, end).
inline void addDiscs(const Hierarchy& h, const Node& node, const Chunk& chunk, size_t first, size_t end,
                     double clusterSize, std::vector<Disc>& discs) {
    const double step = std::exp2(node.stepShift), edge = h.cellSize(node);
    const glm::dvec3 base = h.recordOrigin(node);
    for (size_t i = first; i < end; ++i) {
        const shared::PointRecord& r = chunk.records[i];
        Disc d{};
        d.place = base + step * glm::dvec3(shared::recordX(r), shared::recordY(r), shared::recordZ(r));
        if (!chunk.lowBits.empty())  // the exact place instead of the middle of its step
            d.place +=
                glm::dvec3(chunk.lowBits[3 * i], chunk.lowBits[3 * i + 1], chunk.lowBits[3 * i + 2]) - 0.5 * (step - 1);
        d.normal = glm::dvec3(glm::vec3(shared::octDecode(r.normal)));
        d.hasNormal = (shared::recordFlags(r) & shared::kFlagNoNormal) == 0;
        d.radius = edge * static_cast<double>(shared::radiusFraction(shared::recordRadiusCode(r)));
        d.code = shared::recordErrorCode(r);
        for (int a = 0; a < 3; ++a)
            d.cell.at(static_cast<size_t>(a)) = static_cast<uint64_t>(std::max(d.place[a], 0.0) / clusterSize);
        discs.push_back(d);
    }
}

/// Of a chunk that was read as it is drawn.
inline size_t overviewOf(const Hierarchy& h, const Payload& payload, const Chunk& chunk) {
    return std::min<size_t>(h.overviewOf(payload), chunk.records.size());
}

/// Distance of a place from a disc. One without a normal turns with the view: only its centre is there in all of them,
/// unless what it is held against turns as well (`isBall`).
inline double distanceOf(const glm::dvec3& place, const Disc& disc, bool isBall) {
    const glm::dvec3 d = place - disc.place;
    if (!disc.hasNormal) return std::max(0.0, glm::length(d) - (isBall ? disc.radius : 0.0));
    const double height = glm::dot(d, disc.normal);
    return std::hypot(height, std::max(0.0, glm::length(d - height * disc.normal) - disc.radius));
}

/// Largest distance of some places of a disc (or ball), if it exceeds `enough`; else less. `distanceOf(place)`: from
/// what it is held against.
template <typename DistanceOf>
double farthestPlace(const Disc& disc, int rings, int angles, double enough, const DistanceOf& distanceOf) {
    double worst = 0;
    const auto look = [&](const glm::dvec3& off) {
        if (worst <= enough) worst = std::max(worst, distanceOf(disc.place + disc.radius * off));
    };
    look(glm::dvec3(0));
    const glm::dvec3 n = disc.hasNormal ? disc.normal : glm::dvec3(0, 0, 1);
    const glm::dvec3 t = glm::normalize(std::abs(n.x) < 0.7 ? glm::dvec3(0, -n.z, n.y) : glm::dvec3(-n.z, 0, n.x)),
                     b = glm::cross(n, t);
    for (int ring = 1; ring <= rings; ++ring)
        for (int k = 0; k < angles; ++k) {
            const double angle = 6.283185307179586 * k / angles, share = static_cast<double>(ring) / rings;
            look(share * (std::cos(angle) * t + std::sin(angle) * b));
            if (!disc.hasNormal) look(share * (std::cos(angle) * t + std::sin(angle) * n));
        }
    return worst;
}

}  // namespace stipple::lod
