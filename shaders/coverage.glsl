// From corners in camera space to triangles in 1/256 pixel: what the passes that rasterise share.
#include "mesh.glsl"

const int kMostPixels = 4096;  // of the box that one thread fills

vec3 cutEdge(vec3 a, float da, vec3 b, float db) {
    const bool isSwapped = a.x > b.x || (a.x == b.x && (a.y > b.y || (a.y == b.y && a.z > b.z)));
    const vec3 p = isSwapped ? b : a;
    const vec3 q = isSwapped ? a : b;
    const float dp = isSwapped ? db : da;
    const float dq = isSwapped ? da : db;
    return p + (q - p) * (dp / (dp - dq));
}

// Where a corner is seen; false: it has to be clipped.
bool snapCorner(vec3 p, out ivec2 snapped) {
    const float scale = frame.focal / lensDepth(frameLensHere(), p.z);
    const vec2 s = vec2(p.x * scale + frame.centre.x, p.y * scale + frame.centre.y);
    const bool isIn = p.z >= frame.nearPlane && abs(s.x) < kGuardPixels && abs(s.y) < kGuardPixels;
    snapped = isIn ? ivec2(snapPixel(s.x), snapPixel(s.y)) : ivec2(0);
    return isIn;
}
// The same of a place that was clipped.
ivec2 snappedPlace(vec3 p) {
    const float scale = frame.focal / lensDepth(frameLensHere(), p.z);
    return ivec2(snapPixel(p.x * scale + frame.centre.x), snapPixel(p.y * scale + frame.centre.y));
}

// Most triangles of a dense mesh contain no pixel's centre.
bool isBetweenCentres(ivec2 a, ivec2 b, ivec2 c) {
    const ivec2 least = min(a, min(b, c)), most = max(a, max(b, c));
    return (least.x + 127) >> 8 > (most.x - 128) >> 8 || (least.y + 127) >> 8 > (most.y - 128) >> 8;
}

// `z`: depths of the corners.
LargeTriangle triangleOf(ivec2 a, ivec2 b, ivec2 c, vec3 z, uint id) {
    LargeTriangle t;
    t.x0 = a.x;
    t.y0 = a.y;
    t.x1 = b.x;
    t.y1 = b.y;
    t.x2 = c.x;
    t.y2 = c.y;
    t.inverseDepth0 = imageLinear(frameLensHere(), z.x);
    t.inverseDepth1 = imageLinear(frameLensHere(), z.y);
    t.inverseDepth2 = imageLinear(frameLensHere(), z.z);
    t.id = id;
    return t;
}

// Turns it so that its inside is positive. False: it has no area, or is seen from behind and has one side.
bool orient(inout LargeTriangle t, bool isTwoSided) {
    const int64_t area = (int64_t(t.x1) - t.x0) * (int64_t(t.y2) - t.y0) - (int64_t(t.y1) - t.y0) * (int64_t(t.x2) - t.x0);
    if (area == 0l || (area > 0l && !isTwoSided)) return false;
    if (area > 0l) return true;
    const int x = t.x1, y = t.y1;
    const float d = t.inverseDepth1;
    t.x1 = t.x2;
    t.y1 = t.y2;
    t.inverseDepth1 = t.inverseDepth2;
    t.x2 = x;
    t.y2 = y;
    t.inverseDepth2 = d;
    return true;
}

// Pixels whose centres may lie in it: first x, first y, last x, last y.
ivec4 boxOf(LargeTriangle t) {
    return ivec4(max((min(t.x0, min(t.x1, t.x2)) + 127) >> 8, 0), max((min(t.y0, min(t.y1, t.y2)) + 127) >> 8, 0),
                 min((max(t.x0, max(t.x1, t.x2)) - 128) >> 8, int(frame.width) - 1),
                 min((max(t.y0, max(t.y1, t.y2)) - 128) >> 8, int(frame.height) - 1));
}
bool isEmptyBox(ivec4 box) { return box.x > box.z || box.y > box.w; }

// Kept for rasterise_large? Not where the list is full.
bool isKeptAsLarge(LargeTriangle t, ivec4 box) {
    if ((box.z - box.x + 1) * (box.w - box.y + 1) <= kMostPixels) return false;
    uint place;
    TAKE_PLACE(largeCount, place);
    if (place >= kLargeCapacity) return false;
    large[place] = t;
    return true;
}

// What the near plane and four planes far outside the image leave of a triangle: a polygon of so many corners.
int clipped3(vec3 a, vec3 b, vec3 c, out vec3 polygon[9]) {
    vec3 other[9];
    polygon[0] = a;
    polygon[1] = b;
    polygon[2] = c;
    int count = 3;
    const Lens lens = frameLensHere();
    const float slope = (kGuardPixels - 16384.0) / frame.focal;
    for (int plane = 0; plane < 5 && count >= 3; ++plane) {
        int kept = 0;
        for (int k = 0; k < count; ++k) {
            const vec3 p = polygon[k];
            const vec3 q = polygon[k + 1 < count ? k + 1 : 0];
            const float side = plane == 1 || plane == 3 ? -1.0 : 1.0;
            const float dp = plane == 0 ? p.z - frame.nearPlane : lensDepth(lens, p.z) * slope + side * (plane < 3 ? p.x : p.y);
            const float dq = plane == 0 ? q.z - frame.nearPlane : lensDepth(lens, q.z) * slope + side * (plane < 3 ? q.x : q.y);
            if (dp >= 0.0) other[kept++] = p;
            if ((dp >= 0.0) != (dq >= 0.0)) {
                other[kept] = cutEdge(p, dp, q, dq);
                if (plane == 0) other[kept].z = frame.nearPlane;
                ++kept;
            }
        }
        for (int k = 0; k < kept; ++k) polygon[k] = other[k];
        count = kept;
    }
    return count;
}
