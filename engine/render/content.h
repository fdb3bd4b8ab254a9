// What a frame draws, for what it calls for.
#pragma once

namespace stipple::render {

struct FrameContent {
    bool hasPoints = true, hasTriangles = false, hasStrands = false;
    bool hasWideDiscs = false;  ///< points may be
    bool isEmpty() const { return !hasPoints && !hasTriangles && !hasStrands; }
};

}  // namespace stipple::render
