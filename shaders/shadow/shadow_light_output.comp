// The picture of surfaces under lights that cast shadows.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define SHADOWED
#include "../output/output.glsl"
