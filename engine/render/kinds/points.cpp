// Points: what draws them is the reconstruction's.
#include "engine/render/draw_list.h"
#include "engine/render/kinds/kind.h"

namespace stipple::render {

static_assert(static_cast<uint32_t>(lod::Kind::points) == shared::kKindPoints);

constinit const DrawnKind pointsDrawn{
    .pass = {}, .isReconstructed = true, .isLit = [](const DrawSettings& s) { return s.lit; }, .add = nullptr};

}  // namespace stipple::render
