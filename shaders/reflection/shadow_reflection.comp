// Under lights that cast shadows.
#version 460
#extension GL_GOOGLE_include_directive : require
#define SHADOWED
#include "reflection.glsl"
