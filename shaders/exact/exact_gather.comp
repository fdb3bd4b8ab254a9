// Per pixel the nearest of the discs of the texels about it, level by level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "exact.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (pixel.x >= int(frame.width) || pixel.y >= int(frame.height)) return;
    const uint place = uint(pixel.y) * frame.width + uint(pixel.x);
    uint64_t nearest = visibility[place];
    for (int level = 0; level < levelsHere(); ++level) {
        const LevelPlane at = levelPlane(level);
        if (texels[plane(at, 2u)] != 0u) continue;
        const ivec2 middle = pixel >> level;
        const ivec2 first = max(middle - kLevelTaps, ivec2(0));
        const ivec2 last = min(middle + kLevelTaps, ivec2(at.columns, at.rows) - 1);
        for (int y = first.y; y <= last.y; ++y)
            for (int x = first.x; x <= last.x; ++x) {
                const uint id = texels[plane(at, 1u) + uint(y * at.columns + x)];
                if (id == 0xffffffffu) continue;
                DrawNode node;
                PointRecord r;
                const WideDisc d = discOf(id, node, r);
                const float depth = depthAtPixel(d, pixel);
                if (depth < kNoDisc) nearest = min(nearest, visibilityKey(floatBitsToUint(depth), drawId(0u, id)));
            }
    }
    visibility[place] = nearest;
}
