#include "apps/stipple/camera_options.h"
#include "apps/stipple/options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stipple::app {

void CameraOptions::addTo(CLI::App& app) {
    auto* const eyeOption =
        app.add_option("--eye", eye, "camera position in file coordinates (default: fits the scene)")
            ->type_name("X,Y,Z");
    auto* const targetOption =
        app.add_option("--target", target, "point that the camera looks at, file coordinates")->type_name("X,Y,Z");
    auto* const upOption =
        app.add_option("--camera-up", cameraUp, "direction that is up in the picture, file coordinates")
            ->type_name("X,Y,Z");
    auto* const fovOption = app.add_option("--fov", fov, "vertical field of view, degrees")
                                ->transform(within(0.1, 170.0))
                                ->capture_default_str();
    auto* const orthoOption =
        app.add_option("--ortho", ortho,
                       "orthographic: parallel rays, and so much of the world, in its units, across the picture")
            ->type_name("WIDTH")
            ->transform(within(1e-12, 1e15));
    auto* const sceneOption =
        app.add_option("--scene-camera", sceneCamera, "the N-th camera of a .gltf scene (0: a view of the whole)")
            ->transform(within(0, 100000));
    auto* const pathOption =
        app.add_option("--camera-path", path,
                       "JSON file with keys {t, eye, target, up, fov or ortho}; one picture per frame")
            ->type_name("FILE");
    auto* const orbitOption =
        app.add_option("--orbit", orbit, "N pictures around the scene")->transform(within(1, 100000));
    // Each of these says where the camera stands: what another one says would be lost without a word.
    for (auto* const place : {eyeOption, targetOption, upOption})
        place->excludes(sceneOption)->excludes(pathOption)->excludes(orbitOption);
    fovOption->excludes(sceneOption)->excludes(pathOption);
    orthoOption->excludes(sceneOption)->excludes(fovOption)->excludes(pathOption);
    sceneOption->excludes(pathOption)->excludes(orbitOption);
    pathOption->excludes(orbitOption);
}

namespace {

bool isPlace(const std::string& text) { return !text.empty(); }

/// A camera that looks somewhere, or what is wrong.
Result<void> checkDirection(const scene::Camera& camera, const CameraOptions& o) {
    const double distance = glm::length(camera.target - camera.eye);
    const std::string where = !isPlace(o.eye)      ? "--target " + o.target
                              : !isPlace(o.target) ? "--eye " + o.eye
                                                   : fmt::format("--eye {} --target {}", o.eye, o.target);
    if (distance == 0)
        return fail(ErrorKind::usage, "the camera stands at the point that it looks at", where,
                    "move --eye or --target");
    if (!std::isfinite(distance)) return fail(ErrorKind::usage, "is too far away to be computed with", where);
    return {};
}

}  // namespace

Result<void> CameraOptions::check() const {
    scene::Camera camera;
    for (const auto& [text, option, to] :
         {std::tuple{eye, "--eye", &camera.eye}, std::tuple{target, "--target", &camera.target},
          std::tuple{cameraUp, "--camera-up", &camera.up}})
        if (isPlace(text)) {
            STIPPLE_ASSIGN(*to, parseVector(text, option));
        }
    if (isPlace(eye) && isPlace(target)) STIPPLE_TRY(checkDirection(camera, *this));
    const double length = glm::length(camera.up);
    if (!(length > 0) || !std::isfinite(length))
        return fail(ErrorKind::usage, "is no direction", "--camera-up " + cameraUp, "e.g. 0,0,1");
    return {};
}

Result<scene::Camera> makeCamera(const CameraOptions& o, const OpenedScene& opened, double aspect) {
    const lod::StoreDescription& d = opened.description;
    if (o.sceneCamera > 0) {
        const auto index = static_cast<size_t>(o.sceneCamera);
        if (index > opened.cameras.size())
            return fail(ErrorKind::usage, fmt::format("the scene has that many cameras: {}", opened.cameras.size()),
                        fmt::format("--scene-camera {}", o.sceneCamera));
        return opened.cameras[index - 1];
    }
    scene::Camera camera = scene::fitCamera(opened.outline, d.up, aspect, o.fov);
    if (isPlace(o.eye)) {
        STIPPLE_ASSIGN(camera.eye, parseVector(o.eye, "--eye"));
    }
    if (isPlace(o.target)) {
        STIPPLE_ASSIGN(camera.target, parseVector(o.target, "--target"));
    }
    if (isPlace(o.cameraUp)) {
        STIPPLE_ASSIGN(camera.up, parseVector(o.cameraUp, "--camera-up"));
    }
    STIPPLE_TRY(checkDirection(camera, o));
    if (!(o.ortho > 0)) return camera;
    camera.orthoWidth = o.ortho;
    if (isPlace(o.eye)) return camera;
    // Nobody said from how far away: from before all of it. The target stays in the middle of the picture if it is
    // given.
    const scene::Camera fitted = scene::fitOrthographic(camera, opened.outline, o.ortho);
    if (!isPlace(o.target)) return fitted;
    const glm::dvec3 forward = glm::normalize(camera.target - camera.eye);
    const double back =
        std::max(glm::dot(camera.target - fitted.eye, forward), glm::length(fitted.target - fitted.eye));
    camera.eye = camera.target - back * forward;
    return camera;
}

Result<std::optional<scene::CameraPath>> makePath(const CameraOptions& o, const OpenedScene& opened, double aspect) {
    const lod::StoreDescription& d = opened.description;
    if (!o.path.empty()) {
        STIPPLE_ASSIGN(scene::CameraPath path, scene::readCameraPath(o.path, d.up));
        return std::optional(std::move(path));  // what its keys say of their widths holds
    }
    if (o.orbit > 0) {
        scene::CameraPath path = scene::makeOrbit(opened.outline, d.up, aspect, o.orbit, o.fov);
        if (o.ortho > 0)
            for (scene::CameraKey& key : path.keys)
                key.camera.orthoWidth = o.ortho;  // its eyes stand before all of the scene
        return std::optional(std::move(path));
    }
    return std::optional<scene::CameraPath>();
}

namespace {

/// The far plane of an orthographic camera cuts nothing off.
std::string beyondFarPlane(const scene::Camera& camera, int number, std::span<const glm::dvec3> outline) {
    const glm::dvec3 forward = glm::normalize(camera.target - camera.eye);
    double farthest = 0;
    for (const glm::dvec3& p : outline) farthest = std::max(farthest, glm::dot(p - camera.eye, forward));
    if (!(camera.orthoFar > 0) || farthest <= camera.orthoFar) return "";
    return fmt::format("--scene-camera {}: what lies beyond its far plane ({:g} units away) is drawn all the same",
                       number, camera.orthoFar);
}

}  // namespace

lod::View Shot::viewAfter(size_t index, double later) const {
    const lod::View& view = views[index];
    if (!path || later == 0) return view;
    return scene::makeView(path->at(path->keys.front().t + seconds[index] + later), view.width, view.height,
                           view.nearPlane);
}

Result<Shot> makeShot(const CameraOptions& o, int frames, const OpenedScene& opened, const glm::uvec2& size) {
    Shot shot;
    shot.worldUp = opened.description.up;
    const double aspect = static_cast<double>(size.x) / size.y, nearPlane = scene::nearPlaneOf(opened);
    STIPPLE_ASSIGN(shot.path, makePath(o, opened, aspect));
    const std::optional<scene::CameraPath>& path = shot.path;
    if (!path) {
        STIPPLE_ASSIGN(const scene::Camera camera, makeCamera(o, opened, aspect));
        shot.views.push_back(scene::makeView(camera, size.x, size.y, nearPlane));
        shot.note = beyondFarPlane(camera, o.sceneCamera, opened.outline);
        return shot;
    }
    if (o.orbit > 0)
        frames = o.orbit;
    else if (frames <= 1)
        frames = std::max(1, static_cast<int>(std::lround(path->duration() * path->fps)) + 1);
    for (int i = 0; i < frames; ++i) {
        const double t = path->keys.front().t + (frames > 1 ? path->duration() * i / (frames - 1) : 0);
        shot.views.push_back(scene::makeView(path->at(t), size.x, size.y, nearPlane));
        shot.seconds.push_back(t - path->keys.front().t);
    }
    return shot;
}

void addUpOption(CLI::App& app, std::string& up) {
    const CLI::Validator isAxis(
        [](std::string& text) {
            if (text == "x" || text == "y" || text == "z") return std::string();
            if (text.find(',') != std::string::npos)
                return fmt::format(
                    "'{}' is a direction: --up is the scene's axis (x, y or z), --camera-up the camera's", text);
            return fmt::format("'{}' is not x, y or z", text);
        },
        "x|y|z");
    app.add_option("--up", up, "the scene's up axis, instead of the format's own (LAS: z, PLY and glTF: y)")
        ->check(isAxis);
}

}  // namespace stipple::app
