// How far silhouettes cover their pixels: what has an opaque neighbour on all sides is covered wholly.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
layout(local_size_x = 64) in;

bool isOpen(ivec2 pixel) {
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= int(frame.width) || pixel.y >= int(frame.height)) return false;
    const uint at = uint(pixel.y) * frame.width + uint(pixel.x);
    const uint64_t key = visibility[at];
    return key == kNoKey || (isPointKey(key, frame.firstBlock) && (filtered[at].cover & kFilteredFront) == 0u);
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    bool isAtGap = false;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) isAtGap = isAtGap || isOpen(ivec2(pixel) + ivec2(x, y));
    const bool isBlended = isPointKey(visibility[at], frame.firstBlock);
    coverage[at] = isBlended && isAtGap ? filtered[at].cover & 255u : 255u;
}
