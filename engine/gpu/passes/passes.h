// The passes of the gpu backend (engine/render/passes.inl): each records its dispatches.
#pragma once

#include "engine/gpu/record.h"

namespace stipple::gpu {

struct GpuPass {
    void (*record)(Recording& frame);
};
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) extern const GpuPass name##Pass;
#include "engine/render/passes.inl"
#undef STIPPLE_PASS

const GpuPass& gpuPassOf(render::Pass pass);

/// The shader of the pass's own name, a thread a pixel: all that most passes on the surface buffer are.
inline void overEveryPixel(Recording& frame) { frame.overPixels(frame.label(), frame.shader()); }

}  // namespace stipple::gpu
