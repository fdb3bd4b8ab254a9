// The table of kinds.
#include "engine/reference/kinds.h"

namespace stipple::reference {

constinit const RestatedKind pointsRestated{};
constinit const RestatedKind curvesRestated{projectCurves};
constinit const RestatedKind trianglesRestated{projectMeshes};

void projectOtherKinds(const render::DrawList& draws, const Chunks& chunks, Level& level) {
    for (const RestatedKind* kind : {
#define STIPPLE_KIND(name) &name##Restated,
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND
         })
        if (kind->project != nullptr) kind->project(draws, chunks, level);
}

}  // namespace stipple::reference
