// The lines of a scene's meshes as curves: ribbons where they have normals, else tubes.
#pragma once

#include "engine/scene/triangles.h"
#include "lod/primitives/curve_source.h"

namespace stipple::scene {

/// Lines of `placed`, in world space; segments that follow each other in the index list are one curve. Radii are those
/// of the attribute _RADIUS, or 0: not known. Not clean (see lod::cleanCurves).
lod::CurveSet flattenCurves(const Scene& scene, const std::vector<Placement>& placed);
/// The same, one placement a block. Reads `scene`, which must stay.
lod::CurveSource curveSource(const Scene& scene, const std::vector<Placement>& placed);

}  // namespace stipple::scene
