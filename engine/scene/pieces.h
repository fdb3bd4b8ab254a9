// Triangles of a primitive that hang together, by places that their corners share.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.h"

namespace stipple::scene {

struct Pieces {
    std::vector<uint32_t> of;  ///< by triangle: its piece
    std::vector<double> area;  ///< of each piece, in the primitive's own units
};

/// Corners are one where their places are the same to the last bit (texture charts and flat shading part them).
Pieces piecesOf(const Primitive& p);

}  // namespace stipple::scene
