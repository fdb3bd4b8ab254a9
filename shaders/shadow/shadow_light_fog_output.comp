// The picture of surfaces under lights that cast shadows, in fog.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define SHADOWED
#define FOG
#include "../output/output.glsl"
