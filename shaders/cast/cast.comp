// What a light meets first: depths, and what leaves let through.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../surface.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const SurfaceWords s = surfaceBuffer[at];
    const bool isMet = s.depth > 0.0;
    const bool isLeaf = isMet && (s.material & kPixelLeaf) != 0u;
    image[at] = isLeaf ? throughLeaf(vec3(unpackRed(s.albedo), unpackGreen(s.albedo), unpackBlue(s.albedo))) : 0u;
    extra[at] = isMet ? s.depth : 0.0;
}
