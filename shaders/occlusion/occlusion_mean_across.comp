// Along rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "occlusion_mean.glsl"
