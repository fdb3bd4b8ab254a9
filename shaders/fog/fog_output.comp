// The picture of surfaces in fog that keep their colours.
#version 460
#extension GL_GOOGLE_include_directive : require
#define FOG
#include "../output/output.glsl"
