// The passes of the gpu backend (engine/render/passes.inl): each records its dispatches.
#pragma once

#include "engine/gpu/record.h"

namespace stipple::gpu {

struct GpuPass {
    void (*record)(Recording& frame);
    bool isBeside = false;  ///< no part of a shader of several passes: recorded before those that it stands among
};
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) extern const GpuPass name##Pass;
#include "engine/render/passes.inl"
#undef STIPPLE_PASS

const GpuPass& gpuPassOf(render::Pass pass);

/// What the backend knows of a kind beside the pass that draws it.
struct GpuKind {
    /// From its pixels of the visibility buffer to texels; after the dispatch that has emptied all others.
    void (*resolve)(Recording& frame) = nullptr;
};
#define STIPPLE_KIND(name) extern const GpuKind name##OnGpu;
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND

const GpuKind& gpuKind(lod::Kind kind);

/// The shader of the pass's own name, a thread a pixel: all that most passes on the surface buffer are.
inline void overEveryPixel(Recording& frame) { frame.overPixels(frame.label(), frame.shader()); }

}  // namespace stipple::gpu
