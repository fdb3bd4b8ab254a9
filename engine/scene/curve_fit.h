// Polygon plants as ribbons and tubes: each connected part of a mesh (a leaf, a blade, a branch) is fitted by one
// curve, if it looks like one.
#pragma once

#include "engine/base/executor.h"
#include "engine/scene/surfels.h"
#include "lod/primitives/curves.h"

namespace stipple::scene {

struct CurveFitSettings {
    /// A part is replaced where the curve is no farther from it than this share of its own width (of ribbons:
    /// half-width).
    double tolerance = 0.35;
    int joints = 12;  ///< of a curve at most
};

struct CurveFit {
    lod::CurveSet curves;  ///< of all visible meshes, instances included, world space
    Scene rest;            ///< the same scene with the triangles that are left
    uint64_t trianglesIn = 0, trianglesLeft = 0, ribbons = 0, tubes = 0;
    // Distance from the replaced surface to its curve, world units, weighted by area.
    double meanDeviation = 0, p95Deviation = 0, largestDeviation = 0;
};

/// A ribbon where the part is open and flat across, a tube where its surface lies round an axis; everything else stays.
/// Colours are means over each part: vertex colours, materials, textures (`images` are those of the scene, decoded).
/// Where a material's alpha cuts much away (pictures of twigs on cards) the triangles stay. Instanced meshes are fitted
/// once a place.
CurveFit fitCurves(const Scene& scene, const std::vector<DecodedImage>& images, const CurveFitSettings& settings,
                   Executor& executor);

}  // namespace stipple::scene
