// The last push, into level 0, and the shading of its result.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
layout(local_size_x = 64) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const Texel own = loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, int(pixel.x), int(pixel.y));
    Texel t = own;
    if (stepInfo.hasPyramid != 0u) t = pushedTexel(ivec2(pixel), own);
    t = finished(t);
    vec3 colour = frame.background;
    vec3 n = vec3(0.0);
    const bool valid = t.depth > 0.0;
    if (valid) {
        n = normalAt(t, pixel);
        colour = t.colour;
        if (frame.debugView == kDebugHoles) colour = debugHoleColour(finished(own).depth, t.depth);
        else if (frame.debugView == kDebugNormals) colour = vec3(0.5 + 0.5 * n.x, 0.5 - 0.5 * n.y, 0.5 - 0.5 * n.z);
        else if (frame.debugView == kDebugNone && (frame.shade & kShadeLit) != 0u) colour *= irradiance(n, frame.sunDirection, frame.skyDirection, letsLightThrough(t.thickness, t.radius, t.isRound, t.axis.x));
    }
    const uint at = pixel.y * frame.width + pixel.x;
    const vec3 c = clamp(colour, 0.0, 1.0);
    const uvec3 bytes = uvec3(vec3(srgbFromLinear(c.x), srgbFromLinear(c.y), srgbFromLinear(c.z)) * 255.0 + 0.5);
    image[at] = bytes.x | bytes.y << 8 | bytes.z << 16 | (valid ? 0xff000000u : 0u);
    if (stepInfo.wantExtra == 0u) return;
    const vec3 world = frame.viewX * n.x + frame.viewY * n.y + frame.viewZ * n.z;
    extra[7u * at] = valid ? depthAt(t, pixel) : t.depth;
    extra[7u * at + 1u] = world.x;
    extra[7u * at + 2u] = world.y;
    extra[7u * at + 3u] = world.z;
    extra[7u * at + 4u] = colour.x;
    extra[7u * at + 5u] = colour.y;
    extra[7u * at + 6u] = colour.z;
}
