// Ambient occlusion: four dispatches from the surface buffer into its materials.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass occlusionPass{[](Recording& f) {
    f.overPixels("occlusion: horizons", "ao_horizons");
    f.overPixels("occlusion: mean across", "ao_mean_across");
    f.overPixels("occlusion: mean down", "ao_mean_down");
    f.overPixels("occlusion: spread", "ao_spread");
}};

}  // namespace stipple::gpu
