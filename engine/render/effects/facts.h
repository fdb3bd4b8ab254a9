// What a scene is made of, as far as effects ask: it decides what `auto` calls for.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "lod/store/store.h"

namespace stipple::render {

struct DrawSettings;

struct SceneFacts {
    bool hasPoints = false, hasCurves = false, hasTriangles = false, hasPatches = false;
    bool hasUnlitPoints = false;     ///< drawn as they are: their own colours, no light on them
    bool hasUnlitTriangles = false;  ///< the same of triangles and patches
    bool hasPointsWithoutNormals = false;
    bool hasMirrors = false;      ///< opaque materials that are smooth enough to mirror the screen
    bool hasTransparent = false;  ///< materials that what is behind shows through
    uint32_t lights = 0;          ///< of the scene's own, and a sun
    uint32_t lightsThatCast = 0;  ///< of these: what is lit could show their shadows
    double extent = 0;            ///< of the largest store, across its focus; its units
};

/// Of stores that are placed, with what the settings make of them.
SceneFacts factsOf(std::span<const std::shared_ptr<const lod::Store>> stores, const DrawSettings& settings);

}  // namespace stipple::render
