// For measurements and their test: a tile of ground into a chunk, a record a thread; or some of a chunk to where the host
// looks.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#include "../shared/ground.h"
layout(local_size_x = kGroundThreads) in;

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Records { PointRecord records[]; };
layout(push_constant, scalar) uniform StepBlock { GroundStep ground; };

void main() {
    const uint i = gl_GlobalInvocationID.x;
    if (i >= ground.count) return;
    Records chunk = Records(uvec2(ground.addressLow, ground.addressHigh));
    if (ground.toLow == 0u && ground.toHigh == 0u)
        chunk.records[i] = groundRecord(ground.tile, i, ground.radiusCode);
    else
        Records(uvec2(ground.toLow, ground.toHigh)).records[i] = chunk.records[groundSampled(ground, i)];
}
