// Discs drawn exactly: the nearest of each pixel.
#include "engine/cpu/passes/passes.h"
#include "engine/cpu/passes/tile_lists.h"

namespace stipple::cpu {
namespace {

void drawDiscs(Frame& frame, std::span<const uint32_t> blocks) {
    TileLists lists(frame, {}, blocks);
    lists.place(true);
    lists.draw([&](const PlacedSplat* splats, const uint32_t* places, size_t count, const SplatTile& tile) {
        frame.k.splatTile(frame.constants, splats, places, count, tile, frame.visible());
    });
}

void splat(Frame& frame) {
    drawDiscs(frame, frame.hidden.begin(frame, frame.mayHideNodes));
    if (const auto rest = frame.hidden.rest(frame, true); !rest.empty()) drawDiscs(frame, rest);
}

}  // namespace

constinit const CpuPass splatPass{.run = splat};

}  // namespace stipple::cpu
