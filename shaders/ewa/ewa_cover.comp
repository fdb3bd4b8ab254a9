// How far silhouettes cover their pixels: what has an opaque neighbour on all sides is covered wholly. Where fronts end
// before other surfaces.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
layout(set = 0, binding = kSecondGroupsBinding, scalar) buffer GroupBlock { GroupCounts groups[]; };
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

bool isOpen(ivec2 pixel) {
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= int(frame.width) || pixel.y >= int(frame.height)) return false;
    const uint at = uint(pixel.y) * frame.width + uint(pixel.x);
    const uint64_t key = visibility[at];
    return key == kNoKey || (isPointKey(key, frame.firstBlock) && (filtered[at].cover & kFilteredFront) == 0u);
}

bool isDeeper(ivec2 pixel, float limit) {
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= int(frame.width) || pixel.y >= int(frame.height)) return false;
    const uint64_t key = visibility[uint(pixel.y) * frame.width + uint(pixel.x)];
    return key != kNoKey && keyDepth(key) > limit;
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    uint kind = secondKind(at);
    bool isAtGap = false;
    bool isAtJump = false;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            const ivec2 beside = ivec2(pixel) + ivec2(x, y);
            isAtGap = isAtGap || isOpen(beside);
            isAtJump = isAtJump || (kind == kSecondBehind && isDeeper(beside, sums[at].nearest));
        }
    // A front that ends nowhere near hides what is behind it: kernels add up to less than 1 where samples are not regular.
    if (kind == kSecondBehind && !isAtGap && !isAtJump) kind = kSecondNone;
    const bool isBlended = isPointKey(visibility[at], frame.firstBlock);
    coverage[at] = kind << kSecondShift | (isBlended && isAtGap ? filtered[at].cover & 255u : 255u);
    if (kind == kSecondNone) return;
    if (!subgroupElect()) return;  // one of a subgroup says it
    for (uint shape = 0u; shape < kGroupShapes; ++shape) groups[shape].z = 1u;
}
