// From the visibility buffer to texels, and over the levels of the pyramid.
#include "engine/gpu/passes/passes.h"
#include "engine/render/kinds/kind.h"

namespace stipple::gpu {

constinit const GpuPass resolvePass{[](Recording& f) {
    f.overPixels("resolve", "resolve");
    if (f.has(render::Pass::discs)) f.overPixels("disc texels", "disc_texels");
    render::forEachKind([&](lod::Kind kind) {
        if (gpuKind(kind).resolve != nullptr && !f.draws().of(kind).isEmpty()) gpuKind(kind).resolve(f);
    });
}};

constinit const GpuPass pullPass{[](Recording& f) {
    for (size_t l = 0; l + 1 < f.buffers().levels().size(); ++l) f.overPixels("pull", "pull", l, l + 1);
}};

/// Down to level 1: the last push fills the surface buffer.
constinit const GpuPass pushPass{[](Recording& f) {
    for (size_t l = f.buffers().levels().size() - 1; l-- > 1;) f.overPixels("push", "push", l, l);
}};

}  // namespace stipple::gpu
