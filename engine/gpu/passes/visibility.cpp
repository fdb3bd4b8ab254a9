// Points, curves and triangles into the visibility buffer.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuKind pointsOnGpu{};  // the dispatch over all pixels resolves them
constinit const GpuKind curvesOnGpu{[](Recording& f) { f.overPixels("curve texels", "curve_texels"); }};
constinit const GpuKind trianglesOnGpu{[](Recording& f) { f.overPixels("triangle texels", "triangle_texels"); }};

constinit const GpuPass clearPass{[](Recording& f) {
    f.fill("clear", {{shared::kVisibilityBinding, 0xffffffffu}, {shared::kStatsBinding, 0u}});
}};

constinit const GpuPass projectPass{[](Recording& f) {
    if (f.has(render::Pass::discs)) f.emptyList("disc list", shared::kDiscsBinding);
    f.overBlocks("project", f.draws().points().blocks.size());
}};

constinit const GpuPass discsPass{[](Recording& f) {
    f.once("disc order", "disc_order");
    f.overBands("discs", "discs", f.draws().frame.firstBlock.of[shared::kKindDiscs]);
}};

constinit const GpuPass smoothPass{[](Recording& f) {
    f.smooth([&] {
        if (f.draws().hasWideDiscs) f.emptyList("disc list", shared::kDiscsBinding);
        f.overBlocks("project", f.draws().points().blocks.size());
        if (f.draws().hasWideDiscs) discsPass.record(f);
        f.overPixels("resolve", "resolve");
        if (f.draws().hasWideDiscs) f.overPixels("disc texels", "disc_texels");
        pullPass.record(f);
        pushPass.record(f);
    });
    f.fill("clear", {{shared::kVisibilityBinding, 0xffffffffu}});
}};

constinit const GpuPass splatPass{[](Recording& f) {
    f.emptyList("disc list", shared::kDiscsBinding);
    f.overBlocks("splat", f.draws().points().blocks.size());
    f.overBands("discs", "discs");
}};

constinit const GpuPass curvesPass{[](Recording& f) {
    f.emptyList("wide list", shared::kWideBinding);
    f.overBlocks("curves", f.draws().curves().blocks.size());
    f.overBands("filled curves", "curves_wide");
}};

constinit const GpuPass rasterisePass{[](Recording& f) {
    f.emptyList("large list", shared::kLargeBinding);
    f.overBlocks("rasterise", f.buffers().clusters());
    f.overBands("rasterise large", "rasterise_large", f.draws().frame.firstBlock.of[shared::kKindTriangles]);
}};

}  // namespace stipple::gpu
