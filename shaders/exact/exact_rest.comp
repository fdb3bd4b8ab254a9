// Discs that no texel holds, as a nearer one has theirs or none is large enough: into every pixel that they cover. Those
// of many pixels go to the list, whose rows are shared out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "exact.glsl"
layout(local_size_x = 256) in;

const int kMostPixels = 1024;

void offer(ivec2 pixel, WideDisc d) {
    const float depth = depthAtPixel(d, pixel);
    if (depth < kNoDisc) offerKey(uint(pixel.y) * frame.width + uint(pixel.x), visibilityKey(floatBitsToUint(depth), drawId(0u, d.id)));
}

void main() {
    WideDisc d;
    LevelPlane at;
    uint texel;
    if (!discHere(d)) return;
    if (texelOf(d, at, texel) && texels[plane(at, 1u) + texel] == d.id) return;
    const CentrePixel c = ownPixel(d, standsAlone(d.id), frame);
    if (c.x >= 0) offer(ivec2(c.x, c.y), d);
    const DiscBox box = discBox(d, frame);
    const int width = box.x.last - box.x.first + 1;
    const int height = box.y.last - box.y.first + 1;
    if (width <= 0 || height <= 0) return;
    if (width * height > kMostPixels) {
        uint place;
        TAKE_PLACE(discCount, place);
        if (place < kDiscCapacity) {
            discs[place] = d;
            return;
        }
    }
    for (int y = box.y.first; y <= box.y.last; ++y)
        for (int x = box.x.first; x <= box.x.last; ++x) offer(ivec2(x, y), d);
}
