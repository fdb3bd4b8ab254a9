// The picture of surfaces under light.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIT
#include "output.glsl"
