// Elevation patches as splats: triangles of cells, or discs of samples, and the pixels whose rays may meet them.
#include "patch.glsl"
#include "shared/patch_splat.h"

struct PatchSplat {
    uint id;    // 256 * block + lane
    ivec4 box;  // first x, first y, last x, last y
    vec3 a;     // corners of a triangle
    vec3 b;
    vec3 c;
    PatchDisc disc;
    DrawMesh mesh;
};

// Bits of the cells around a sample that are drawn (PatchDisc::cells).
uint cellsAround(PatchBlocks of, uint block, uint s) {
    uint bits = 0u;
    for (uint quarter = 0u; quarter < 4u; ++quarter) {
        const uint cell = patchCellAround(s, quarter);
        if (cell != kNoPatchCell && patchHasCell(of, block, cell)) bits |= 1u << quarter;
    }
    return bits;
}
PatchDisc discOf(PatchBlocks of, uint block, DrawMesh m, uint s, uint cells) {
    return patchDisc(patchPlace(of, block, m, s), octDecode(of.blocks[block].normals[s]), s, cells, m);
}

ivec4 wholePicture() { return ivec4(0, 0, int(frame.width) - 1, int(frame.height) - 1); }
ivec4 withinPicture(ivec4 box) { return ivec4(max(box.xy, ivec2(0)), min(box.zw, wholePicture().zw)); }

// Which sides is a place beyond? Before the near plane, or beside the picture.
uint sidesOf(vec3 p) {
    const float w = lensDepth(frameLensHere(), p.z);
    const vec2 at = p.xy * frame.focal, low = -(frame.centre + 1.0) * w, high = (vec2(frame.width, frame.height) + 1.0 - frame.centre) * w;
    return (p.z < frame.nearPlane ? 1u : 0u) | (at.x < low.x ? 2u : 0u) | (at.x > high.x ? 4u : 0u) | (at.y < low.y ? 8u : 0u) |
           (at.y > high.y ? 16u : 0u);
}

ivec4 boxOfCorners(vec3 a, vec3 b, vec3 c) {
    ivec2 p, q, r;
    const bool isIn = snapCorner(a, p) && snapCorner(b, q) && snapCorner(c, r);
    if (!isIn) return (sidesOf(a) & sidesOf(b) & sidesOf(c)) != 0u ? ivec4(0, 0, -1, -1) : wholePicture();
    const int margin = 4;  // 1/64 px: corners are rounded
    const ivec2 least = min(p, min(q, r)) - margin, most = max(p, max(q, r)) + margin;
    return withinPicture(ivec4((least + 127) >> 8, (most - 128) >> 8));
}

ivec4 boxOfDisc(PatchDisc d) {
    const Lens lens = frameLensHere();
    const float nearest = lensDepth(lens, d.centre.z - d.radius), z = lensDepth(lens, d.centre.z);
    if (d.centre.z + d.radius < frame.nearPlane) return ivec4(0, 0, -1, -1);
    if (!lens.isOrthographic && !(nearest > frame.nearPlane)) return wholePicture();
    const vec2 at = d.centre.xy / z;
    const float reach = 1.001 * d.radius / nearest + 1.0 / frame.focal;
    const vec2 more = lens.isOrthographic ? vec2(reach) : reach * (1.0 + abs(at));
    const vec2 size = vec2(frame.width, frame.height);
    return ivec4(ivec2(clamp((at - more) * frame.focal + frame.centre, vec2(0.0), size)),
                 ivec2(clamp((at + more) * frame.focal + frame.centre, vec2(-1.0), size - 1.0)));
}

// The splat of an id; false: there is none.
bool splatOf(uint id, out PatchSplat s) {
    const DrawBlock source = blocks[frame.firstBlock.of[kKindPatches] + id / kBlockLanes];
    const DrawNode node = nodes[source.node];
    PatchBlocks of = patchBlocksOf(node);
    const uint lane = id % kBlockLanes;
    s.id = id;
    s.mesh = meshes[node.weights + of.blocks[source.first].number];
    if (frame.patchAs == kPatchDirect) {
        if (lane >= kPatchSamples) return false;
        const uint cells = cellsAround(of, source.first, lane);
        if (cells == 0u) return false;
        s.disc = discOf(of, source.first, s.mesh, lane, cells);
        s.box = boxOfDisc(s.disc);
        return true;
    }
    if (!patchHasCell(of, source.first, lane / 2u)) return false;
    const uint corners = patchCorners(of, source.first, lane);
    s.a = patchPlace(of, source.first, s.mesh, corners & 255u);
    s.b = patchPlace(of, source.first, s.mesh, corners >> 8 & 255u);
    s.c = patchPlace(of, source.first, s.mesh, corners >> 16);
    s.box = boxOfCorners(s.a, s.b, s.c);
    return true;
}

void offerSplat(PatchSplat s, int x, int y) {
    const PixelRay ray = pixelRayHere(uvec2(x, y));
    float depth;
    if (frame.patchAs == kPatchDirect)
        depth = patchDiscHit(s.disc, s.mesh, ray, frame.nearPlane).x;
    else
        depth = patchTriangleDepth(ray, s.a, s.b, s.c, frame.nearPlane);
    if (depth >= kNoPatch) return;
    offerKey(uint(y) * frame.width + uint(x),
             visibilityKey(floatBitsToUint(depth), drawId(frame.firstBlock.of[kKindPatches], s.id)));
}
