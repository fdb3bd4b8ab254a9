// A frame of a scene with glass: several frames, one over another (layers.h).
#pragma once

#include <utility>

#include "engine/render/frame.h"
#include "engine/render/layers.h"
#include "lod/cut/views.h"

namespace stipple::render {

/// Reused between frames of one state.
struct LayeredFrame {
    Appearance appearance;
    lod::Cut cut, backCut;
    lod::CutScratch backScratch;
    Image behind, back;
};

/// Draws some nodes into state.image: one frame of the backend, of so many passes.
Result<uint64_t> drawNodes(FrameState& state, const lod::Cut& cut, const lod::View& view,
                           const FrameSettings& settings);

/// Does state.cut show anything that is drawn in a layer? Sets what materials the frame shows.
bool hasLayers(FrameState& state, const lod::View& view, const FrameSettings& settings);
/// Draws state.cut, which has layers; the number of passes of all of them.
Result<uint64_t> drawLayered(FrameState& state, const lod::View& view, const FrameSettings& settings);

/// Adds what views of bodies from behind miss and need to state.cut, so that it is streamed, too.
void addViewsFromBehind(FrameState& state, const lod::View& view, const FrameSettings& settings);
/// Adds those views, so that they are planned with the camera's.
void addRequestsFromBehind(FrameState& state, const lod::View& view, const FrameSettings& settings,
                           std::vector<lod::ViewRequest>& requests);
/// Is all of an instance drawn in layers? What is seen through keeps no light away.
bool castsNone(const FrameState& state, uint32_t instance);
/// Materials of what keeps light away: without those of layers.
std::span<const shared::SurfaceMaterial> materialsOfCasters(const FrameState& state);

}  // namespace stipple::render
