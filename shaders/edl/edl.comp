// Eye-dome lighting: colours of surfaces that keep theirs, by how deep their neighbours are.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../surface.glsl"
#include "../shared/edl.h"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

layout(set = 0, binding = kEdlBinding, scalar) uniform EdlBlock { EdlConstants edl; };

float depthBeside(ivec2 pixel) {
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= int(frame.width) || pixel.y >= int(frame.height)) return kEdlFar;
    return edlDepth(surfaceBuffer[uint(pixel.y) * frame.width + uint(pixel.x)].depth, edl.perDepth);
}

// How much nearer the eight neighbours of a scale are, together.
float nearer(float here, ivec2 at, int straight, int slanted) {
    float sum = 0.0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
            if (x != 0 || y != 0) sum += max(here - depthBeside(at + ivec2(x, y) * (x == 0 || y == 0 ? straight : slanted)), 0.0);
    return sum;
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    if (!(surfaceBuffer[at].depth > 0.0) || !edlConcerns(surfaceBuffer[at].material, frame.shade, edl.lit)) return;
    const float here = edlDepth(surfaceBuffer[at].depth, edl.perDepth);
    float sum = edl.weight0 * nearer(here, ivec2(pixel), edl.straight0, edl.slanted0);
    if (edl.scales > 1u) sum += edl.weight1 * nearer(here, ivec2(pixel), edl.straight1, edl.slanted1);
    if (edl.scales > 2u) sum += edl.weight2 * nearer(here, ivec2(pixel), edl.straight2, edl.slanted2);
    const float share = 1.0 - fade(edl.strength * sum);
    const uint colour = surfaceBuffer[at].albedo;
    surfaceBuffer[at].albedo = packColour(unpackRed(colour) * share, unpackGreen(colour) * share, unpackBlue(colour) * share);
}
