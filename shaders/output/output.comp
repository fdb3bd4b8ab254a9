// The picture of surfaces that keep their colours.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "output.glsl"
