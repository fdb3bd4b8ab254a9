// Accumulation: a picture that is the mean of frames, each of which looks through another place of the pixels, and, if
// asked for, of the lens and of the exposure (Haeberli & Akeley 1990, The Accumulation Buffer). It is the one
// anti-aliasing of all kinds and modes, depth of field and motion blur; without it a frame is a frame, bit by bit.
#pragma once

#include <functional>

#include "engine/render/frame.h"
#include "engine/render/sampling.h"

namespace stipple::render {

/// The mean of pictures of one size, of what can be shown of each: channels from 0 to 1, linear. With `linear`.
class Accumulation {
  public:
    void add(const Image& image, Executor& executor);
    /// Sets `rgba` and `linear` of `out`, whatever else it holds; at least one picture was added.
    void mean(Image& out, Executor& executor) const;
    void clear() { count_ = 0; }
    uint32_t count() const { return count_; }

  private:
    std::vector<float> sum_;  ///< r g b coverage per pixel
    uint32_t width_ = 0, height_ = 0, count_ = 0;
};

/// What films and stills of several frames fade over unless they say otherwise.
inline constexpr double kFadeOctaves = 0.5;

struct Exposure {
    uint32_t samples = 1;  ///< frames
    Lens lens;
    double shutter = 0;  ///< how long it is open, seconds of the camera path and of the wind
    /// Octaves over which levels of detail fade: the allowed errors of the frames go down so far from what is asked
    /// for. A record counts as often as it is drawn, which is T(error of its parent) - T(its own), with T the share of
    /// frames that do not allow an error: along each chain of records that is one in all.
    double fade = 0;
    bool isPlain() const { return samples <= 1; }
};

/// What the camera sees so many seconds after the picture's own moment.
using ViewAfter = std::function<lod::View(double seconds)>;
/// Draws a frame into the state's image.
using DrawFrame = std::function<Result<void>(const lod::View& view, const FrameSettings& settings)>;

/// The settings and the view of one frame of an exposure about the moment of `settings`.
FrameSettings settingsOf(const FrameSettings& settings, uint32_t index, const Exposure& exposure);
lod::View viewOf(const ViewAfter& after, uint32_t index, const Exposure& exposure);

/// Draws the samples of an exposure. `image` holds the frame of its middle: depths and normals stay that one's.
Result<void> expose(const Exposure& exposure, const ViewAfter& after, const FrameSettings& settings,
                    const DrawFrame& draw, Image& image, Executor& executor);

}  // namespace stipple::render
