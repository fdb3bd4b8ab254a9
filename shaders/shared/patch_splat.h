// Elevation patches as splats (Ochotta, Hiller & Saupe 2006, 3.3 and 3.5).
//
// Correct interpolation: each sample owns the cell to its upper right, and a ray meets the cell's two triangles.
// Corners are counted from the ray (Woop, Benthin & Wald 2013), so that neighbours have the same numbers at the edge
// that they share, with other signs: no ray passes between them. Depths are off by 2^-24 times the slope of the
// surface, or so.
//
// Direct interpolation, to compare with: a ray meets the disc of a sample; what is seen there is what the patch has
// below it, so that it jumps where discs meet.
#ifndef STIPPLE_SHARED_PATCH_SPLAT_H
#define STIPPLE_SHARED_PATCH_SPLAT_H
#include "patch.h"
SHARED_BEGIN

const float kNoPatch = 3.0e38f;  // in the place of a depth

// Depth at which a ray meets a triangle; kNoPatch: nowhere, or nearer than that. Products are rounded before they are
// subtracted: fused, they would have other digits on the other side of an edge.
SHARED_FN float patchTriangleDepth(PixelRay ray, vec3 a, vec3 b, vec3 c, float nearPlane) {
    SHARED_PRECISE const float ax = a.x - ray.ox - ray.ex * a.z;
    SHARED_PRECISE const float ay = a.y - ray.oy - ray.ey * a.z;
    SHARED_PRECISE const float bx = b.x - ray.ox - ray.ex * b.z;
    SHARED_PRECISE const float by = b.y - ray.oy - ray.ey * b.z;
    SHARED_PRECISE const float cx = c.x - ray.ox - ray.ex * c.z;
    SHARED_PRECISE const float cy = c.y - ray.oy - ray.ey * c.z;
    SHARED_PRECISE const float wa = bx * cy - by * cx;
    SHARED_PRECISE const float wb = cx * ay - cy * ax;
    SHARED_PRECISE const float wc = ax * by - ay * bx;
    const float sum = wa + wb + wc;
    const float least = min(wa, min(wb, wc));
    const float most = max(wa, max(wb, wc));
    // (One selection after the other: of conditions that are joined compilers make branches.)
    const float isIn = max(least, -most) >= 0.0f ? abs(sum) : 0.0f;
    const float depth = (wa * a.z + wb * b.z + wc * c.z) / (isIn > 0.0f ? sum : 1.0f);
    const float met = isIn > 0.0f ? depth : -3.0e38f;
    return met >= nearPlane ? met : kNoPatch;
}

// The disc of a sample.
struct PatchDisc {
    vec3 centre;  // camera space
    vec3 normal;
    float radius;
    float i;  // the sample within its block
    float j;
    uint
        cells;  // which of the four around it the block draws: lower left 1, lower right 2, upper left 4, upper right 8
};
// The cell of the block in that quarter around a sample (0: lower left, 3: upper right); kNoPatchCell: beside the
// block.
const uint kNoPatchCell = 128u;
SHARED_FN uint patchCellAround(uint s, uint quarter) {
    const uint i = s % kPatchStride + (quarter & 1u);
    const uint j = s / kPatchStride + (quarter >> 1);
    const bool isIn = i > 0u && j > 0u && i <= kPatchCellsAcross && j <= kPatchCellsUp;
    return isIn ? kPatchCellsAcross * (j - 1u) + i - 1u : kNoPatchCell;
}
SHARED_FN PatchDisc patchDisc(vec3 centre, vec3 normal, uint s, uint cells, DrawMesh m) {
    PatchDisc d;
    const float step = sqrt(dot(m.axisX, m.axisX));
    d.centre = centre;
    d.normal = vec3(m.normalX.x * normal.x + m.normalY.x * normal.y + m.normalZ.x * normal.z,
                    m.normalX.y * normal.x + m.normalY.y * normal.y + m.normalZ.y * normal.z,
                    m.normalX.z * normal.x + m.normalY.z * normal.y + m.normalZ.z * normal.z);
    d.radius = 0.70710678f * step / (0.1f + 0.9f * max(normal.z, 0.0f));
    d.i = float(int(s % kPatchStride));
    d.j = float(int(s / kPatchStride));
    d.cells = cells;
    return d;
}
// Where a ray meets a disc: (depth, i, j), the latter below it in the block; kNoPatch: beside it, or not above one of
// the four cells around its sample that the block draws. Sides are told by the offset alone, which the neighbouring
// block has with the same digits.
SHARED_FN vec3 patchDiscHit(PatchDisc d, DrawMesh m, PixelRay ray, float nearPlane) {
    const vec3 c = fromRay(ray, d.centre);
    const vec3 along = rayDirection(ray);
    const float facing = dot(d.normal, along);
    const float depth = dot(d.normal, c) / (abs(facing) > 0.0f ? facing : 1.0f);
    const vec3 off = vec3(depth * along.x - c.x, depth * along.y - c.y, depth - c.z);
    const float i = dot(off, m.axisX) / dot(m.axisX, m.axisX);
    const float j = dot(off, m.axisY) / dot(m.axisY, m.axisY);
    const uint lower = i < 0.0f ? 1u : 2u;
    const uint cell = j < 0.0f ? lower : 4u * lower;
    const bool isIn = abs(facing) > 0.0f && dot(off, off) <= d.radius * d.radius && depth >= nearPlane &&
                      abs(i) <= 1.0f && abs(j) <= 1.0f && (d.cells & cell) != 0u;
    return vec3(isIn ? depth : kNoPatch, d.i + i, d.j + j);
}

// Weights of the four samples around (i, j), of which `first` is the lower left: it, its right, upper and upper right
// neighbours.
struct PatchMix {
    uint first;
    float weight[4];
};
SHARED_FN PatchMix patchMix(vec3 hit) {
    const float i = min(max(floor(hit.y), 0.0f), float(kPatchCellsAcross) - 1.0f);
    const float j = min(max(floor(hit.z), 0.0f), float(kPatchCellsUp) - 1.0f);
    const float u = min(max(hit.y - i, 0.0f), 1.0f);
    const float v = min(max(hit.z - j, 0.0f), 1.0f);
    PatchMix m;
    m.first = uint(int(i)) + kPatchStride * uint(int(j));
    m.weight[0] = (1.0f - u) * (1.0f - v);
    m.weight[1] = u * (1.0f - v);
    m.weight[2] = (1.0f - u) * v;
    m.weight[3] = u * v;
    return m;
}

SHARED_END
#endif
