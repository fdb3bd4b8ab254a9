// Points as patches are made of them: in Morton order, each once, with the surface that its neighbours say.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "lod/builder/patches/elements.h"
#include "lod/builder/patches/near_points.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

struct PointSurface {
    glm::dvec3 middle{0};            ///< of the source's box: what all places are relative to
    SurfaceElements elements;        ///< points; links only between those of a surface
    std::vector<uint32_t> colour;    ///< sRGB; empty: none
    std::vector<glm::vec3> given;    ///< normals of the source, or empty
    std::vector<float> spacing;      ///< scene units: squared, the area of a point
    std::vector<float> noise;        ///< scene units: how thick the neighbourhood is (standard deviation)
    std::vector<uint8_t> isSurface;  ///< its neighbours lie on one, and not along a line or all around
    NearPoints near;
    uint64_t points = 0;                      ///< of the source
    std::map<std::string, uint64_t> dropped;  ///< by reason
    size_t size() const { return elements.size(); }
};

/// Points that are not finite or at the place of another are dropped and counted. Normals: of the plane of the sixteen
/// nearest (Hoppe et al. 1992), on the side of the source's own, else on one side from neighbour to neighbour, upwards
/// (+z) at the highest point of what hangs together. Of no use where it was stopped.
PointSurface pointSurface(PointBlock points, const std::function<bool()>& isStopped, Executor& executor,
                          Progress& progress);

/// Turns normals so that neighbours agree: from the highest point of each component, over the links with the most
/// parallel normals first.
void agreeOnSides(SurfaceElements& elements);

}  // namespace stipple::lod
