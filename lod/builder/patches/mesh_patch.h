// One segment of a mesh to one patch.
#pragma once

#include <functional>

#include "lod/builder/patches/height_grid.h"
#include "lod/builder/patches/mesh_surface.h"
#include "lod/builder/patches/patch_build.h"

namespace stipple::lod {

enum class PatchFit : uint8_t {
    good,
    folded,  ///< no height field, or farther from its source than allowed: to be split
    thin     ///< mostly beside its source: to be sampled more densely
};

struct MeshPatch {
    PatchFit fit = PatchFit::folded;
    Patch patch;
    // Sums for the root mean squares.
    double toSource = 0, toSourceWeight = 0, fromSource = 0, fromSourceWeight = 0;
};

/// `owner[t]`: the number of a triangle's segment; this is `self`. Samples lie where lines along the axis of the normal
/// cone meet the triangles, first the segment's, then what goes on beyond its border, else in the plane of the nearest
/// triangle, so that (but for PatchClosing::open and gaps) every cell that the segment touches is drawn.
/// A height field is what has, in each cell, no more spread than sqrt(2) step tan(theta) and `step` more (theta: half
/// the cone).
MeshPatch patchOfTriangles(const MeshSurface& surface, const Segment& segment, const std::vector<uint32_t>& owner,
                           uint32_t self, double step, PatchClosing closing);

/// Normals, colours, materials and map of a patch that patchOfTriangles made of the same, which has none of them yet.
/// (Most patches are tried and not kept.) Where it was stopped, what is there is of no use.
void dressPatch(const MeshSurface& surface, const Segment& segment, const std::vector<uint32_t>& owner, uint32_t self,
                double step, PatchClosing closing, const std::function<bool()>& isStopped, Patch& patch);

}  // namespace stipple::lod
