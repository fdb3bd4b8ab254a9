// Tone on a picture that is whole: of frames that are put together of several (layered_frame.h), and where the exposure
// is metered, which nobody knows before all of it is there. Elsewhere it is part of the pass that makes the picture
// (effects/tone.cpp).
#pragma once

#include "engine/render/backdrop.h"
#include "engine/render/backend.h"
#include "engine/render/draw_list.h"

namespace stipple::render {

/// Does the frame ask for a metered exposure?
bool isMetered(const DrawSettings& settings);

/// Takes the request out of `settings`; was there one that changes anything?
bool takeTone(DrawSettings& settings);

/// The factor that takes what is covered of a picture to middle grey (0.18) in the mean of the logarithms of its
/// luminance, between 2^-20 and 2^20; 1 where nothing is covered. Luminance below 2^-20 counts as so much.
/// `behind`: part of pixels that are covered in part.
double meteredExposure(const Image& image, const Behind& behind);

/// Tone as `settings` ask for it, on what of the picture is covered, and on an environment's picture behind it; the
/// picture has its linear colours. `view`: what it shows.
void toneImage(const DrawSettings& settings, const lod::View& view, Image& image, Executor& executor);

}  // namespace stipple::render
