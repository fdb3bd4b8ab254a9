// What drawing knows of a kind of primitives, whatever draws it.
#pragma once

#include <glm/glm.hpp>
#include <optional>

#include "engine/render/passes.h"
#include "lod/cut/cut.h"
#include "lod/primitives/payload.h"

namespace stipple::render {

struct DrawSettings;
struct DrawList;

struct DrawnKind {
    /// What draws it into the visibility buffer; none: that is the reconstruction's (Reconstruction::points).
    std::optional<Pass> pass;
    bool isReconstructed;  ///< its texels are splats, between which pull and push close gaps; else its pixels are exact
    bool (*isLit)(const DrawSettings& settings);
    /// Adds what the cut has of it beyond nodes of records (Cut::draw), which all kinds share. Null: nothing.
    void (*add)(const lod::Cut& cut, const glm::dmat3& cameraFromWorld, DrawList& out);
    uint32_t recordsPerBlock = 256;  ///< of 256 draw ids
};
#define STIPPLE_KIND(name) extern const DrawnKind name##Drawn;
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND

const DrawnKind& drawnKind(lod::Kind kind);

/// Calls use(kind) for all kinds, in their order.
template <typename Use>
void forEachKind(const Use& use) {
    for (size_t k = 0; k < lod::kKinds; ++k) use(static_cast<lod::Kind>(k));
}

}  // namespace stipple::render
