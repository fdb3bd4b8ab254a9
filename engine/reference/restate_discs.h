// Points of the cut as discs in camera space, and those of them that are drawn as such: wide ones, and all in mode
// splat.
#pragma once

#include <optional>
#include <vector>

#include "engine/reference/decode.h"
#include "engine/reference/restate.h"
#include "lod/primitives/point_material.h"

namespace stipple::reference {

/// A point that is to be drawn: fine enough, and seen from its front.
struct PlacedDisc {
    glm::dvec3 centre, normal;  ///< camera space; of no normal, towards the eye
    double radius;              ///< world units, as stored
    glm::dvec3 colour;
    uint32_t flags;
    double spacing;  ///< of its node, world units; 0: not known
    double weight;   ///< of the surfel; 0: it has none
    bool isSmooth;   ///< usual discs of its node are wider than a few pixels, at its middle
    bool mayBeWide;  ///< discs of its node reach few of each other's spacings, or are too large for texels
    std::optional<lod::PointMaterial> material = {};
};
std::vector<PlacedDisc> placedDiscs(const render::DrawList& draws, const Chunks& chunks);

/// Is a disc so wide that an ellipse a texel does not hold it?
bool isWide(const lod::View& view, const PlacedDisc& disc);
/// Every pixel whose ray meets these discs: the mean of those about the nearest.
void showWide(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);
/// Every pixel whose ray meets a disc, and that of each small disc's centre: the nearest (Sample::isSmooth: as the
/// disc's).
void showSplats(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level);

/// What comparison variants leave out of blending.
struct BlendVariation {
    bool movesDiscsAway = false;  ///< fronts are those of discs farther along the axis, not along each ray
    bool isNormalised = true;     ///< sums count as they are, as if every pixel had that of a grid
};
/// Before the level's exact pixels, and in the place of what is not there: discs blended by their kernels.
void blendDiscs(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level,
                const BlendVariation& variation = {});

/// That of a point.
void setMaterial(Sample& s, const std::optional<lod::PointMaterial>& material);

/// A pixel that shows a disc, and no ellipse. `n`: unit, towards the eye.
Sample shownPixel(const lod::View& view, const glm::dvec2& at, double depth, const glm::dvec3& n,
                  const glm::dvec3& colour, bool isLeaf);

}  // namespace stipple::reference
