// The reconstructions: how the records of a frame become one surface a pixel. A new one is a row of this table, its
// passes, and an entry in each backend's table of passes.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "engine/render/passes.h"

namespace stipple::render {

enum class Mode : uint8_t { pullpush, points, splat };

/// What a frame draws, for what it calls for.
struct FrameContent {
    bool hasPoints = true, hasTriangles = false, hasStrands = false;
    bool hasWideDiscs = false;  ///< points may be
    bool isLit = false;         ///< by a sun, by lights of the scene's own, or by an environment
};

struct Reconstruction {
    Mode mode;
    const char* name;     ///< as --mode and JSON have it
    const char* summary;  ///< for help
    bool hasPyramid;      ///< gaps between splats are closed by pull and push
    bool closesGaps;      ///< surfaces have no gaps between their records
    bool fillsSplats;     ///< every pixel that a disc covers is its own
    /// From which half-width on, px, curves have exact pixels at the latest (DrawSettings::exactStrands may ask for
    /// more): those below are left to the reconstruction.
    float exactCurves;
};
/// In the order in which help lists them; the first is the default.
std::span<const Reconstruction> reconstructions();
const Reconstruction& reconstructionOf(Mode mode);
/// The one after it, around.
Mode nextMode(Mode mode);
/// Null where there is none of that name.
const Reconstruction* reconstructionNamed(std::string_view name);

/// The passes of a frame, in order; a pass that the frame does not call for is not in the list.
std::vector<Pass> passesOf(Mode mode, const FrameContent& content);

}  // namespace stipple::render
