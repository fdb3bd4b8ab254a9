// What the restating backend knows of kinds.
#pragma once

#include "engine/reference/restate.h"
#include "lod/primitives/payload.h"

namespace stipple::reference {

struct RestatedKind {
    /// What the cut has of it into the level: nearest surface at each pixel. Null: the mode says how (points).
    void (*project)(const render::DrawList& draws, const Chunks& chunks, Level& level) = nullptr;
};
#define STIPPLE_KIND(name) extern const RestatedKind name##Restated;
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND

/// All of them but points, in their order.
void projectOtherKinds(const render::DrawList& draws, const Chunks& chunks, Level& level);

}  // namespace stipple::reference
