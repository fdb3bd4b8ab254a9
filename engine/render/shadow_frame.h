// Shadows in a frame: which maps it needs, which of those that were drawn before still hold, and the drawing of the
// others as frames of the backend that end with what casts (Pass::cast).
#pragma once

#include <memory>
#include <vector>

#include "engine/render/frame.h"
#include "engine/render/shadow_views.h"
#include "lod/cut/views.h"

namespace stipple::render {

/// Of a frame that is what a light sees: depths, and what lets light through. Discs of points are closed.
inline constexpr Mode kCasterMode = Mode::splat;
std::vector<Pass> passesOfCasters(const FrameContent& content);

/// What a light meets first, a texel at a time; row by row, shadowStride (shaders/shared/shadow.h) apart.
struct ShadowTexels {
    std::vector<float> depth;       ///< world units from the map's centre on; where nothing is met: infinity
    std::vector<uint32_t> through;  ///< throughLeaf of shaders/shared/shade.h, or 0; empty: no leaf is met
};
/// A map, as light uses it.
struct ShadowMapOf {
    ShadowView of;
    std::shared_ptr<const ShadowTexels> texels;
    double casterError = 0;  ///< world units; in perspective over the depth
    double depthStep = 0, nearest = 0;
};
/// All maps of a frame: of each light the finest first.
struct ShadowMaps {
    std::vector<ShadowMapOf> maps;
    double surfaceError = 0;  ///< of the camera's cut, px
    double units = 1;         ///< of length that a world unit is here (length_unit.h)
};

/// Reused between frames of one state.
struct ShadowFrame {
    struct Kept {
        ShadowMapOf map;
        std::shared_ptr<const lod::Cut> cut;  ///< what it was drawn of
        double errorAsked = 0;
        bool isComplete = false;  ///< nothing was missing
        bool isStill = false;     ///< nothing in it moves
        uint64_t appearance = 0;
    };
    std::vector<Kept> kept;
    double units = 1;  ///< that a world unit is in their maps
    lod::ViewsScratch scratch;
    lod::CutOfViews cuts;
    Image image;
    double ms = 0;  ///< that the maps of the last frame took, and their cuts
};

/// Adds to `settings` the maps that a frame of state.cut calls for; draws those that do not hold any more, and adds
/// what they miss and need to state.cut, which may become coarser, where the budget does not do for all. `mayKeep`:
/// maps of before hold as long as nothing was missing in them; else only those of the very same cuts do. Clears the
/// settings' maps where there are none.
Result<void> addShadows(FrameState& state, const lod::View& view, FrameSettings& settings, bool mayKeep);

/// Of the maps that are kept.
uint64_t bytesOfShadows(const FrameState& state);
/// What maps took in the last frame, milliseconds.
double msOfShadows(const FrameState& state);

/// Adds the views of lights that a frame of state.cut calls for, so that they are planned with the camera's.
void addShadowRequests(const FrameState& state, const lod::View& view, const FrameSettings& settings,
                       std::vector<lod::ViewRequest>& requests);

}  // namespace stipple::render
