// Ribbons and tubes: narrow ones are splats, wide ones are filled.
#include "engine/render/draw_list.h"
#include "engine/render/kinds/kind.h"

namespace stipple::render {

static_assert(static_cast<uint32_t>(lod::Kind::curves) == shared::kKindCurves);

constinit const DrawnKind curvesDrawn{.pass = Pass::curves,
                                      .isReconstructed = true,
                                      .isLit = [](const DrawSettings& s) { return s.lit; },
                                      .add = nullptr};

}  // namespace stipple::render
