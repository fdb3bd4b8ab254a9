// Discs over the levels of a pyramid, drawn exactly (shaders/exact).
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass exactPass{[](Recording& f) {
    const size_t blocks = f.draws().points().blocks.size();
    f.emptyList("disc list", shared::kDiscsBinding);
    f.fill("levels of discs", {{shared::kTexelsBinding, ~0u}});
    f.overBlocks("exact_depths", blocks);
    f.overBlocks("exact_ids", blocks);
    f.overBlocks("exact_rest", blocks);
    f.overBands("discs", "discs");
    f.overPixels("exact gather", "exact_gather");
}};

}  // namespace stipple::gpu
