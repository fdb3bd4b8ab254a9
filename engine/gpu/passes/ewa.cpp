// Discs blended by their kernels: fronts, then sums, then what pixels show (shaders/ewa).
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass ewaPass{[](Recording& f) {
    const size_t blocks = f.draws().points().blocks.size();
    f.emptyList("disc list", shared::kDiscsBinding);
    f.fill("fronts", {{shared::kFrontsBinding, ~0u}});
    f.overBlocks("ewa_front", blocks);
    f.overBands("ewa front, wide", "ewa_front_wide");
    f.overPixels("ewa begin", "ewa_begin");
    f.overBlocks("ewa_sum", blocks);
    f.overBands("ewa sum, wide", "ewa_sum_wide");
    f.overPixels("ewa show", "ewa_show");
    f.overPixels("ewa cover", "ewa_cover");
}};

}  // namespace stipple::gpu
