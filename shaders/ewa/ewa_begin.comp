// What the sums of each pixel begin with: nothing, and the depth that others are told against.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const FilteredFront front = fronts[at];
    FilteredSums s;
    s.weight = s.depth = s.red = s.green = s.blue = s.nx = s.ny = s.nz = s.rims = 0;
    s.nearest = -kNoDisc;
    s.behind = 0u;
    s.reference = uintBitsToFloat(front.nearest);
    s.unit = sumUnit(front);
    if (front.key != kNoKey) {
        DrawNode node;
        const uint id = keyPlace(front.key, 0u);
        const PointRecord r = recordOf(id, node);
        const WideDisc d = opaqueDisc(node, r, id);
        const float sigma = d.radius / kOpaqueSigmas;
        const EwaKernel k = ewaKernel(d, sigma, frame.kernelSupport, frame.lowPass, frameLensHere());
        const DepthRange range = depthRange(d, sigma, frame.kernelSupport, frame.lowPass, frameLensHere());
        s.reference = rayOnDisc(d, k, range, ivec2(pixel)).depth;
        // As far before the front as it ends behind it; leaves are no surface.
        if ((recordFlags(r) & kFlagLeaf) == 0u) s.nearest = s.reference - (keyDepth(front.key) - s.reference);
    }
    sums[at] = s;
    if (frame.hasMaterials != 0u) materialSums[at] = MaterialSums(0, 0, 0);
}
