// Reflections of the screen (shaders/shared/reflection.h), from the surface buffer into planes that light adds. Rows
// without anything smooth have none.
#include "engine/cpu/passes/passes.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/occlusion.h"

namespace stipple::cpu {
namespace {

ReflectionInput reflectionInputOf(Frame& frame) {
    KeptSurface& kept = frame.kept;
    ReflectionInput in{};
    in.constants = *frame.draws->tableAt<shared::ReflectionConstants>(shared::kReflectionBinding);
    in.depth = kept.depth.data();
    in.normal = kept.normal.data();
    in.colour = kept.colour.data();
    in.material = kept.material.data();
    in.emissive = frame.planesAt(0).emissive;
    in.light = lightInputOf(frame);
    in.shadows = shadowInputOf(frame);
    in.hasOcclusion = frame.draws->tableAt<shared::OcclusionConstants>(shared::kOcclusionBinding) != nullptr;
    return in;
}

void run(Frame& frame) {
    const uint32_t width = frame.constants.width, height = frame.constants.height;
    const size_t pixels = size_t{width} * height, tiles = (width + kTile - 1) / kTile;
    float* const planes = frame.room<float>(0, 3 * pixels);
    uint8_t* const rows = frame.room<uint8_t>(1, tiles * height);
    const ReflectionInput in = reflectionInputOf(frame);
    constexpr size_t kRows = 4;
    frame.executor.parallelFor(height, kRows, [&](size_t begin, size_t end) {
        for (auto y = static_cast<uint32_t>(begin); y < end; ++y)
            for (uint32_t x = 0; x < width; x += kTile) {
                float* const first = planes + size_t{y} * width + x;
                rows[frame.tileRow(x, y)] = frame.k.reflectRow(frame.constants, in, x, y, std::min(kTile, width - x),
                                                               {first, first + pixels, first + 2 * pixels})
                                                ? 1
                                                : 0;
            }
    });
    frame.mirrored = {planes, planes + pixels, planes + 2 * pixels, rows};
}

}  // namespace

constinit const CpuPass reflectionPass{.run = run};

}  // namespace stipple::cpu
