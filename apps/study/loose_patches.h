// Elevation patches in memory, to be drawn without a store: what figures change of them no store would hold.
#pragma once

#include <vector>

#include "engine/render/backend.h"
#include "engine/render/draw_list.h"
#include "lod/primitives/patch.h"
#include "lod/store/chunk.h"
#include "lod/store/hierarchy.h"

namespace stipple::study {

/// Patches within [-1, 1]^3 as one node.
class LoosePatches {
  public:
    /// Coded and decoded again, as a store's are.
    static Result<LoosePatches> of(const std::vector<lod::Patch>& patches);
    /// All of them, with depths and normals; `settings.patchAs` says how.
    Result<render::Image> draw(render::Backend& backend, const lod::View& view, render::Mode mode,
                               const render::DrawSettings& settings) const;

  private:
    lod::Hierarchy hierarchy_;
    lod::Chunk chunk_;
};

}  // namespace stipple::study
