// One workgroup per block of a patch: one thread per triangle, or per disc, offers the pixels whose rays meet it, and
// keeps what is large for patch_splats_large.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../patch_splats.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint number = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (number >= stepInfo.count) return;
    PatchSplat s;
    if (!splatOf(number * kBlockLanes + gl_LocalInvocationID.x, s)) return;
    if (isEmptyBox(s.box)) return;
    if ((s.box.z - s.box.x + 1) * (s.box.w - s.box.y + 1) > kMostPixels) {
        uint place;
        TAKE_PLACE(largeCount, place);
        if (place < kLargeCapacity) {
            large[place].id = s.id;
            return;
        }
    }
    for (int y = s.box.y; y <= s.box.w; ++y)
        for (int x = s.box.x; x <= s.box.z; ++x) offerSplat(s, x, y);
}
