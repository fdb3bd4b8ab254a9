// The passes of the cpu backend (engine/render/passes.h), each a function of the frame.
#pragma once

#include <span>

#include "engine/cpu/frame.h"

namespace stipple::cpu {

/// Block tables and image of the frame; the planes grow to its size.
void clear(Frame& frame);
void project(Frame& frame);
void fillDiscs(Frame& frame);
void drawCurves(Frame& frame);
void rasterise(Frame& frame);
/// Every disc exactly: tile by tile, in front of what is there.
void splat(Frame& frame);
/// Level 0 from the visibility buffer; with a pyramid, level 1 on the way.
void resolve(Frame& frame);
void pull(Frame& frame);
void push(Frame& frame);
/// From reconstructed rows to the picture: surface, and those of its followers that are in `passes`, back to back.
void showRows(Frame& frame, std::span<const render::Pass> passes);

using RunPass = void (*)(Frame&);
/// Null for what showRows runs.
RunPass runPassOf(render::Pass pass);

}  // namespace stipple::cpu
