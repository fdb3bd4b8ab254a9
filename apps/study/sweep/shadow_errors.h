// Borders of shadows in the frame of a cell: which pixels a light comes to, against rays through the full detail
// (audit/shadows.h).
#pragma once

#include <optional>

#include "apps/study/sweep/errors.h"
#include "engine/reference/reference.h"

namespace stipple::study {

/// Of the first light of a scene that may cast shadows, as if they were asked for; nothing: there is none.
Result<std::optional<LightTruth>> lightTruthOf(const render::DrawSettings& draw, const reference::FullScene& full,
                                               const lod::View& view, Executor& executor);

Result<void> auditShadowsOf(SceneDrawer& drawer, const LightTruth& truth, const lod::View& view, const Cell& cell,
                            CellErrors& errors);

}  // namespace stipple::study
