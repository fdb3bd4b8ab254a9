#include "engine/api/convert.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <memory>

#include "engine/base/isolated.h"
#include "engine/base/one_at_a_time.h"

namespace stipple::v1 {

Camera given(const scene::Camera& camera) {
    return {given(camera.eye), given(camera.target), given(camera.up), camera.fovDegrees, camera.orthoWidth};
}

::stipple::Result<scene::Camera> taken(const Camera& camera) {
    scene::Camera out;
    out.eye = taken(camera.eye);
    out.target = taken(camera.target);
    out.up = taken(camera.up);
    out.fovDegrees = camera.fovDegrees;
    out.orthoWidth = camera.orthoWidth;
    const auto refuse = [](const char* what) { return fail(::stipple::ErrorKind::usage, what, "camera"); };
    const glm::dvec3 forward = out.target - out.eye;
    const double length = glm::length(forward), upLength = glm::length(out.up);
    if (!std::isfinite(glm::length(out.eye)) || !(length > 0) || !std::isfinite(length))
        return refuse("looks nowhere: eye and target must differ and be finite");
    if (!(upLength > 0) || !std::isfinite(upLength) ||
        !(glm::length(glm::cross(forward / length, out.up / upLength)) > 1e-12))
        return refuse("has an up that is no direction, or along the view");
    if (!(camera.orthoWidth >= 0) || !std::isfinite(camera.orthoWidth)) return refuse("shows no finite width");
    if (camera.orthoWidth == 0 && !(camera.fovDegrees > 0 && camera.fovDegrees < 180))
        return refuse("has a field of view that is not between 0 and 180 degrees");
    return out;
}

scene::OpenSettings openSettings(uint64_t memoryBytes, unsigned threads, uint64_t surfels, const Listener& listener) {
    scene::OpenSettings settings;
    settings.memory = fmt::format("{}", memoryBytes);
    settings.threads = static_cast<int>(threads);
    settings.surfels = surfels;
    const auto turns = std::make_shared<OneAtATime>();
    const auto calls = [turns](const auto& call) { (*turns)([&] { isolated(call); }); };
    if (listener.note)
        settings.say =
            settings.loss = [calls, call = listener.note](const std::string& line) { calls([&] { call(line); }); };
    if (listener.progress)
        settings.onProgress = [calls, call = listener.progress](const ProgressReport& r) {
            calls([&] { call({r.stage, r.fraction, r.secondsLeft}); });
        };
    const auto isOver = std::make_shared<std::atomic<bool>>(false);
    settings.isStopped = [calls, isOver, call = listener.isStopped] {
        if (call && !*isOver)
            calls([&] {
                if (!*isOver && call()) *isOver = true;
            });
        return isOver->load();
    };
    return settings;
}

}  // namespace stipple::v1
