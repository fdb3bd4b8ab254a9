// What a frame draws, for what it calls for.
#pragma once

#include "lod/primitives/payload.h"

namespace stipple::render {

struct FrameContent {
    uint32_t kinds = 0;           ///< bit k: of kind k
    bool hasWideDiscs = false;    ///< points may be
    bool hasSmoothDiscs = false;  ///< of some nodes they would show as facets
    double nearestPixels = 0;     ///< at most, of a world unit of it
    bool has(lod::Kind kind) const { return (kinds >> static_cast<uint32_t>(kind) & 1u) != 0; }
    void add(lod::Kind kind) { kinds |= 1u << static_cast<uint32_t>(kind); }
    bool isEmpty() const { return kinds == 0; }
};

}  // namespace stipple::render
