// Discs in other shapes, depths and orders than mode splat has them.
#pragma once

#include "engine/reference/restate_discs.h"

namespace stipple::reference {

/// Squares of the discs' projected diameter that face the eye, at the depth of the centre.
void showSquares(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// Circles likewise: size, but no shape.
void showCircles(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// The discs' own shapes, at the depth of the centre.
void showFlatDepth(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// Mode splat with half the radii.
void showReduced(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// One pass over the discs from the farthest centre to the nearest: each over what is there, by its Gaussian.
void blendSorted(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// Mode ewa with fronts of discs that are moved away along the axis.
void blendMovedAway(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// Mode ewa with sums that count as they are.
void blendUnnormalised(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);

}  // namespace stipple::reference
