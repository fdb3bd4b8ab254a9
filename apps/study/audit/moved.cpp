#include "apps/study/audit/moved.h"

#include <algorithm>
#include <cmath>

#include "lod/store/store.h"

namespace stipple::study {

using glm::dvec3;

dvec3 Sway::moved(const dvec3& p) const {
    const double u = (glm::dot(up, p) - foot) / height;
    return p + along * (swing * u * u);
}

Sway swayOf(const render::PlacedStore& placed, const dvec3& up, const dvec3& towards, double strength, double seconds) {
    const lod::Hierarchy& h = placed.store->hierarchy;
    const lod::Instance& at = placed.place;
    const dvec3 middle =
        at.translation + at.rotation * (at.scale * (h.origin + h.unit * dvec3(h.nodes.front().centre)));
    const double reach = at.scale * h.unit * h.nodes.front().radius;
    Sway s;
    s.up = up;
    s.along = glm::normalize(towards - glm::dot(towards, up) * up);
    s.height = 2 * reach;
    s.foot = glm::dot(up, middle) - reach;
    s.most = strength * s.height;
    // Two waves that travel with the wind, 60 m from one to the next; tall plants swing slowly.
    constexpr double kTurn = 6.283185307179586;
    const double slow = std::sqrt(std::max(s.height, 0.1)), away = glm::dot(towards, at.translation) / 60;
    s.swing = s.most * (0.7 * std::sin(std::fmod(kTurn * (0.9 * seconds / slow - away), kTurn)) +
                        0.3 * std::sin(std::fmod(kTurn * (2.07 * seconds / slow - 1.7 * away), kTurn)));
    return s;
}

FullShapes moved(const FullShapes& shapes, const Sway& sway) {
    FullShapes out = shapes;
    for (FullDisc& d : out.discs) {
        const dvec3 from = d.centre;
        d.centre = sway.moved(from);
        if (d.normal == dvec3(0)) continue;
        // By two of its radii.
        const dvec3 a = glm::normalize(
                        glm::cross(d.normal, std::abs(d.normal.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0))),
                    b = glm::cross(d.normal, a);
        const dvec3 n =
            glm::cross(sway.moved(from + d.radius * a) - d.centre, sway.moved(from + d.radius * b) - d.centre);
        if (glm::length(n) > 0) d.normal = glm::normalize(n);
    }
    for (FullTriangle& t : out.triangles)
        for (dvec3& corner : t) corner = sway.moved(corner);
    for (FullTube& t : out.tubes) {
        t.a = sway.moved(t.a);
        t.b = sway.moved(t.b);
    }
    return out;
}

double farthestMoved(const FullShapes& shapes, const Sway& sway) {
    double most = 0;
    const auto look = [&](const dvec3& p) { most = std::max(most, glm::length(sway.moved(p) - p)); };
    for (const FullDisc& d : shapes.discs) look(d.centre);
    for (const FullTriangle& t : shapes.triangles)
        for (const dvec3& corner : t) look(corner);
    for (const FullTube& t : shapes.tubes) {
        look(t.a);
        look(t.b);
    }
    return sway.most > 0 ? most / sway.most : 0;
}

}  // namespace stipple::study
