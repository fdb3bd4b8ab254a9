// Elevation patches into the visibility buffer, and texels back out of it.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass patchesPass{[](Recording& f) {
    f.emptyList("large list", shared::kLargeBinding);
    f.overBlocks("patches", f.draws().patches().blocks.size());
    f.overBands("patches large", "rasterise_large", f.draws().frame.firstBlock.of[shared::kKindPatches]);
}};
constinit const GpuKind patchesOnGpu{[](Recording& f) { f.overPixels("patch texels", "patch_texels"); }};

}  // namespace stipple::gpu
