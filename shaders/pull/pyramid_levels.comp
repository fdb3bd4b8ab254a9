// Which levels are pulled and pushed: those whose texels are no larger than the largest splat. Others have no groups.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
layout(local_size_x = 2 * kPyramidLevels) in;

void main() {
    const uint i = gl_LocalInvocationID.x;
    const uint level = i % kPyramidLevels;
    uvec2 size = uvec2(frame.width, frame.height);
    for (uint l = 0u; l < level; ++l) size = (size + 1u) / 2u;
    const bool isOn = i < kPyramidLevels ? level < levelCount() : level + 1u < levelCount();
    levelGroups[i] = GroupCounts((size.x + kLevelTile - 1u) / kLevelTile, (size.y + kLevelTile - 1u) / kLevelTile, isOn ? 1u : 0u);
}
