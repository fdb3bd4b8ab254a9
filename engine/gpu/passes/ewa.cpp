// Discs blended by their kernels: fronts, then sums, then what pixels show; then the same for second surfaces
// (shaders/ewa).
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass ewaPass{[](Recording& f) {
    const size_t blocks = f.draws().points().blocks.size();
    f.emptyList("disc list", shared::kDiscsBinding);
    f.noGroups("no second surfaces", shared::kSecondGroupsBinding, blocks, "ewa_second_begin");
    f.fill("fronts", {{shared::kFrontsBinding, ~0u}});
    f.overBlocks("ewa_front", blocks);
    f.overBands("ewa front, wide", "ewa_front_wide");
    f.overPixels("ewa begin", "ewa_begin");
    f.overBlocks("ewa_sum", blocks);
    f.overBands("ewa sum, wide", "ewa_sum_wide");
    f.overPixels("ewa show", "ewa_show");
    f.overPixels("ewa cover", "ewa_cover");
    f.whereFound(shared::kSecondGroupsBinding, [&] {
        f.overBlocks("ewa_behind", blocks);
        f.overBands("ewa behind, wide", "ewa_behind_wide");
        f.overPixels("ewa second begin", "ewa_second_begin");
        f.overBlocks("ewa_second_sum", blocks);
        f.overBands("ewa second sum, wide", "ewa_second_sum_wide");
        f.overPixels("ewa second show", "ewa_second_show");
    });
}};

}  // namespace stipple::gpu
