// Rays against segments of curves, exactly: tubes as the hull of two balls, ribbons as bilinear patches.
#pragma once

#include <glm/glm.hpp>

#include "engine/reference/decode.h"

namespace stipple::reference {

/// A ray in the coordinates of a store; t is the same as in the world.
struct LocalRay {
    glm::dvec3 origin, direction;
};

struct CurveHit {
    double t = 0, place = 0;  ///< place: along the segment, 0 to 1
    glm::dvec3 normal{0};     ///< unit, towards the eye
};

/// The nearest hit with t > nearT. False if there is none.
bool meetsSegment(const Segment& s, const LocalRay& ray, double nearT, CurveHit& hit);

}  // namespace stipple::reference
