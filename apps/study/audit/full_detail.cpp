#include "apps/study/audit/full_detail.h"

#include <algorithm>
#include <cmath>

#include "apps/study/audit/nearest_field.h"

namespace stipple::study {
namespace {

using glm::dvec3;

template <typename Shape>
struct Of {
    using Item = Shape;
    static void grow(const FullDisc& d, dvec3& lo, dvec3& hi) {
        lo = glm::min(lo, d.centre - d.radius);
        hi = glm::max(hi, d.centre + d.radius);
    }
    static void grow(const FullTriangle& t, dvec3& lo, dvec3& hi) {
        for (const dvec3& corner : t) {
            lo = glm::min(lo, corner);
            hi = glm::max(hi, corner);
        }
    }
    static void grow(const FullTube& t, dvec3& lo, dvec3& hi) {
        lo = glm::min(lo, glm::min(t.a - t.radiusA, t.b - t.radiusB));
        hi = glm::max(hi, glm::max(t.a + t.radiusA, t.b + t.radiusB));
    }
    static double along(const FullDisc& d, int axis) { return d.centre[axis]; }
    static double along(const FullTriangle& t, int axis) { return t[0][axis] + t[1][axis] + t[2][axis]; }
    static double along(const FullTube& t, int axis) { return t.a[axis] + t.b[axis]; }
    static double distance(const Shape& shape, const dvec3& place) { return distanceTo(shape, place); }
};

}  // namespace

double distanceTo(const FullDisc& d, const dvec3& place) {
    const dvec3 off = place - d.centre;
    if (d.normal == dvec3(0)) return std::max(glm::length(off) - d.radius, 0.0);
    const double above = glm::dot(off, d.normal), aside = glm::length(off - above * d.normal);
    return std::hypot(above, std::max(aside - d.radius, 0.0));
}

// By the regions of a triangle's plane (Ericson 2005, section 5.1.5): corners, edges, inside.
double distanceTo(const FullTriangle& t, const dvec3& p) {
    const dvec3 ab = t[1] - t[0], ac = t[2] - t[0];
    const dvec3 ap = p - t[0], bp = p - t[1], cp = p - t[2];
    const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return glm::length(ap);
    const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return glm::length(bp);
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return glm::length(ap - d1 / (d1 - d3) * ab);
    const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return glm::length(cp);
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return glm::length(ap - d2 / (d2 - d6) * ac);
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 >= d3 && d5 >= d6) return glm::length(bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (t[2] - t[1]));
    const double whole = va + vb + vc;
    if (!(whole > 0)) return std::min({glm::length(ap), glm::length(bp), glm::length(cp)});
    return glm::length(ap - vb / whole * ab - vc / whole * ac);
}

double distanceTo(const FullTube& t, const dvec3& place) {
    const dvec3 along = t.b - t.a;
    const double length2 = glm::dot(along, along);
    const double s = length2 > 0 ? std::clamp(glm::dot(place - t.a, along) / length2, 0.0, 1.0) : 0;
    return std::max(glm::length(place - t.a - s * along) - (t.radiusA + s * (t.radiusB - t.radiusA)), 0.0);
}

struct FullDetail::Fields {
    NearestField<Of<FullDisc>> discs;
    NearestField<Of<FullTriangle>> triangles;
    NearestField<Of<FullTube>> tubes;
};

FullDetail::FullDetail(FullShapes shapes)
    : fields_(new Fields{NearestField<Of<FullDisc>>(std::move(shapes.discs)),
                         NearestField<Of<FullTriangle>>(std::move(shapes.triangles)),
                         NearestField<Of<FullTube>>(std::move(shapes.tubes))}) {}
FullDetail::~FullDetail() = default;
FullDetail::FullDetail(FullDetail&&) noexcept = default;
FullDetail& FullDetail::operator=(FullDetail&&) noexcept = default;

double FullDetail::distance(const dvec3& place, double limit) const {
    limit = fields_->discs.distance(place, limit);
    limit = fields_->triangles.distance(place, limit);
    return fields_->tubes.distance(place, limit);
}

}  // namespace stipple::study
