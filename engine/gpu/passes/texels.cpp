// From the visibility buffer to texels, and over the levels of the pyramid.
#include "engine/gpu/passes/passes.h"
#include "engine/render/kinds/kind.h"
#include "shaders/shared/pyramid_tail.h"

namespace stipple::gpu {

constinit const GpuPass resolvePass{[](Recording& f) {
    f.overPixels("resolve", "resolve");
    if (f.has(render::Pass::discs)) f.overPixels("disc texels", "disc_texels");
    render::forEachKind([&](lod::Kind kind) {
        if (gpuKind(kind).resolve != nullptr && !f.draws().of(kind).isEmpty()) gpuKind(kind).resolve(f);
    });
}};

namespace {

/// From this level on one workgroup pulls and pushes.
size_t firstOfTail(const std::vector<Level>& levels) {
    size_t level = 0;
    while (uint64_t{levels[level].width} * levels[level].height > shared::kTailTexels) ++level;
    return level;
}

}  // namespace

constinit const GpuPass pullPass{[](Recording& f) {
    const size_t tail = firstOfTail(f.buffers().levels());
    f.once("levels", "pyramid_levels");
    for (size_t l = 0; l < tail; ++l) f.overLevel("pull", "pull", l, static_cast<uint32_t>(l) + 1);
    f.once("pull", "pull_tail", tail);
}};

/// Down to level 1, but for what the tail has pushed: the last push fills the surface buffer.
constinit const GpuPass pushPass{[](Recording& f) {
    for (size_t l = firstOfTail(f.buffers().levels()); l-- > 1;)
        f.overLevel("push", "push", l, shared::kPyramidLevels + static_cast<uint32_t>(l));
}};

}  // namespace stipple::gpu
