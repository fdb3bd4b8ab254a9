// The picture of surfaces under light, with tone.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define TONE
#include "../output/output.glsl"
