// The picture of surfaces under light, in fog, with tone.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#define FOG
#define TONE
#include "../output/output.glsl"
