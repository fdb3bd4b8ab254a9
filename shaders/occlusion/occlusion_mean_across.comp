// Along rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#define ALONG_ROWS
#include "occlusion_mean.glsl"
