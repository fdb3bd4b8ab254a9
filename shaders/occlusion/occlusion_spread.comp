// To all pixels, from those about them that are of their surface, into its material.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "occlusion.glsl"

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint place = pixel.y * frame.width + pixel.x;
    const SurfaceWords s = surfaceBuffer[place];
    if (!(s.depth > 0.0)) return;
    const Lens lens = frameLensHere();
    const int edge = int(occlusion.edge);
    const ivec2 first = ivec2(pixel) / edge;
    const vec2 off = vec2(ivec2(pixel) - first * edge), part = off / float(edge);
    const vec2 at = vec2(pixel) + 0.5 - frame.centre;
    const vec2 slope = aoSlope(lens, at.x, at.y, octDecode(s.normal));
    const float tolerance = aoTolerance(lens, s.depth, occlusion.radius);
    float sum = kAoOpenWeight * tolerance, weights = kAoOpenWeight * tolerance;
    for (int corner = 0; corner < 4; ++corner) {
        const ivec2 c = ivec2(corner & 1, corner >> 1);
        const float share = (c.x == 1 ? part.x : 1.0 - part.x) * (c.y == 1 ? part.y : 1.0 - part.y);
        if (!aoIsInside(first + c) || share == 0.0) continue;
        const vec2 to = vec2(c) * float(edge) - off;
        const float w = share * aoWeight(lens, s.depth, aoDepth(first + c), slope.x * to.x + slope.y * to.y, tolerance);
        sum += w * openness[aoEntry(first + c)];
        weights += w;
    }
    surfaceBuffer[place].material = aoMaterial(s.material, sum / weights);
}
