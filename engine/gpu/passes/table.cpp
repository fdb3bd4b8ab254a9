// The table of passes, and those that are one dispatch over the picture.
#include <array>

#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

const GpuPass& gpuPassOf(render::Pass pass) {
    static constexpr std::array kTable{
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) &name##Pass,
#include "engine/render/passes.inl"
#undef STIPPLE_PASS
    };
    return *kTable.at(static_cast<size_t>(pass));
}

constinit const GpuPass surfacePass{overEveryPixel};
constinit const GpuPass lightPass{overEveryPixel};
constinit const GpuPass outputPass{overEveryPixel};

}  // namespace stipple::gpu
