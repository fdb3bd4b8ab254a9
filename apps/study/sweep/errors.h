// What is wrong with the frame of a cell, the three errors apart: level of detail (distances from the full detail; the
// same mode's leaves), implementation (the backend against the fp64 restatement of the same cut, at a small size),
// reconstruction (against the traced full detail).
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <optional>

#include "apps/study/audit/audit.h"
#include "apps/study/sweep/plan.h"
#include "apps/study/sweep/scene_drawer.h"

namespace stipple::study {

/// nan: not measured. All are numbers, so that a table of them is a table.
struct CellErrors {
    static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    // The frame:
    double stated = kNone;  ///< px, that the frame says it keeps
    double records = kNone, triangles = kNone, nodes = kNone;
    double bytes = kNone;  ///< of chunks in the file, that the frame needs
    // Level of detail:
    double lodMedian = kNone, lodP99 = kNone, lodMost = kNone;  ///< px, of drawn pixels from the full detail
    double audited = kNone, beyond = kNone;  ///< pixels with a place; those beyond what is stated and half a pixel, and
    double outline = kNone, gap = kNone, between = kNone, other = kNone;  ///< ... of what class (audit.h)
    double lodDecibels = kNone;                                           ///< against the same mode's leaves
    // Implementation, of the first camera of a path:
    double backendDecibels = kNone, backendDiffering = kNone;  ///< dB; share of pixels more than 4 of 255 off
    // Against the traced full detail:
    double psnr = kNone, psnrForeground = kNone;  ///< dB
    double leavesDecibels = kNone;                ///< foreground, of the mode's leaves: its reconstruction alone
    double ssim = kNone, flipMean = kNone, flipP95 = kNone;
    double overlap = kNone, boundary = kNone;  ///< IoU; px
    double holes = kNone, spill = kNone;       ///< pixels
    double depthRmse = kNone, depthP99 = kNone;
    double normalMean = kNone, normalP95 = kNone;  ///< degrees
    // A switch of levels (popOf): of 255
    double popP999 = kNone, popMost = kNone;
    double popFaded = kNone;  ///< as popP999, of means of kFadeFrames frames over which levels fade, at the small size
    // The camera turned by a quarter of a pixel (flickerOf): of 255
    double flickerMean = kNone, flickerP99 = kNone;
    // Shadows of the first light that casts, of the first camera of a path at one target (audit/shadows.h): pixels that
    // it falls on, of those the shadowed and the wrong ones, and those beyond what is stated of borders; px
    double shadowPixels = kNone, shadowDark = kNone, shadowWrong = kNone, shadowBeyond = kNone, shadowMost = kNone,
           shadowStated = kNone;
};
struct ErrorColumn {
    const char* name;  ///< as in CSV and JSON
    double CellErrors::*value;
};
std::span<const ErrorColumn> errorColumns();

/// By how much pixels change where the cut does and the camera does not: between the frame of a target and that of a
/// target larger by kPopStep, which is the cut of a camera as much farther away. The greatest change of a channel.
inline constexpr double kPopStep = 1.0906;   ///< an eighth of an octave: the next of the cuts that there are (lod/cut)
inline constexpr uint32_t kFadeFrames = 16;  ///< of pictures whose levels fade (render::Exposure::fade)
struct Pop {
    double p999 = 0, most = 0;  ///< of 255; over pixels that either covers
};
Pop popOf(const render::Image& frame, const render::Image& next);

/// By how much more a small motion of the camera changes pixels than it changes the truth: of each pixel the greatest
/// of the channels' |(moved - frame) - (tracedMoved - traced)| (ALGORITHMS 4). Of 255; over pixels that any of them
/// covers.
struct Flicker {
    double mean = 0, p99 = 0;
};
inline constexpr double kFlickerPixels = 0.25;
lod::View turnedBy(const lod::View& view, double pixels);  ///< to the right
Flicker flickerOf(const render::Image& frame, const render::Image& moved, const render::Image& traced,
                  const render::Image& tracedMoved);

/// What rays say of a light's shadows; `open`: without them.
struct LightTruth {
    size_t light = 0;  ///< of DrawSettings::lights
    render::Image open;
    std::vector<double> shares;
};
/// What all cells of one view share. `moved`: turned by kFlickerPixels.
struct ViewTruth {
    render::Image traced, tracedMoved;
    lod::View view, small, moved;
    std::optional<LightTruth> light;  ///< nothing: shadows are not looked at
};

/// A worst place, enlarged: ours, traced, and what is seen of the difference (FLIP).
using KeepCrop = std::function<Result<void>(const render::Image& crop)>;

struct CellTools {
    SceneDrawer& drawer;
    SceneDrawer* oracle;     ///< fp64; null: this view is not compared with it
    const FullDetail* full;  ///< null: not measured
    Executor& executor;
    const ViewTruth& truth;
};

/// `leaves`: of the mode, from the same view.
Result<CellErrors> measureCell(const CellTools& tools, const Cell& cell, const render::Image& leaves,
                               const KeepCrop& keepCrop);

}  // namespace stipple::study
