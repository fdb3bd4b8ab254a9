// What comes of lights that cast shadows, pixel by pixel.
#include <algorithm>
#include <cstring>

#include "engine/cpu/passes/passes.h"
#include "engine/render/shadow_frame.h"

namespace stipple::cpu {
namespace {

size_t tileRows(Frame& frame) { return frame.tileRow(0, frame.constants.height); }

/// Tables of the maps, room for the masks, and whether those still hold: before them stands what they are of.
void begin(Frame& frame) {
    Frame::Shadows& s = frame.shadows;
    const render::DrawList& draws = *frame.draws;
    s.maps = draws.shadows;
    s.depths.clear();
    s.through.clear();
    for (size_t m = 0; m < s.maps.size(); ++m) {
        const render::ShadowTexels& texels = *draws.shadowMaps->maps[m].texels;
        s.maps[m].first = 0;
        s.depths.push_back(texels.depth.data());
        s.through.push_back(texels.through.empty() ? nullptr : texels.through.data());
    }
    constexpr size_t kKeyWords = 2;
    const size_t words = size_t{draws.shadowSlots} * frame.constants.width * frame.constants.height;
    uint32_t* const room = frame.room<uint32_t>(0, kKeyWords + words);
    s.masks = room + kKeyWords;
    s.shadowed = frame.room<uint8_t>(1, draws.shadowSlots * tileRows(frame));
    uint64_t key = 0;
    std::memcpy(&key, room, sizeof(key));
    s.areKept = draws.shadowKey != 0 && key == draws.shadowKey;
    std::memcpy(room, &draws.shadowKey, sizeof(key));
}

void run(const RowPlace& at, SurfaceRow& row) {
    Frame& frame = at.frame;
    const uint32_t slots = frame.draws->shadowSlots;
    const size_t pixels = size_t{frame.constants.width} * frame.constants.height;
    const auto kept = [&](uint32_t slot) { return frame.shadows.masks + slot * pixels + at.first; };
    const auto shadowed = [&](uint32_t slot) -> uint8_t& {
        return frame.shadows.shadowed[slot * tileRows(frame) + frame.tileRow(at.x0, at.y)];
    };
    if (frame.shadows.areKept) {
        row.shadowSlots = slots;
        for (uint32_t s = 0; s < slots; ++s) {
            row.isShadowed[s] = shadowed(s) != 0;
            if (row.isShadowed[s]) std::copy_n(kept(s), at.n, row.shadow[s]);
        }
        return;
    }
    frame.k.shadowRow(frame.constants, shadowInputOf(frame), at.x0, at.y, at.n, row);
    for (uint32_t s = 0; s < slots && frame.draws->shadowKey != 0; ++s) {
        shadowed(s) = row.isShadowed[s] ? 1 : 0;
        if (row.isShadowed[s]) std::copy_n(row.shadow[s], at.n, kept(s));
    }
}

/// These are not kept.
void beside(const RowPlace& at, SurfaceRow& second) {
    at.frame.k.shadowRow(at.frame.constants, shadowInputOf(at.frame), at.x0, at.y, at.n, second);
}

}  // namespace

constinit const CpuPass shadowPass{
    .row = {.concerns =
                [](const Frame& frame, const SurfacePlanes& planes) {
                    return cpuPassOf(render::Pass::light).row.concerns(frame, planes);
                },
            .wants = [](const Frame&, SurfaceWants& wants) { wants.normal = wants.depth = wants.leaf = true; },
            .run = run,
            .beside = beside},
    .begin = begin};

}  // namespace stipple::cpu
