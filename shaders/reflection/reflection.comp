// Under lights that cast no shadows.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "reflection.glsl"
