// One workgroup per cluster: its vertices are projected once, then one thread per triangle fills what is small and keeps
// what is large for rasterise_large.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../mesh.glsl"
layout(local_size_x = 256) in;

shared vec3 at[256];
shared ivec2 snapped[256];
shared uint clipped[256];

const int kMostPixels = 4096;  // of the box that one thread fills

vec3 cutEdge(vec3 a, float da, vec3 b, float db) {
    const bool isSwapped = a.x > b.x || (a.x == b.x && (a.y > b.y || (a.y == b.y && a.z > b.z)));
    const vec3 p = isSwapped ? b : a;
    const vec3 q = isSwapped ? a : b;
    const float dp = isSwapped ? db : da;
    const float dq = isSwapped ? da : db;
    return p + (q - p) * (dp / (dp - dq));
}

void takeTriangle(LargeTriangle t, DrawCluster c, uint surface, uint corners) {
    const int64_t area = (int64_t(t.x1) - t.x0) * (int64_t(t.y2) - t.y0) - (int64_t(t.y1) - t.y0) * (int64_t(t.x2) - t.x0);
    if (area == 0l || (area > 0l && (surface & kSurfaceTwoSided) == 0u)) return;
    if (area < 0l) {
        const int x = t.x1, y = t.y1;
        const float d = t.inverseDepth1;
        t.x1 = t.x2;
        t.y1 = t.y2;
        t.inverseDepth1 = t.inverseDepth2;
        t.x2 = x;
        t.y2 = y;
        t.inverseDepth2 = d;
    }
    const int x0 = max((min(t.x0, min(t.x1, t.x2)) + 127) >> 8, 0);
    const int x1 = min((max(t.x0, max(t.x1, t.x2)) - 128) >> 8, int(frame.width) - 1);
    const int y0 = max((min(t.y0, min(t.y1, t.y2)) + 127) >> 8, 0);
    const int y1 = min((max(t.y0, max(t.y1, t.y2)) - 128) >> 8, int(frame.height) - 1);
    if (x0 > x1 || y0 > y1) return;
    const bool isMasked = (surface & kSurfaceMasked) != 0u;
    if (!isMasked && (x1 - x0 + 1) * (y1 - y0 + 1) > kMostPixels) {
        const uint place = atomicAdd(largeCount, 1u);
        if (place < kLargeCapacity) {
            large[place] = t;
            return;
        }
    }
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
            float inverseDepth;
            if (isCovered(t, x, y, inverseDepth) && (!isMasked || isKept(c, corners, uvec2(x, y))))
                offer(x, y, inverseDepth, drawId(frame.firstBlock.of[kKindTriangles], t.id));
        }
}

void main() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= stepInfo.count) return;
    const DrawCluster c = clusters[block];
    const DrawMesh m = meshes[c.mesh];
    Vertices vertices = Vertices(uvec2(c.verticesLow, c.verticesHigh));
    const uint i = gl_LocalInvocationID.x;
    if (i < (c.counts & 0xffffu) >> (m.places == kPlacesPaired ? 1 : 0)) {
        const vec3 p = placeOf(c, m, i);
        const float scale = frame.focal / lensDepth(frameLensHere(), p.z);
        const vec2 s = vec2(p.x * scale + frame.centre.x, p.y * scale + frame.centre.y);
        const bool isIn = p.z >= frame.nearPlane && abs(s.x) < kGuardPixels && abs(s.y) < kGuardPixels;
        at[i] = p;
        snapped[i] = isIn ? ivec2(snapPixel(s.x), snapPixel(s.y)) : ivec2(0);
        clipped[i] = isIn ? 0u : 1u;
    }
    barrier();
    if (i >= c.counts >> 16) return;
    const uint word = Words(uvec2(c.trianglesLow, c.trianglesHigh)).words[i];
    const uint a = word & 255u, b = word >> 8 & 255u, d = word >> 16 & 255u;
    LargeTriangle t;
    t.id = block * kClusterTriangles + i;
    if ((clipped[a] | clipped[b] | clipped[d]) == 0u) {
        t.x0 = snapped[a].x;
        t.y0 = snapped[a].y;
        t.x1 = snapped[b].x;
        t.y1 = snapped[b].y;
        t.x2 = snapped[d].x;
        t.y2 = snapped[d].y;
        // Most triangles of a dense mesh contain no pixel's centre.
        if ((min(t.x0, min(t.x1, t.x2)) + 127) >> 8 > (max(t.x0, max(t.x1, t.x2)) - 128) >> 8) return;
        if ((min(t.y0, min(t.y1, t.y2)) + 127) >> 8 > (max(t.y0, max(t.y1, t.y2)) - 128) >> 8) return;
        t.inverseDepth0 = imageLinear(frameLensHere(), at[a].z);
        t.inverseDepth1 = imageLinear(frameLensHere(), at[b].z);
        t.inverseDepth2 = imageLinear(frameLensHere(), at[d].z);
        takeTriangle(t, c, vertices.vertices[a].surface, word);
        return;
    }
    vec3 polygon[9];
    vec3 other[9];
    polygon[0] = at[a];
    polygon[1] = at[b];
    polygon[2] = at[d];
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
    for (int k = 1; k + 1 < count; ++k) {
        const vec3 p = polygon[0], q = polygon[k], r = polygon[k + 1];
        t.x0 = snapPixel(p.x * (frame.focal / lensDepth(lens, p.z)) + frame.centre.x);
        t.y0 = snapPixel(p.y * (frame.focal / lensDepth(lens, p.z)) + frame.centre.y);
        t.x1 = snapPixel(q.x * (frame.focal / lensDepth(lens, q.z)) + frame.centre.x);
        t.y1 = snapPixel(q.y * (frame.focal / lensDepth(lens, q.z)) + frame.centre.y);
        t.x2 = snapPixel(r.x * (frame.focal / lensDepth(lens, r.z)) + frame.centre.x);
        t.y2 = snapPixel(r.y * (frame.focal / lensDepth(lens, r.z)) + frame.centre.y);
        t.inverseDepth0 = imageLinear(lens, p.z);
        t.inverseDepth1 = imageLinear(lens, q.z);
        t.inverseDepth2 = imageLinear(lens, r.z);
        takeTriangle(t, c, vertices.vertices[a].surface, word);
    }
}
