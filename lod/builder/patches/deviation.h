// How far a patch and its part of a mesh lie from each other, both ways, as bounds.
//
// Over the cells that lie inside of the segment and what goes on beyond it, patch and source are two surfaces of planar
// pieces over one plane: the difference of their heights is largest at a corner of the overlay of both, and no distance
// is larger than it. What a patch has beyond its segment is divided until a bound is near the distance: a triangle is
// no farther from the source than its centre is, and the way from there to its corners more; nor than its corners are
// from one source triangle.
#pragma once

#include <functional>

#include "lod/builder/patches/height_grid.h"
#include "lod/builder/patches/mesh_surface.h"

namespace stipple::lod {

struct OwnSurface {
    const MeshSurface& surface;
    const Segment& segment;
    const std::vector<uint32_t>& owner;
    uint32_t self;
    const std::vector<uint32_t>& beyond;  ///< triangles of others, that the patch goes on over
};

struct Deviation {
    double toSource = 0, fromSource = 0;  ///< bounds, scene units
    double overOwn = 0;                   ///< of `fromSource`, over cells that are drawn
    double toSourceSquares = 0, toSourceWeight = 0, fromSourceSquares = 0, fromSourceWeight = 0;
};

/// No place of a triangle is farther from the surface than that; not less than `atLeast`. `hint`: a triangle near by.
double boundToSource(const MeshSurface& surface, const std::array<glm::dvec3, 3>& triangle, size_t hint,
                     double atLeast);

/// Where an edge from a to b (samples) meets the lines of a grid of so many samples: parts of the way, ascending, with
/// its ends; no more than lines and two, however far the edge goes on beside the grid.
void linesAlong(const glm::dvec2& a, const glm::dvec2& b, uint32_t width, uint32_t height, std::vector<double>& at);

/// What is known of the patch's cells and samples.
struct OverPatch {
    std::function<bool(uint32_t i, uint32_t j)> isInside;
    std::function<uint32_t(size_t sample)> triangle;  ///< one near by
    double apart = 0;     ///< most between the segment's triangles over one sample, scene units
    bool isOpen = false;  ///< cells that the segment's triangles touch may be left out
};
Deviation deviationOf(const OwnSurface& own, const Patch& patch, const OverPatch& over);

}  // namespace stipple::lod
