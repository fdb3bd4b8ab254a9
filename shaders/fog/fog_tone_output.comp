// The picture of surfaces in fog that keep their colours, with tone.
#version 460
#extension GL_GOOGLE_include_directive : require
#define FOG
#define TONE
#include "../output/output.glsl"
