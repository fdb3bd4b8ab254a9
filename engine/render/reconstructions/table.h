// The reconstructions: how the records of a frame become one surface a pixel. A new one is a row of this table, its
// passes, and an entry in each backend's table of passes.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "engine/render/passes.h"

namespace stipple::render {

enum class Mode : uint8_t { surface, pullpush, pullpushExact, points, splat, ewa };

struct Reconstruction {
    Mode mode;
    const char* name;     ///< as --mode and JSON have it
    const char* summary;  ///< for help
    bool hasPyramid;      ///< gaps between splats are closed by pull and push
    bool closesGaps;      ///< surfaces have no gaps between their records
    bool fillsSplats;     ///< every pixel that a disc covers is its own
    bool blendsSplats;    ///< of such: what lies on one surface is blended, silhouettes have coverage
    bool smoothsSplats;   ///< such as are wide have colours and normals of a pyramid of their own
    Pass points;          ///< what draws points into the visibility buffer
    bool pointsAreLast;   ///< ... after all other kinds: its tiles are nobody else's meanwhile
    /// From which half-width on, px, curves have exact pixels at the latest (DrawSettings::exactCurves may ask for
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

}  // namespace stipple::render
