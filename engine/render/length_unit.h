// Scenes whose lengths are so short or long that products of them are no floats (atoms in metres, galaxies) are drawn
// in another unit of length. The backends, fp64 among them, see a scene of ordinary size; what they hand back is
// converted.
#pragma once

#include <span>
#include <vector>

#include "engine/render/frame.h"

namespace stipple::render {

/// How many of the new units a world unit is: a power of two, so that nothing is rounded. 1 where what is drawn reaches
/// between 2^-20 and 2^40 world units (then nothing is to be converted); else that reach becomes 1 to 2 units.
double unitsOfLength(const lod::Cut& cut, std::span<const lod::Hierarchy* const> hierarchies,
                     std::span<const lod::Instance> instances, const lod::View& view);

lod::View inUnits(lod::View view, double units);
void inUnits(std::span<const lod::Instance> instances, double units, std::vector<lod::Instance>& out);
/// Lights and fog are as bright and as dense as they were. (Gusts of wind are those of plants of the new size.)
DrawSettings inUnits(DrawSettings settings, double units);
/// Depths of a picture that was drawn in such units, in world units again.
void inWorldUnits(std::span<float> depths, double units);

}  // namespace stipple::render
