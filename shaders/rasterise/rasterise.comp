// One workgroup per cluster: its vertices are projected once, then one thread per triangle fills what is small and keeps
// what is large for rasterise_large.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../coverage.glsl"
layout(local_size_x = 256) in;

shared vec3 at[256];
shared ivec2 snapped[256];
shared uint clipped[256];

void takeTriangle(LargeTriangle t, DrawCluster c, uint surface, uint corners) {
    if (!orient(t, (surface & kSurfaceTwoSided) != 0u)) return;
    const ivec4 box = boxOf(t);
    const bool isMasked = (surface & kSurfaceMasked) != 0u;
    if (isEmptyBox(box) || (!isMasked && isKeptAsLarge(t, box))) return;
    for (int y = box.y; y <= box.w; ++y)
        for (int x = box.x; x <= box.z; ++x) {
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
        at[i] = p;
        clipped[i] = snapCorner(p, snapped[i]) ? 0u : 1u;
    }
    barrier();
    if (i >= c.counts >> 16) return;
    const uint word = Words(uvec2(c.trianglesLow, c.trianglesHigh)).words[i];
    const uint a = word & 255u, b = word >> 8 & 255u, d = word >> 16 & 255u;
    const uint id = block * kClusterTriangles + i;
    const uint surface = vertices.vertices[a].surface;
    if ((clipped[a] | clipped[b] | clipped[d]) == 0u) {
        if (isBetweenCentres(snapped[a], snapped[b], snapped[d])) return;
        takeTriangle(triangleOf(snapped[a], snapped[b], snapped[d], vec3(at[a].z, at[b].z, at[d].z), id), c, surface, word);
        return;
    }
    vec3 polygon[9];
    const int count = clipped3(at[a], at[b], at[d], polygon);
    for (int k = 1; k + 1 < count; ++k)
        takeTriangle(triangleOf(snappedPlace(polygon[0]), snappedPlace(polygon[k]), snappedPlace(polygon[k + 1]),
                                vec3(polygon[0].z, polygon[k].z, polygon[k + 1].z), id),
                     c, surface, word);
}
