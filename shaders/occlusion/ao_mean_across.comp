// Along rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ao_mean.glsl"
