// Shading of one pixel: unlit, or one sun and a sky gradient. Linear light, exposure 1, no tone curve.
#ifndef STIPPLE_SHARED_SHADE_H
#define STIPPLE_SHARED_SHADE_H
#include "frame.h"
#include "splat.h"
SHARED_BEGIN

// Light that a white surface with the eye-facing normal n sends to the eye.
SHARED_FN float irradiance(vec3 n, vec3 sunDirection, vec3 skyDirection) {
    return 0.75f * max(dot(n, sunDirection), 0.0f) + 0.25f + 0.15f * dot(n, skyDirection);
}

// Colours of the debug views, linear.
SHARED_FN vec3 debugRamp(float t) {
    const float x = min(max(t, 0.0f), 1.0f);
    return vec3(min(max(1.5f - abs(4.0f * x - 3.0f), 0.0f), 1.0f), min(max(1.5f - abs(4.0f * x - 2.0f), 0.0f), 1.0f),
                min(max(1.5f - abs(4.0f * x - 1.0f), 0.0f), 1.0f));
}
// Screen-space error: 1/8 px blue, 1 px green to yellow, 8 px red.
SHARED_FN vec3 debugErrorColour(float errorPixels) {
    return debugRamp((log2(max(errorPixels, 1.0e-6f)) + 3.0f) / 6.0f);
}
SHARED_FN vec3 debugLevelColour(uint level) { return debugRamp(float(level % 8u) / 7.0f); }

// Where a pixel's colour comes from: grey its own point, blue a nearer surface that replaced its point, orange filled.
SHARED_FN vec3 debugHoleColour(float ownDepth, float depth) {
    const bool own = ownDepth > 0.0f;
    const bool replaced = own && depth != ownDepth;
    return own ? (replaced ? vec3(0.02f, 0.1f, 0.9f) : vec3(0.2f, 0.2f, 0.2f)) : vec3(1.0f, 0.3f, 0.02f);
}

SHARED_END
#endif
