// The picture of surfaces under light, in fog.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define FOG
#include "../output/output.glsl"
