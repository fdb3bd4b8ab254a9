// What the sums of second surfaces begin with. A front that ends before another kind, with no disc between them, is itself
// the second surface there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel_disc.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    uint kind = secondKind(at);
    if (kind == kSecondNone) return;
    const FilteredFront front = fronts[at];
    float reference = uintBitsToFloat(front.nearest);
    if (kind == kSecondBehind) {
        if (front.key != kNoKey && isPointKey(front.key, frame.firstBlock)) {
            DrawNode node;
            const uint id = keyPlace(front.key, 0u);
            const PointRecord r = recordOf(id, node);
            const KernelDisc p = kernelDisc(opaqueDisc(node, r, id), node, r);
            reference = rayOnDisc(p.disc, p.kernel, p.range, ivec2(pixel)).depth;
        } else {
            kind = front.key != kNoKey ? kSecondFront : kSecondNone;
        }
        coverage[at] = kind << kSecondShift | (coverage[at] & 255u);
    } else {
        fronts[at].first = ~0u;
    }
    FilteredSums s = sums[at];
    s.weight = s.depth = s.red = s.green = s.blue = s.nx = s.ny = s.nz = 0;
    s.reference = reference;
    sums[at] = s;
    if (frame.hasMaterials != 0u) materialSums[at] = MaterialSums(0, 0, 0);
}
