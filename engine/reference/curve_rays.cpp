#include "engine/reference/curve_rays.h"

#include <algorithm>
#include <cmath>

namespace stipple::reference {
namespace {

using glm::dvec3;

/// The normal of a tube that is bent as its vertices' tangents say: where the axis was, the mean of both tangents is.
/// `lean`: share of the normal along the axis.
dvec3 bentNormal(const Segment& s, double place, const dvec3& straight, double lean) {
    const dvec3 d = glm::mix(s.directionA, s.directionB, place);
    if (!(glm::length(d) > 0)) return straight;
    const dvec3 axis = glm::normalize(d), across = glm::cross(glm::cross(axis, straight), axis);
    if (!(glm::length(across) > 0)) return straight;
    const double angle = std::asin(std::clamp(lean, -1.0, 1.0));
    return std::sin(angle) * axis + std::cos(angle) * glm::normalize(across);
}

/// Two balls and the cone that touches both. On it a point p at y along the axis from a has
/// (p - a)^2 - y^2 = (cone's radius there)^2; the cone begins where it touches the balls.
bool meetsTube(const Segment& s, const LocalRay& ray, double nearT, CurveHit& hit) {
    double best = 1e300, place = 0, lean = 0;
    dvec3 normal(0);
    const double length = glm::length(s.b - s.a), shrink = s.radiusA - s.radiusB;
    const bool hasCone = length > std::abs(shrink);
    const dvec3 w = length > 0 ? (s.b - s.a) / length : dvec3(0);
    // The tangent cone: distance from the axis = (radiusA - slope' y) / cosine, with sine = shrink / length.
    const double sine = hasCone ? shrink / length : 0, cosine = std::sqrt(1 - sine * sine);
    const double first = s.radiusA * sine, last = length + s.radiusB * sine, slack = 1e-9 * (s.radiusA + s.radiusB);
    const auto ball = [&](const dvec3& centre, double radius, int end) {
        const dvec3 off = ray.origin - centre;
        const double a = glm::dot(ray.direction, ray.direction), b = glm::dot(off, ray.direction),
                     c = glm::dot(off, off) - radius * radius, d = b * b - a * c;
        if (d < 0) return;
        for (const double t : {(-b - std::sqrt(d)) / a, (-b + std::sqrt(d)) / a}) {
            if (!(t > nearT) || t >= best) continue;
            const dvec3 n = (off + t * ray.direction) / radius;
            // What lies inside the cone is no surface.
            const double y = glm::dot(ray.origin + t * ray.direction - s.a, w);
            if (hasCone && (end == 0 ? y > first + slack : y < last - slack)) continue;
            best = t;
            place = end;
            normal = n;
            const dvec3 d0 = end == 0 ? s.directionA : s.directionB;
            const double own = glm::length(d0) > 0 ? glm::dot(n, glm::normalize(d0)) : 0;
            lean = end == 0 ? std::min(own, sine) : std::max(own, sine);
        }
    };
    if (hasCone || shrink >= 0) ball(s.a, s.radiusA, 0);
    if (hasCone || shrink < 0) ball(s.b, s.radiusB, 1);
    if (hasCone) {
        const dvec3 off = ray.origin - s.a;
        const double oy = glm::dot(off, w), dy = glm::dot(ray.direction, w);
        const dvec3 op = off - oy * w, dp = ray.direction - dy * w;
        // |op + t dp| cosine + (oy + t dy) sine = radiusA
        const double k0 = (s.radiusA - oy * sine) / cosine, k1 = -dy * sine / cosine;
        const double a = glm::dot(dp, dp) - k1 * k1, b = glm::dot(op, dp) - k0 * k1, c = glm::dot(op, op) - k0 * k0;
        const double d = b * b - a * c;
        if (d >= 0 && a != 0)
            for (const double t : {(-b - std::sqrt(d)) / a, (-b + std::sqrt(d)) / a}) {
                if (!(t > nearT) || t >= best || k0 + t * k1 < 0) continue;
                const double y = oy + t * dy;
                if (y < first || y > last) continue;
                best = t;
                normal = glm::normalize(op + t * dp) * cosine + w * sine;
                lean = sine;
                place = std::clamp((y - first) / (last - first), 0.0, 1.0);
            }
    }
    if (best >= 1e300) return false;
    const bool isInside = glm::dot(normal, ray.direction) > 0;
    dvec3 bent = (isInside ? -1.0 : 1.0) * (hasCone ? bentNormal(s, place, normal, lean) : normal);
    const dvec3 v = glm::normalize(ray.direction);
    if (glm::dot(bent, v) > 0) bent = glm::normalize(bent - glm::dot(bent, v) * v);
    hit = {best, place, bent};
    return true;
}

/// Bilinear patch p(u, v) = (1-u)(1-v) q00 + u (1-v) q10 + (1-u) v q01 + u v q11: u from one edge to the other, v along
/// the curve. The ray's two planes give a quadratic in v.
bool meetsRibbon(const Segment& s, const LocalRay& ray, double nearT, CurveHit& hit) {
    const dvec3 wa = s.radiusA * s.directionA, wb = s.radiusB * s.directionB;
    const dvec3 q00 = s.a - wa, q10 = s.a + wa, q01 = s.b - wb, q11 = s.b + wb;
    // Points of the patch minus the ray's origin, seen along the ray: two equations in (u, v).
    const dvec3 d = glm::normalize(ray.direction);
    const dvec3 e1 =
                    glm::normalize(std::abs(d.x) < 0.7 ? glm::cross(d, dvec3(1, 0, 0)) : glm::cross(d, dvec3(0, 1, 0))),
                e2 = glm::cross(d, e1);
    const auto flat = [&](const dvec3& p) {
        return glm::dvec2(glm::dot(p - ray.origin, e1), glm::dot(p - ray.origin, e2));
    };
    const glm::dvec2 p00 = flat(q00), p10 = flat(q10), p01 = flat(q01), p11 = flat(q11);
    // A + u B + v C + u v D = 0
    const glm::dvec2 A = p00, B = p10 - p00, C = p01 - p00, D = p11 - p10 - p01 + p00;
    const auto cross2 = [](const glm::dvec2& x, const glm::dvec2& y) { return x.x * y.y - x.y * y.x; };
    // (A + v C) x (B + v D) = 0
    const double k2 = cross2(C, D), k1 = cross2(A, D) + cross2(C, B), k0 = cross2(A, B);
    std::array<double, 2> roots{};
    int count = 0;
    if (std::abs(k2) < 1e-14 * (std::abs(k1) + std::abs(k0) + 1e-300)) {
        if (k1 != 0) roots.at(static_cast<size_t>(count++)) = -k0 / k1;
    } else if (const double disc = k1 * k1 - 4 * k2 * k0; disc >= 0) {
        const double q = -0.5 * (k1 + std::copysign(std::sqrt(disc), k1));
        roots[0] = q / k2;
        roots[1] = q != 0 ? k0 / q : roots[0];
        count = 2;
    }
    double best = 1e300;
    for (int i = 0; i < count; ++i) {
        const double v = roots.at(static_cast<size_t>(i));
        if (!(v >= 0 && v <= 1)) continue;
        const glm::dvec2 from = A + v * C, along = B + v * D;
        const double length2 = glm::dot(along, along);
        if (!(length2 > 0)) continue;
        const double u = -glm::dot(from, along) / length2;
        if (!(u >= 0 && u <= 1)) continue;
        const dvec3 p = (1 - u) * ((1 - v) * q00 + v * q01) + u * ((1 - v) * q10 + v * q11);
        const double at = glm::dot(p - ray.origin, ray.direction) / glm::dot(ray.direction, ray.direction);
        if (!(at > nearT) || at >= best) continue;
        best = at;
        const dvec3 n = glm::cross((1 - v) * (q10 - q00) + v * (q11 - q01), (1 - u) * (q01 - q00) + u * (q11 - q10));
        hit = {at, v, glm::length(n) > 0 ? glm::normalize(n) : -d};
        if (glm::dot(hit.normal, ray.direction) > 0) hit.normal = -hit.normal;
    }
    return best < 1e300;
}

}  // namespace

bool meetsSegment(const Segment& s, const LocalRay& ray, double nearT, CurveHit& hit) {
    return s.isTube ? meetsTube(s, ray, nearT, hit) : meetsRibbon(s, ray, nearT, hit);
}

}  // namespace stipple::reference
