// Second surfaces of a row's pixels (mode ewa): lit on their own, then mixed with the first ones.
#pragma once

#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {

/// Fills `second` with the second surfaces of a row, and nothing where there are none. False: there are none at all.
/// `first`: of the same row.
bool takeSeconds(const RowPlace& at, const SurfaceRow& first, SurfaceRow& second);

/// Mixes what both send to the eye; where a second surface is the front, depth and normal are its own.
void mixSeconds(const RowPlace& at, const SurfaceRow& second, SurfaceRow& row);

}  // namespace stipple::cpu
