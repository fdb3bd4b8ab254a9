// The picture of surfaces under lights that cast shadows, in fog, with tone.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define SHADOWED
#define FOG
#define TONE
#include "../output/output.glsl"
