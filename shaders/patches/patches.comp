// One workgroup per block of a patch: its samples are projected once, then one thread per triangle fills what is small
// and keeps what is large for rasterise_large.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../patch.glsl"
layout(local_size_x = 256) in;

shared vec3 at[kPatchSamples];
shared ivec2 snapped[kPatchSamples];
shared uint clipped[kPatchSamples];

void takeTriangle(LargeTriangle t) {
    if (!orient(t, true)) return;
    const ivec4 box = boxOf(t);
    if (isEmptyBox(box) || isKeptAsLarge(t, box)) return;
    for (int y = box.y; y <= box.w; ++y)
        for (int x = box.x; x <= box.z; ++x) {
            float inverseDepth;
            if (isCovered(t, x, y, inverseDepth)) offer(x, y, inverseDepth, drawId(frame.firstBlock.of[kKindPatches], t.id));
        }
}

void main() {
    const uint number = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (number >= stepInfo.count) return;
    const DrawBlock source = blocks[frame.firstBlock.of[kKindPatches] + number];
    const DrawNode node = nodes[source.node];
    PatchBlocks of = patchBlocksOf(node);
    const uint lane = gl_LocalInvocationID.x;
    if (lane < kPatchSamples) {
        const vec3 p = patchPlace(of, source.first, meshes[node.weights + of.blocks[source.first].number], lane);
        at[lane] = p;
        clipped[lane] = snapCorner(p, snapped[lane]) ? 0u : 1u;
    }
    barrier();
    if (!patchHasCell(of, source.first, lane / 2u)) return;
    const uint corners = patchCorners(of, source.first, lane);
    const uint a = corners & 255u, b = corners >> 8 & 255u, c = corners >> 16;
    const uint id = number * kBlockLanes + lane;
    if ((clipped[a] | clipped[b] | clipped[c]) == 0u) {
        if (isBetweenCentres(snapped[a], snapped[b], snapped[c])) return;
        takeTriangle(triangleOf(snapped[a], snapped[b], snapped[c], vec3(at[a].z, at[b].z, at[c].z), id));
        return;
    }
    vec3 polygon[9];
    const int count = clipped3(at[a], at[b], at[c], polygon);
    for (int k = 1; k + 1 < count; ++k)
        takeTriangle(triangleOf(snappedPlace(polygon[0]), snappedPlace(polygon[k]), snappedPlace(polygon[k + 1]),
                                vec3(polygon[0].z, polygon[k].z, polygon[k + 1].z), id));
}
