// From linear light to what a screen is sent, before it is coded: exposure, and one filmic curve (Narkowicz 2015, a fit
// of the ACES reference curve): shadows stay, lights roll off into white.
#ifndef STIPPLE_SHARED_TONE_H
#define STIPPLE_SHARED_TONE_H
#include "types.h"
SHARED_BEGIN

struct ToneConstants {
    float exposure;  // factor
    uint isFilmic;   // else light above 1 is cut off
};

SHARED_FN float filmic(float x) {
    const float light = max(x, 0.0f);
    return min((light * (2.51f * light + 0.03f)) / (light * (2.43f * light + 0.59f) + 0.14f), 1.0f);
}
SHARED_FN float toned(ToneConstants t, float x) {
    const float light = t.exposure * x;
    return t.isFilmic != 0u ? filmic(light) : light;
}

SHARED_END
#endif
