// A picture behind everything, where something of it is seen.
#include <algorithm>

#include "engine/cpu/passes/passes.h"
#include "shaders/shared/bindings.h"

namespace stipple::cpu {
namespace {

bool isSeen(const RowPlace& at, const SurfaceRow& row) {
    return row.hasCoverage || at.frame.draws->hasBlending ||
           std::any_of(row.depth, row.depth + at.n, [](float depth) { return !(depth > 0); });
}

}  // namespace

constinit const CpuPass backgroundPass{
    .row = {.concerns = nullptr,
            .wants = [](const Frame&, SurfaceWants&) {},
            .run =
                [](const RowPlace& at, SurfaceRow& row) {
                    if (!isSeen(at, row)) return;
                    const render::DrawList& draws = *at.frame.draws;
                    at.frame.k.backgroundRow(at.frame.constants,
                                             *draws.tableAt<shared::BackgroundConstants>(shared::kBackgroundBinding),
                                             draws.backdrop->texels.data(), at.x0, at.y, at.n, row);
                    row.hasBehind = true;
                },
            .showsEmpty = true}};

}  // namespace stipple::cpu
