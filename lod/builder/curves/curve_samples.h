// Curves as few points, for views from so far that no curve is seen alone (Cook et al. 2007: what is thinner than the
// error may be a matter of chance, as long as area and mean colour stay).
#pragma once

#include "lod/primitives/curves.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

struct CurveSamples {
    PointBlock points;  ///< position, normal, colour
    double radius = 0;  ///< of all of them: what a sample stands for is about that far from it
};

/// `count` discs, seen from both sides: one at a random place in each of `count` runs of curves of equal area. Their
/// areas add up to what the curves show: a ribbon's own area, and of a tube half its surface (a disc that turns with a
/// tube's surface shows 2/pi of its area on average, a tube its whole width).
/// They come in an order in which any beginning is spread over all runs; the first n, sqrt(count / n) times as large,
/// stand for all. Each has the mean colour of what it stands for where it comes last. Where each disc lies is chance;
/// the same input gives the same discs. `curves` are clean.
CurveSamples sampleCurves(const CurveSet& curves, uint64_t count);

/// The same samples by where they are, in cubes of at most about `most`: what is near is to be shown finer than what is
/// far, within one plant too. The order stays.
std::vector<CurveSamples> splitSamples(const CurveSamples& samples, uint32_t most);

}  // namespace stipple::lod
