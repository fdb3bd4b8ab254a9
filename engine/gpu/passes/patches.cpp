// Elevation patches into the visibility buffer, and texels back out of it.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass patchesPass{[](Recording& f) {
    f.emptyList("large list", shared::kLargeBinding);
    const bool areStrips = f.draws().frame.patchAs == shared::kPatchStrips;
    const uint32_t first = f.draws().frame.firstBlock.of[shared::kKindPatches];
    f.overBlocks(areStrips ? "patches" : "patch_splats", f.draws().patches().blocks.size());
    f.overBands("large patches", areStrips ? "rasterise_large" : "patch_splats_large", first);
}};
constinit const GpuKind patchesOnGpu{[](Recording& f) { f.overPixels("patch texels", "patch_texels"); }};

}  // namespace stipple::gpu
