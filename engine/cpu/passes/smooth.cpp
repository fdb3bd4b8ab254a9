// Wide discs once more, by themselves: what their colours and normals are when gaps between their centres are closed by
// pull and push (shaders/shared/smooth.h). A frame of mode pullpush of nothing but them, up to the last push, which
// runs row by row with what it is for (rows.cpp).
#include <array>

#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {
namespace {

void smooth(Frame& frame) {
    const render::Reconstruction* const mode = frame.mode;
    const bool hasCurves = frame.hasCurves;
    frame.mode = &render::reconstructionOf(render::Mode::pullpush);
    frame.isSmoothing = frame.hasPyramid = true;
    frame.hasCurves = false;
    constexpr std::array kPasses{render::Pass::project, render::Pass::discs, render::Pass::resolve, render::Pass::pull,
                                 render::Pass::push};
    for (const render::Pass pass : kPasses) cpuPassOf(pass).run(frame);
    frame.mode = mode;
    frame.isSmoothing = frame.hasPyramid = false;
    frame.hasCurves = hasCurves;
    frame.discs.clear();  // of the pyramid only: here, wide ones are drawn as all others are
    frame.discBoxes.clear();
}

}  // namespace

constinit const CpuPass smoothPass{.run = smooth};

}  // namespace stipple::cpu
