// The views of lights that cast shadows: pure functions of what a camera sees and of the lights. Shadow views are views
// as any other: their cuts are those of selectCut, their pictures those of the passes of visibility.
//
// A directional light has cascades. That of level k serves what is nearer than 2^k world units: it is as wide as the
// smallest ball that holds all that the camera may see within that distance, and a quarter more, and stands on a grid
// of whole texels; so its texels are where they were as long as the camera moves by less than that, and turning the
// camera about its eye costs what moving it costs. A spot has one view in perspective, as wide as its cone. Point
// lights cast none.
#pragma once

#include <span>
#include <vector>

#include "engine/render/draw_list.h"
#include "lod/cut/cut.h"

namespace stipple::render {

/// A map of a light.
struct ShadowView {
    lod::View view;                            ///< square
    uint32_t light = 0;                        ///< of DrawSettings::lights
    uint32_t slot = 0;                         ///< of the lights that cast
    double reach = 0;                          ///< serves what is no farther than this from the camera's eye
    double centreDepth = 0;                    ///< depths of maps count from here
    double size = 0;                           ///< as shared::ShadowMap
    bool isOf(const ShadowView& other) const;  ///< the same picture?
};

struct ShadowMapSettings {
    uint32_t edge = 1024;      ///< texels
    double errorTexels = 0.5;  ///< allowed error of casters; times that of the camera's view, px
};

/// What the camera sees, as distances from its eye (orthographic: depths).
struct SeenRange {
    double nearest = 0, farthest = 0;
    bool isEmpty() const { return !(farthest > 0) || !(nearest <= farthest); }
};
/// What a node of the cut is within, world space, and how far from the camera's eye (orthographic: how deep) its
/// centre is.
struct SeenBall {
    glm::dvec3 centre;
    double radius, away;
};
std::vector<SeenBall> seenBalls(const lod::Cut& cut, const lod::CutScene& scene, const lod::View& camera);
SeenRange seenRange(std::span<const SeenBall> seen);

/// A ball that holds all that is placed, world space.
struct SceneBall {
    glm::dvec3 centre{0};
    double radius = 0;
};
SceneBall ballOf(const lod::CutScene& scene);

struct ShadowViews {
    std::vector<ShadowView> views;  ///< of each light the finest first
    /// Lights that would cast but get none: beyond kMostShadowLights, or without a cone or direction.
    uint32_t left = 0;
};
ShadowViews shadowViews(std::span<const WorldLight> lights, const ShadowMapSettings& settings, const SceneBall& ball,
                        const SeenRange& seen, const lod::View& camera);

/// Does anything that the camera sees between `from` and `to` away from its eye stand where the light looks?
bool hasReceivers(std::span<const SeenBall> seen, const lod::View& camera, const lod::View& light, double from,
                  double to);

/// Error of a shadow's border on a surface that faces the light by `facing` = |n.l|, pixels of the camera's view: for a
/// place `distance` from its eye (orthographic: any), `offAxis` away from its axis (cosine). `error`, `texel`, `bias`:
/// world units there.
double shadowErrorPixels(const lod::View& camera, double distance, double offAxis, double facing, double error,
                         double texel, double bias);

}  // namespace stipple::render
