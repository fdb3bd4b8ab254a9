// Discs so wide on the image that one ellipse a texel does not hold them: from near by, a few of them fill the picture,
// and some have their centres beside it or behind the eye. Their pixels are filled exactly, by rays: first the nearest
// depth, then the mean of all discs about there (two passes, as Botsch & Kobbelt 2003). Camera space is that of
// frame.h.
#ifndef STIPPLE_SHARED_WIDE_DISC_H
#define STIPPLE_SHARED_WIDE_DISC_H
#include "frame.h"
#include "record.h"
#include "splat.h"
SHARED_BEGIN

const uint kDiscCapacity = 65536u;  // of a gpu's list; what is beyond is drawn as an ellipse a texel

struct WideDisc {
    vec3 centre;
    vec3 normal;   // unit, any side
    float radius;  // world units
    uint id;       // the point's place among all points (visibility.h)
};

// From this radius on, px, a disc is wide: a 32nd of the longer side of the picture, at least 32. (Below, what
// pull-push loses of discs that share a texel is small, and it closes the slits that discs of a rough surface leave.)
const float kWideShare = 0.03125f;
const float kWidePixels = 32.0f;
SHARED_FN float wideRadius(uint width, uint height) {
    return max(kWideShare * max(float(int(width)), float(int(height))), kWidePixels);
}

// 1 if a point is a wide disc. `depth`: of its centre; `radius`: world units; `perFocal`: wideRadius over the focal
// length. Those that face the eye (no normal) have no place behind it; what no surface joins to others is drawn small
// (largestSplat).
SHARED_FN float isWideDisc(uint flags, float depth, float radius, float perFocal, float nearPlane, Lens lens) {
    const float reaches = radius > lensDepth(lens, depth) * perFocal && depth + radius > nearPlane ? 1.0f : 0.0f;
    const float faces = (flags & kFlagNoNormal) != 0u && !(depth > nearPlane) ? 0.0f : 1.0f;
    return (flags & kFlagScattered) != 0u ? 0.0f : reaches * faces;
}

// Where a ray meets the plane of a disc: its depth, and rho^2, the distance from the centre in radii,
// squared. kNoDisc where it meets none, or before the near plane.
const float kNoDisc = 3.0e38f;
struct DiscHit {
    float depth;
    float rho2;
};
SHARED_FN DiscHit discHit(WideDisc d, PixelRay ray, float nearPlane) {
    const float ex = ray.ex;
    const float ey = ray.ey;
    const vec3 c = fromRay(ray, d.centre);
    const float facing = d.normal.x * ex + d.normal.y * ey + d.normal.z;
    const float ahead = d.normal.x * c.x + d.normal.y * c.y + d.normal.z * c.z;
    const float z = ahead / (abs(facing) > 1.0e-12f ? facing : 1.0e-12f);
    const float offX = z * ex - c.x;
    const float offY = z * ey - c.y;
    const float offZ = z - c.z;
    const float rho2 = (offX * offX + offY * offY + offZ * offZ) / (d.radius * d.radius);
    DiscHit hit;
    hit.rho2 = z > nearPlane ? rho2 : kNoDisc;
    hit.depth = hit.rho2 <= 1.0f ? z : kNoDisc;
    return hit;
}

// What is merged at a pixel: the discs whose depths there are the front one's, but for so much: what a quarter of its
// radius along its normal is along the ray.
SHARED_FN float depthShared(WideDisc front, PixelRay ray) {
    const float ex = ray.ex;
    const float ey = ray.ey;
    const float facing = abs(front.normal.x * ex + front.normal.y * ey + front.normal.z);
    const float length = sqrt(ex * ex + ey * ey + 1.0f);
    return kThicknessRadii * front.radius / max(facing, 0.125f * length);
}
// They count by the weight of splats (pyramid.h), at their rims hardly at all.
SHARED_FN float discWeight(DiscHit hit, float front, float apart) {
    const float k = max(1.0f - hit.rho2, 0.0f);
    return abs(hit.depth - front) <= apart ? k * k + 1.0e-4f : 0.0f;
}

// Slopes x / z between which a disc lies, seen along y: (centre, normal) are its components across and along the view.
// x / z = s touches it where the distance of its centre from that plane is the radius, seen in the disc's own plane.
// All there are, where it is not wholly before the eye. (Orthographic: x itself.)
SHARED_FN vec2 discSlopes(Lens lens, float across, float depth, float normalAcross, float normalAlong, float radius) {
    const float r2 = radius * radius;
    const float reach2 = r2 * max(1.0f - normalAlong * normalAlong, 0.0f);
    const float a = depth * depth - reach2;
    const float b = across * depth + r2 * normalAcross * normalAlong;
    // b^2 - a (across^2 - r^2 (1 - normalAcross^2)), written out: without differences of large numbers.
    const float rest = across * across * max(1.0f - normalAlong * normalAlong, 0.0f) +
                       depth * depth * max(1.0f - normalAcross * normalAcross, 0.0f) +
                       2.0f * across * depth * normalAcross * normalAlong -
                       r2 * (1.0f - normalAcross * normalAcross - normalAlong * normalAlong);
    const float root = radius * sqrt(max(rest, 0.0f));
    const bool isAhead = depth > 0.0f && a > 0.01f * depth * depth;
    const float half_ = radius * sqrt(max(1.0f - normalAcross * normalAcross, 0.0f));
    const float least = isAhead ? (b - root) / a : -3.0e38f;
    const float most = isAhead ? (b + root) / a : 3.0e38f;
    return vec2(lens.isOrthographic ? across - half_ : least, lens.isOrthographic ? across + half_ : most);
}

// How far the most of a disc lies on the side of a plane through the eye to which (x, y, z) points; of any length.
SHARED_FN float discBeyond(WideDisc d, float x, float y, float z) {
    const float facing = x * d.normal.x + y * d.normal.y + z * d.normal.z;
    const float across = sqrt(max(x * x + y * y + z * z - facing * facing, 0.0f));
    return x * d.centre.x + y * d.centre.y + z * d.centre.z + d.radius * across;
}
// 1 if a disc reaches before the near plane and between the planes through the eye and the picture's edges.
SHARED_FN float reachesPicture(WideDisc d, FrameConstants f) {
    const float left = f.centre.x / f.focal;
    const float right = (float(int(f.width)) - f.centre.x) / f.focal;
    const float top = f.centre.y / f.focal;
    const float bottom = (float(int(f.height)) - f.centre.y) / f.focal;
    // Orthographic: the sides are parallel, and so far from the axis.
    const float lean = f.orthographic != 0u ? 0.0f : 1.0f;
    const float off = 1.0f - lean;
    const float beyondX = min(discBeyond(d, 1.0f, 0.0f, lean * left) + off * left,
                              discBeyond(d, -1.0f, 0.0f, lean * right) + off * right);
    const float beyondY = min(discBeyond(d, 0.0f, 1.0f, lean * top) + off * top,
                              discBeyond(d, 0.0f, -1.0f, lean * bottom) + off * bottom);
    const float least = min(beyondX, beyondY);
    const float isAhead = discBeyond(d, 0.0f, 0.0f, 1.0f) > f.nearPlane ? 1.0f : 0.0f;
    return least >= 0.0f ? isAhead : 0.0f;
}

// The pixels of a row (or column) whose centres may lie between two slopes: first and last, within the picture.
struct PixelRange {
    int first;
    int last;
};
SHARED_FN PixelRange pixelsBetween(vec2 slopes, float focal, float centre, uint size) {
    const float most = float(int(size)) - 1.0f;
    PixelRange p;
    p.first = int(floor(min(max(slopes.x * focal + centre - 1.5f, 0.0f), most + 1.0f)));
    p.last = int(floor(min(max(slopes.y * focal + centre + 0.5f, -1.0f), most)));
    return p;
}

// The pixels that a disc may cover.
struct DiscBox {
    PixelRange x;
    PixelRange y;
};
SHARED_FN DiscBox discBox(WideDisc d, FrameConstants f) {
    DiscBox b;
    b.x = pixelsBetween(discSlopes(frameLens(f), d.centre.x, d.centre.z, d.normal.x, d.normal.z, d.radius), f.focal,
                        f.centre.x, f.width);
    b.y = pixelsBetween(discSlopes(frameLens(f), d.centre.y, d.centre.z, d.normal.y, d.normal.z, d.radius), f.focal,
                        f.centre.y, f.height);
    return b;
}

// Where a point is in camera space.
SHARED_FN vec3 recordPlace(DrawNode node, PointRecord r) {
    const float qx = float(int(recordX(r)));
    const float qy = float(int(recordY(r)));
    const float qz = float(int(recordZ(r)));
    return vec3(node.base.x + node.axisX.x * qx + node.axisY.x * qy + node.axisZ.x * qz,
                node.base.y + node.axisX.y * qx + node.axisY.y * qy + node.axisZ.y * qz,
                node.base.z + node.axisX.z * qx + node.axisY.z * qy + node.axisZ.z * qz);
}

// The normal of a point's disc in camera space; of one without, towards the eye.
SHARED_FN vec3 discNormal(DrawNode node, PointRecord r, Lens lens) {
    const vec3 c = sightTo(lens, recordPlace(node, r));
    const float inverse = -1.0f / sqrt(max(dot(c, c), 1.0e-37f));
    vec3 n = nodeNormal(node, octDecode(r.normal));
    // Wind shears: of nodes that it bends, normals are not as long as they were.
    const float shorten = 1.0f / sqrt(max(dot(n, n), 1.0e-37f));
    const float scale = (node.octantMask & kNodeTurned) != 0u ? shorten : 1.0f;
    n = vec3(n.x * scale, n.y * scale, n.z * scale);
    const bool isFree = (recordFlags(r) & kFlagNoNormal) != 0u;
    return vec3(isFree ? c.x * inverse : n.x, isFree ? c.y * inverse : n.y, isFree ? c.z * inverse : n.z);
}

SHARED_FN WideDisc wideDisc(DrawNode node, PointRecord r, float supportScale, uint id, Lens lens) {
    WideDisc d;
    d.centre = recordPlace(node, r);
    d.normal = discNormal(node, r, lens);
    d.radius = node.edge * supportScale * radiusFractionFast(recordRadiusCode(r));
    d.id = id;
    return d;
}

// Radius (and thickness, but of leaves) of a texel that is its own pixel and no ellipse, px.
const float kExactRadius = 0.25f;

SHARED_END
#endif
