// Ambient occlusion: four dispatches from the surface buffer into its materials.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass occlusionPass{[](Recording& f) {
    f.overPixels("occlusion: horizons", "occlusion_horizons");
    f.overPixels("occlusion: mean across", "occlusion_mean_across");
    f.overPixels("occlusion: mean down", "occlusion_mean_down");
    f.overPixels("occlusion: spread", "occlusion_spread");
}};

}  // namespace stipple::gpu
