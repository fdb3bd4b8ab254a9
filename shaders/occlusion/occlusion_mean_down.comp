// Along columns, of what is the mean along rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#define DOWN
#include "occlusion_mean.glsl"
