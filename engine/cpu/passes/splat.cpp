// Discs drawn exactly: the nearest of each pixel.
#include "engine/cpu/passes/passes.h"
#include "engine/cpu/passes/tile_lists.h"

namespace stipple::cpu {
namespace {

void splat(Frame& frame) {
    TileLists lists(frame, {});
    lists.place(true);
    lists.draw([&](const PlacedSplat* splats, const uint32_t* places, size_t count, const SplatTile& tile) {
        frame.k.splatTile(frame.constants, splats, places, count, tile, frame.visible());
    });
}

}  // namespace

constinit const CpuPass splatPass{.run = splat};

}  // namespace stipple::cpu
