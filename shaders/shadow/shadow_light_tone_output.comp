// The picture of surfaces under lights that cast shadows, with tone.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define SHADOWED
#define TONE
#include "../output/output.glsl"
