// How long and through what a picture is exposed: the frames whose mean it is.
#pragma once

#include "apps/stipple/camera_options.h"
#include "engine/render/accumulation.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

struct ExposureOptions {
    int frames = 0;  ///< 0: what the rest asks for
    double aperture = 0, focus = 0, shutter = 0;
    double fade = render::kFadeOctaves;
    void addTo(CLI::App& sub);
    /// What can be said before anything is opened. `isWindy`: something moves though the camera may not.
    Result<void> check(const CameraOptions& camera, bool isWindy) const;
    /// Lenses are of perspective views.
    Result<render::Exposure> exposure(const Shot& shot) const;
    /// Frames whose mean a picture is.
    int samples() const;
    bool isPlain() const { return samples() <= 1; }
    bool isOpened() const { return aperture > 0 || shutter > 0; }
};

}  // namespace stipple::app
