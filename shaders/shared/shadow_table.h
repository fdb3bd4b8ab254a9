// What a shader is told of lights that cast shadows: their maps, and where on the device the maps' texels are.
#ifndef STIPPLE_SHARED_SHADOW_TABLE_H
#define STIPPLE_SHARED_SHADOW_TABLE_H
#include "shadow.h"
SHARED_BEGIN

// Device addresses, the low word first.
struct ShadowTexelsAt {
    uint depthsLow;
    uint depthsHigh;
    uint throughLow;  // 0 and 0: no leaf is met
    uint throughHigh;
};
struct ShadowTable {
    ShadowMap maps[kMostShadowMaps];  // of each light the finest first
    ShadowTexelsAt texels[kMostShadowMaps];
    uint lights[kMostShadowLights];  // number of the light of each slot
    uint count;                      // of maps
    uint slots;
};

SHARED_END
#endif
