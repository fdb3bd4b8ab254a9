// What comes of lights that cast shadows, pixel by pixel; and what such a light meets first.
#include <algorithm>

#include "engine/cpu/passes/passes.h"
#include "engine/render/shadow_frame.h"
#include "shaders/shared/shade.h"

namespace stipple::cpu {
namespace {

ShadowInput inputOf(const Frame& frame) {
    return {frame.shadowMaps.data(), frame.shadowDepths.data(), frame.shadowThrough.data(),
            static_cast<uint32_t>(frame.shadowMaps.size()), frame.draws->shadowSlots};
}

void run(const RowPlace& at, SurfaceRow& row) {
    Frame& frame = at.frame;
    const uint32_t slots = frame.draws->shadowSlots;
    const auto kept = [&](uint32_t slot) { return frame.shadows.data() + slot * frame.visibilityPixels + at.first; };
    if (frame.keepsShadows) {
        row.shadowSlots = slots;
        for (uint32_t s = 0; s < slots; ++s) std::copy_n(kept(s), at.n, row.shadow[s]);
        return;
    }
    frame.k.shadowRow(frame.constants, inputOf(frame), at.x0, at.y, at.n, row);
    for (uint32_t s = 0; s < slots && frame.draws->shadowKey != 0; ++s) std::copy_n(row.shadow[s], at.n, kept(s));
}

/// Depths, and what leaves let through.
void cast(const RowPlace& at, SurfaceRow& row) {
    uint32_t* const through = at.frame.image->rgba.data() + at.first;
    std::copy_n(row.depth, at.n, at.frame.image->depth.data() + at.first);
    for (size_t i = 0; i < at.n; ++i)
        through[i] = row.leaf[i] > 0.5f ? shared::throughLeaf({row.red[i], row.green[i], row.blue[i]}) : 0u;
}

}  // namespace

void prepareShadows(Frame& frame) {
    frame.shadowMaps = frame.draws->shadows;
    frame.shadowDepths.clear();
    frame.shadowThrough.clear();
    for (size_t m = 0; m < frame.shadowMaps.size(); ++m) {
        const render::ShadowTexels& texels = *frame.draws->shadowMaps->maps[m].texels;
        frame.shadowMaps[m].first = 0;
        frame.shadowDepths.push_back(texels.depth.data());
        frame.shadowThrough.push_back(texels.through.empty() ? nullptr : texels.through.data());
    }
    if (frame.shadowMaps.empty()) {
        // (What casts is drawn between frames that have masks.)
        if (frame.casts || frame.shadowWords == 0) return;
        frame.shadows = {};
        frame.shadowWords = frame.shadowKey = 0;
        return;
    }
    const size_t words = size_t{frame.draws->shadowSlots} * frame.constants.width * frame.constants.height;
    if (frame.shadowWords != words) {
        frame.shadows.assign(words, 0);
        frame.shadowWords = words;
        frame.shadowKey = 0;
    }
    const uint64_t key = frame.draws->shadowKey;
    frame.keepsShadows = key != 0 && key == frame.shadowKey;
    frame.shadowKey = key;
}

void shadowSeconds(const RowPlace& at, SurfaceRow& second) {
    at.frame.k.shadowRow(at.frame.constants, inputOf(at.frame), at.x0, at.y, at.n, second);
}

constinit const CpuPass shadowPass{
    .row = {.concerns =
                [](const Frame& frame, const SurfacePlanes& planes) {
                    return cpuPassOf(render::Pass::light).row.concerns(frame, planes);
                },
            .wants = [](const Frame&, SurfaceWants& wants) { wants.normal = wants.depth = wants.leaf = true; },
            .run = run}};

constinit const CpuPass castPass{
    .row = {.concerns = nullptr,
            .wants = [](const Frame&, SurfaceWants& wants) { wants.depth = wants.leaf = true; },
            .run = cast}};

}  // namespace stipple::cpu
