// The tables of passes and of kinds, and those that are one dispatch over the picture.
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

const GpuKind& gpuKind(lod::Kind kind) {
    static constexpr std::array kTable{
#define STIPPLE_KIND(name) &name##OnGpu,
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND
    };
    return *kTable.at(static_cast<size_t>(kind));
}

constinit const GpuPass surfacePass{overEveryPixel};
constinit const GpuPass shadowPass{[](Recording& f) {
    if (!f.buffers().keepsShadows()) overEveryPixel(f);
}};
constinit const GpuPass castPass{overEveryPixel};
constinit const GpuPass lightPass{overEveryPixel};
constinit const GpuPass refractPass{overEveryPixel};
constinit const GpuPass outputPass{overEveryPixel};

}  // namespace stipple::gpu
