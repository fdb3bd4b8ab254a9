// For the tests: every field of every shared struct, in the order of its declaration, word by word.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "../shared/frame.h"
#include "../shared/record.h"
layout(local_size_x = 1) in;
layout(set = 0, binding = 0, scalar) readonly buffer In {
    FrameConstants frame;
    DrawNode node;
    DrawBlock block;
    PointRecord record;
};
layout(set = 0, binding = 1, scalar) writeonly buffer Out { uint words[]; };

uint at = 0u;
void put(uint v) { words[at++] = v; }
void put(float v) { put(floatBitsToUint(v)); }
void put(vec2 v) {
    put(v.x);
    put(v.y);
}
void put(vec3 v) {
    put(v.x);
    put(v.y);
    put(v.z);
}

void main() {
    put(frame.viewX);
    put(frame.viewY);
    put(frame.viewZ);
    put(frame.focal);
    put(frame.centre);
    put(frame.width);
    put(frame.height);
    put(frame.nearPlane);
    put(frame.supportScale);
    put(frame.minimumRadius);
    put(frame.shade);
    put(frame.debugView);
    put(frame.sunDirection);
    put(frame.skyDirection);
    put(frame.background);
    put(frame.blockCount);
    put(frame.lightCount);
    put(frame.ambient);
    put(frame.hasEnvironment);
    put(frame.exactStrands);
    put(frame.coverageSeed);
    put(frame.environmentX);
    put(frame.environmentY);
    put(frame.environmentZ);
    put(node.axisX);
    put(node.axisY);
    put(node.axisZ);
    put(node.base);
    put(node.edge);
    put(node.errorCode);
    put(node.octantMask);
    put(node.count);
    put(node.addressLow);
    put(node.addressHigh);
    put(node.level);
    put(node.errorPixels);
    put(block.node);
    put(block.first);
    put(record.positionXY);
    put(record.positionZRadiusError);
    put(record.normal);
    put(record.colour);
}
