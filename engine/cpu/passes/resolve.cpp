// From the visibility buffer to the texels of level 0.
#include "engine/cpu/passes/resolve.h"

#include <atomic>

#include "engine/render/kinds/kind.h"

namespace stipple::cpu {
namespace {

/// Planes that only triangles and patches need, those with what sends light, and those with wide discs.
void preparePlanes(Frame& frame, size_t pixels) {
    const auto fit = [&](HugeBuffer<uint32_t>& plane, size_t& size, bool isNeeded) {
        if (isNeeded && size != pixels) {
            plane.assign(pixels, 0);
            size = pixels;
        }
    };
    if (frame.hasSmooth && frame.smoothPixels != pixels) {
        frame.smooth.assign(pixels, 0);
        frame.smoothPixels = pixels;
    }
    frame.hasTriangles = frame.draws->hasSurfaces();
    frame.hasEmissive = !frame.draws->patches().isEmpty() && frame.hasLitPatches;
    for (const shared::SurfaceMaterial& m : frame.draws->materials)
        frame.hasEmissive = frame.hasEmissive ||
                            (!frame.draws->triangles().isEmpty() && m.emissive.x + m.emissive.y + m.emissive.z > 0);
    fit(frame.surface, frame.surfacePixels, frame.hasTriangles);
    fit(frame.emissive, frame.emissivePixels, frame.hasEmissive);
}

/// Does a tile show something, or do its texels hold what older frames have left?
bool isTouched(const Frame& frame, const Level& fine, const Level* coarse, uint32_t x0, uint32_t n, uint32_t row0,
               uint32_t row1) {
    return frame.isSeen(size_t{row0} * fine.width, (row1 - row0) * fine.width) ||  // its whole band
           fine.mayHoldTile(x0, n, row0, row1) ||
           (coarse != nullptr && coarse->mayHoldParents(x0, n, row0, row1, false));
}

/// Level 0 from the visibility buffer, and level 1 on the way.
void resolve(Frame& frame) {
    Level& fine = frame.pyramid.level(0);
    Level* coarse = frame.pyramid.levels() > 1 ? &frame.pyramid.level(1) : nullptr;
    frame.pyramid.beginFrame(frame.constants, frame.hasCurves);
    const RowResolver resolver(frame);
    std::atomic<float> largestRadius{0};
    frame.pyramid.forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
        if (!isTouched(frame, fine, coarse, x0, n, row0, row1)) return;
        thread_local TexelRow upper{}, lower{}, out{};  // what is empty is multiplied by 0, so it must be finite
        upper.hasTubes = lower.hasTubes = out.hasTubes = frame.hasCurves;
        thread_local ClosedUpRow closedUp{};
        upper.hasMaterials = lower.hasMaterials = out.hasMaterials = frame.constants.hasMaterials != 0;
        float largest = 0;
        for (uint32_t y = row0; y < row1; y += 2) {
            bool any = false;
            for (TexelRow* row : {&upper, &lower}) {
                const uint32_t yy = y + (row == &lower ? 1 : 0);
                row->depth[kPad + n] = 0;  // beyond the right edge of an odd width
                const size_t at = size_t{yy} * fine.width + x0;
                if (yy >= row1 || !frame.isSeen(at, n)) {
                    row->hasTubes = false;
                    std::fill_n(row->depth + kPad, n, 0.0f);
                    if (frame.hasCurves) Pyramid::clearTubes(*row);
                    if (yy < row1) fine.empty(yy, x0, n);
                    continue;
                }
                row->hasTubes = frame.hasCurves;  // may have; the kernel says whether it does
                const bool has = resolver.resolve(x0, yy, n, *row, closedUp, largest);
                if (!has) {
                    fine.empty(yy, x0, n);
                } else if (closedUp.of.isAny()) {
                    // (Whole groups: what is left of one is gone through one by one.)
                    const uint32_t count = closedUp.of.count();
                    frame.k.packRow(closedUp.texels, wholeGroups(count), fine.planesClosedUp(yy, x0, count));
                    fine.closeUp(yy, x0, n, closedUp.of);
                } else {
                    fine.hold(yy, x0, n, frame.k.packRow(*row, n, fine.planes(yy, x0)));
                }
                any = any || has;
            }
            if (!coarse) continue;
            frame.pyramid.pullPair(upper, lower, any, (n + 1) / 2, 1.0f, *coarse, x0 / 2, y / 2, out);
        }
        float seen = largestRadius.load(std::memory_order_relaxed);
        while (largest > seen && !largestRadius.compare_exchange_weak(seen, largest, std::memory_order_relaxed)) {
        }
    });
    resolver.finish();
    frame.pyramid.setLargestRadius(largestRadius.load());
}

}  // namespace

RowResolver::RowResolver(Frame& frame)
    : frame_(frame),
      input_{.blocks = frame.blocks.data(),
             .meshBlocks = frame.meshBlocks.data(),
             .materials = frame.draws->materials.data(),
             .patchBlocks = frame.patchBlocks.data(),
             .curveBlocks = frame.curveBlocks.data(),
             .discs = frame.discs.data(),
             .discBoxes = frame.discBoxes.data(),
             .discCount = frame.discs.size(),
             .exactPoints = frame.mode->fillsSplats,
             .needsDepths = true,
             .roundsPoints = false,
             .filtered = frame.isBlended() ? frame.filtered.data() : nullptr,
             .seconds = frame.seconds(),
             .frame = &frame,
             .ofKind = nullptr} {
    preparePlanes(frame, frame.visibilityPixels);
    render::forEachKind([&](lod::Kind kind) { ofKind_.at(static_cast<size_t>(kind)) = cpuKind(kind).resolve; });
    input_.ofKind = ofKind_.data();
}

bool RowResolver::resolve(uint32_t x0, uint32_t y, uint32_t n, TexelRow& row, ClosedUpRow& closedUp,
                          float& largestRadius) const {
    const size_t at = size_t{y} * frame_.constants.width + x0;
    return frame_.k.resolveRow(frame_.constants, frame_.tables, input_, frame_.visibility.data() + at, x0, y, n, row,
                               closedUp, largestRadius, frame_.planesAt(at));
}

void RowResolver::finish() const { std::fill(frame_.runs.begin(), frame_.runs.end(), uint8_t{0}); }

/// Without a pyramid rows are resolved where they are shown.
constinit const CpuPass resolvePass{.run = [](Frame& frame) {
    if (frame.hasPyramid) resolve(frame);
}};

}  // namespace stipple::cpu
