// What the parts of the restating backend share: one sample a pixel, before and after reconstruction.
#pragma once

#include <algorithm>
#include <glm/glm.hpp>
#include <memory>
#include <unordered_map>
#include <vector>

#include "engine/base/executor.h"
#include "engine/render/backend.h"
#include "engine/render/draw_list.h"
#include "lod/store/chunk.h"

namespace stipple::reference {

struct Sample {
    bool valid = false;
    double key = 0;                               ///< depth by which curves are ordered
    double depth = 0, radius = 0, thickness = 0;  ///< thickness in world units
    glm::dvec2 centre{0};                         ///< of the splat, pixels of the full-size image
    glm::dvec2 perp{0};
    glm::dvec3 colour{0};
    double coverage = 1;  ///< of the pixel, where what is behind is the background
    // Of a tube: `perp` is t_v t_perp, with t its unit tangent, `axis` (tx^2 - ty^2, 2 tx ty).
    bool isRound = false;
    glm::dvec2 axis{0};
    bool isMerged = false;  ///< of a pyramid
    bool isSmooth = false;  ///< of a disc exactly, which is wider than a few pixels
    // Of a triangle's pixel:
    bool isTriangle = false, isUnlit = false;
    bool isLitAsPoint = false;  ///< of a patch without material
    uint32_t optic = 0;         ///< which of a layer's optics
    bool blends() const { return optic == 15; }
    double metallic = 0, roughness = 1, occlusion = 1, opacity = 1;
    /// Of points: how much of what was merged has a material, which is of that part; else lit by one formula.
    double materialShare = 0;
    bool hasMaterial() const { return materialShare > 0.5; }
    glm::dvec3 emissive{0};
    glm::dvec3 mirrored{0};  ///< what light adds of the picture's mirror image
    /// No surface, and lets light through: hardly any thickness. `pixels`: of a world unit at its depth.
    bool isLeaf(double pixels) const { return thickness * pixels < 0.125 * radius; }
    /// So do narrow ribbons, which are merged as a surface is: of what is not round `axis.x` is 1 where all parts are.
    bool letsLightThrough(double pixels) const { return isLeaf(pixels) || (!isRound && axis.x > 0.999); }
};
/// The pixel of a coordinate, from 0 to `most`: those far off the image, or no number at all, do not fit into an int.
inline int pixelIn(double coordinate, int most) {
    return coordinate > 0 ? static_cast<int>(std::min(coordinate, static_cast<double>(most))) : 0;
}

/// Thickness of leaves, over their radius.
constexpr double kLeafThickness = 1.0 / 16;

/// A second surface at a pixel: it is lit on its own, and has its share of the pixel.
struct SecondSample {
    Sample sample;
    double share = 0;
    bool isFront = false;  ///< depth and normal of the pixel are its own
};

struct Level {
    int width = 0, height = 0;
    std::vector<Sample> samples;
    std::unordered_map<size_t, SecondSample> seconds;  ///< by pixel
    const Sample* at(int x, int y) const {
        return x < 0 || y < 0 || x >= width || y >= height
                   ? nullptr
                   : &samples[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
    }
    Sample& ref(int x, int y) {
        return samples[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
    }
};

struct PlacedDisc;
/// How a comparison variant (variants/) departs from its mode; as it is here: not at all.
struct Variation {
    /// Instead of the mode's own points.
    void (*showDiscs)(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) = nullptr;
    /// Weight of a splat in the push at rho^2 < 1, instead of (1 - rho^2)^2.
    double (*kernel)(double rho2) = nullptr;
    bool pullsContained = false;  ///< only those children whose ellipses contain their parent's centre
    bool lightsPoints = false;    ///< before they are blended, each by its own normal
    bool hasColours = true;
};

/// Depth of a sample's plane at an image point; see planeDepth (shaders/shared) for what is capped.
double depthAt(const Sample& s, const glm::dvec2& point, const lod::View& view);

/// Normal of a sample at an image point, camera space: a disc's is that at its centre, a tube's that at the pixel.
glm::dvec3 normalAt(const Sample& s, const glm::dvec2& point, const lod::View& view);

using Chunks = std::unordered_map<uint64_t, lod::Chunk>;  ///< by source << 32 | chunk

/// The restating backend, but for how it varies.
std::unique_ptr<render::Backend> makeReferenceBackend(Executor& executor, const Variation& variation);

/// The rotation that takes the unit vector v to z the shortest way (Rodrigues).
glm::dmat3 rotationToZ(const glm::dvec3& v);

/// Colours of the debug views level and error.
glm::dvec3 debugColour(const shared::FrameConstants& f, const lod::Node& node, const lod::CutDraw& cut);

/// Ribbons and tubes of the cut into the level.
void projectCurves(const render::DrawList& draws, const Chunks& chunks, Level& level);

/// What tubes look like pixel by pixel, once the level is reconstructed: normals round their axes, depths of the
/// surface.
void finishTubes(const lod::View& view, Level& level);

/// Triangles of the cut into the level: nearest surface at each pixel's centre.
void projectMeshes(const render::DrawList& draws, const Chunks& chunks, Level& level);

}  // namespace stipple::reference
