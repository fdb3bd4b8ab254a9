// What every frame begins with: block tables and image of the frame; the planes grow to its size.
#include "engine/cpu/passes/passes.h"
#include "engine/render/kinds/kind.h"

namespace stipple::cpu {
namespace {

void resize(Frame& frame) {
    const uint32_t w = frame.constants.width, h = frame.constants.height;
    frame.image->width = w;
    frame.image->height = h;
    const size_t pixels = size_t{w} * h;
    resizeHuge(frame.image->rgba, pixels);
    resizeHuge(frame.image->depth, frame.wantAll ? pixels : 0);
    resizeHuge(frame.image->normal, frame.wantsRest ? pixels * 3 : 0);
    resizeHuge(frame.image->linear, frame.wantsRest ? pixels * 3 : 0);
    if (frame.hasPyramid || frame.hasSmooth) frame.pyramid.resize(w, h, frame.constants.hasMaterials != 0);
    if (!frame.hasPyramid) frame.shownRows.resize(size_t{(w + kTile - 1) / kTile} * h);
    frame.regions.resize(w, h);
    if (frame.visibilityPixels == pixels) return;  // it is clear whatever its shape
    frame.visibilityPixels = pixels;
    frame.visibility.assign(pixels, shared::kNoKey);
    frame.runs.assign(pixels / Visibility::kRun + 1, 0);
}

void clear(Frame& frame) {
    resize(frame);
    render::forEachKind([&](lod::Kind kind) {
        if (cpuKind(kind).prepare != nullptr) cpuKind(kind).prepare(frame);
    });
}

}  // namespace

constinit const CpuPass clearPass{.run = clear};

}  // namespace stipple::cpu
