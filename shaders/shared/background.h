// The environment's picture behind everything: what a pixel's ray meets that meets nothing else. The picture
// (equirectangular, y up, -z in its middle) is kept at every power of two of its size, the nearer to a pole the more
// texels a row's are means of, so that all of a level are about as wide as they are high; a pixel sees it bilinearly on
// the two levels whose texels are next to its own angle. Built by engine/render/backdrop.cpp.
#ifndef STIPPLE_SHARED_BACKGROUND_H
#define STIPPLE_SHARED_BACKGROUND_H
#include "fade.h"
#include "tone.h"
SHARED_BEGIN

const uint kBackdropLevels = 16u;  // at most

struct BackgroundConstants {
    vec3 axisX;  // rows of the rotation from camera space to the picture's
    vec3 axisY;
    vec3 axisZ;
    float scale;  // factor of its light
    float level;  // log2 of the angle of a pixel in the middle of the view, in texels of level 0; no number below -100
    uint width;   // of level 0
    uint height;
    uint levels;
    uint first[16];  // texel of each level
    ToneConstants tone;
};

// A texel: three parts of nine bits and their common exponent.
SHARED_FN vec3 backdropLight(uint texel) {
    const float unit = uintBitsToFloat(((texel >> 27) + 103u) << 23);
    return vec3(float(int(texel & 511u)) * unit, float(int(texel >> 9 & 511u)) * unit,
                float(int(texel >> 18 & 511u)) * unit);
}

// atan(t) of 0 <= t <= 1 in turns, to 2e-8 (Chebyshev's interpolation of atan(sqrt(s)) / sqrt(s)).
SHARED_FN float turnsOfSlope(float t) {
    const float s = t * t;
    return t * (0.159154937f +
                s * (-0.0530512221f +
                     s * (0.0318190269f +
                          s * (-0.0226040930f +
                               s * (0.0169289205f +
                                    s * (-0.0119293723f +
                                         s * (0.00677802833f + s * (-0.00254727970f + s * 0.000451055355f))))))));
}
// The angle of (x, y) from the x axis in turns, -1/2 to 1/2.
SHARED_FN float turnsOf(float y, float x) {
    const float ax = abs(x);
    const float ay = abs(y);
    const float part = turnsOfSlope(min(ax, ay) / max(max(ax, ay), 1.0e-30f));
    const float first = ay > ax ? 0.25f - part : part;
    const float half_ = x < 0.0f ? 0.5f - first : first;
    return y < 0.0f ? -half_ : half_;
}
// Where a direction (of the picture, any length) is seen: shares of its width and height.
SHARED_FN vec2 backdropPlace(vec3 d) {
    return vec2(0.5f + turnsOf(d.x, -d.z), 0.5f - 2.0f * turnsOf(d.y, sqrt(d.x * d.x + d.z * d.z)));
}
SHARED_FN vec3 backdropDirection(BackgroundConstants b, vec3 d) {
    return vec3(dot(b.axisX, d), dot(b.axisY, d), dot(b.axisZ, d));
}
// The level for the pixel whose ray has that squared length (1 in the middle; by the root of its solid angle).
SHARED_FN float backdropLevel(BackgroundConstants b, float length2) {
    return min(max(b.level - 0.75f * log2Of(length2), 0.0f), float(int(b.levels)) - 1.0f);
}

// Four texels, and how far the place lies between them.
struct BackdropTaps {
    uint at00;
    uint at10;
    uint at01;
    uint at11;
    float x;
    float y;
};
// Rows are closed, columns are not. `size`: of the level.
SHARED_FN BackdropTaps backdropTaps(uint first, uint width, uint height, vec2 place) {
    const float x = place.x * float(int(width)) - 0.5f;
    const float y = min(max(place.y * float(int(height)) - 0.5f, 0.0f), float(int(height)) - 1.0f);
    const float left = floor(x);
    const int column = int(left);
    const uint x0 = uint(column < 0 ? column + int(width) : column < int(width) ? column : column - int(width));
    const uint x1 = x0 + 1u < width ? x0 + 1u : 0u;
    const uint y0 = uint(int(y));
    const uint y1 = y0 + 1u < height ? y0 + 1u : y0;
    BackdropTaps t;
    t.at00 = first + y0 * width + x0;
    t.at10 = first + y0 * width + x1;
    t.at01 = first + y1 * width + x0;
    t.at11 = first + y1 * width + x1;
    t.x = x - left;
    t.y = y - float(int(y0));
    return t;
}
SHARED_FN uint backdropSize(uint size, uint level) { return size >> level > 0u ? size >> level : 1u; }
SHARED_FN float mixFour(float a, float b, float c, float d, float x, float y) {
    const float above = a + x * (b - a);
    const float below = c + x * (d - c);
    return above + y * (below - above);
}
SHARED_FN vec3 mixTaps(BackdropTaps t, vec3 a, vec3 b, vec3 c, vec3 d) {
    return vec3(mixFour(a.x, b.x, c.x, d.x, t.x, t.y), mixFour(a.y, b.y, c.y, d.y, t.x, t.y),
                mixFour(a.z, b.z, c.z, d.z, t.x, t.y));
}
// From the light of two levels to what is shown.
SHARED_FN vec3 backdropShown(BackgroundConstants b, vec3 fine, vec3 coarse, float between) {
    return vec3(toned(b.tone, b.scale * (fine.x + between * (coarse.x - fine.x))),
                toned(b.tone, b.scale * (fine.y + between * (coarse.y - fine.y))),
                toned(b.tone, b.scale * (fine.z + between * (coarse.z - fine.z))));
}

SHARED_END
#endif
