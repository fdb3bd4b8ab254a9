// What the tests of the modes that draw discs share: closed surfaces from all around, and bytes that do not depend on
// threads.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "engine/base/executor.h"
#include "engine/render/frame.h"
#include "lod/cut/cut.h"

namespace stipple::test {

/// A picture of a closed surface of points.
struct InsideView {
    lod::View view;
    double errorPixels = 0;      ///< by turns 1, and one that only leaves meet
    std::vector<size_t> pixels;  ///< well inside the outline: the rays two pixels around meet the surface too
    std::function<render::Image(const render::FrameSettings&)> draw;  ///< by the cpu backend

    /// Of `pixels`, those without a surface.
    size_t openIn(const render::FrameSettings& settings) const;
};
/// A torus of 20,000 irregular samples in square pictures from `poses` random places, 2^`nearest` to 4 times the
/// diagonal of its bounds away.
void forViewsOfAClosedSurface(int poses, uint32_t size, double nearest,
                              const std::function<void(const InsideView&)>& each);

/// Pieces one after the other, the last one first. (Four threads may come in the order of one, where a machine has
/// other things to do; this is another order each time.)
std::unique_ptr<Executor> makeBackwardsExecutor();

/// The cpu backend draws 30,000 discs of any size as the same bytes (colour, depth, normal) with one thread and four,
/// and with the pieces of four backwards, on every instruction set.
void expectSameForAnyThreads(const render::FrameSettings& settings);

}  // namespace stipple::test
