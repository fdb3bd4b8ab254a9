// The picture of surfaces that keep their colours, with tone.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TONE
#include "../output/output.glsl"
