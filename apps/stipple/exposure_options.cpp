#include "apps/stipple/exposure_options.h"
#include "apps/stipple/options.h"

#include <fmt/format.h>

#include <algorithm>

namespace stipple::app {
namespace {

constexpr int kFramesOfExposure = 64;

}  // namespace

void ExposureOptions::addTo(CLI::App& sub) {
    sub.add_option("--accumulate", frames,
                   "each picture is the mean of N frames, which look through other places of its pixels: smooth edges, "
                   "and of curves narrower than a pixel their coverage (default: 1; with a lens or a shutter 64)")
        ->transform(within(1, 4096))
        ->type_name("N");
    auto* const lens = sub.add_option("--aperture", aperture,
                                      "diameter of a thin lens, world units: what is not at --focus is blurred")
                           ->transform(within(0.0, 1e15))
                           ->type_name("LENGTH");
    auto* const depth = sub.add_option("--focus", focus, "depth of the plane that is sharp, world units along the view")
                            ->transform(positive())
                            ->type_name("DEPTH");
    lens->needs(depth);
    depth->needs(lens);
    sub.add_option("--shutter", shutter,
                   "how long each picture is exposed, seconds of the camera path and of the wind, about its moment")
        ->transform(within(0.0, 1e6))
        ->type_name("SECONDS");
    sub.add_option(
           "--fade", fade,
           "of pictures that are means: levels of detail fade into each other while the allowed error falls from "
           "--error by so many octaves from frame to frame, so that nothing pops along a path; 0: all frames "
           "have one level")
        ->transform(within(0.0, 4.0))
        ->type_name("OCTAVES")
        ->capture_default_str();
}

Result<void> ExposureOptions::check(const CameraOptions& camera, bool isWindy) const {
    if (isOpened() && frames == 1)
        return fail(ErrorKind::usage, "one frame is sharp", "--accumulate 1", "leave it out, or take 64");
    if (aperture > 0 && camera.ortho > 0)
        return fail(ErrorKind::usage, "an orthographic camera has no lens", "--aperture", "leave out --ortho");
    if (shutter > 0 && camera.path.empty() && camera.orbit == 0 && !isWindy)
        return fail(ErrorKind::usage, "nothing moves while it is open", "--shutter",
                    "give --camera-path, --orbit or --wind");
    return {};
}

int ExposureOptions::samples() const { return frames > 0 ? frames : isOpened() ? kFramesOfExposure : 1; }

Result<render::Exposure> ExposureOptions::exposure(const Shot& shot) const {
    if (aperture > 0 &&
        std::any_of(shot.views.begin(), shot.views.end(), [](const lod::View& v) { return v.isOrthographic; }))
        return fail(ErrorKind::usage, "an orthographic camera has no lens", "--aperture",
                    "take another camera, or leave it out");
    return render::Exposure{static_cast<uint32_t>(samples()), {aperture, focus}, shutter, fade};
}

}  // namespace stipple::app
