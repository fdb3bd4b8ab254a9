// The picture of a layer of glass.
#version 460
#extension GL_GOOGLE_include_directive : require
#define REFRACTED
#include "../output/output.glsl"
