#include "engine/scene/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/base/file.h"

namespace stipple::scene {
namespace {

constexpr double kPi = 3.14159265358979323846;

template <typename T>
T catmullRom(const T& a, const T& b, const T& c, const T& d, double s) {
    return 0.5 * ((2.0 * b) + (c - a) * s + (2.0 * a - 5.0 * b + 4.0 * c - d) * (s * s) +
                  (3.0 * b - a - 3.0 * c + d) * (s * s * s));
}

Camera viewFrom(const glm::dvec3& lo, const glm::dvec3& hi, const glm::dvec3& up, double aspect, double azimuth) {
    Camera camera;
    const glm::dvec3 centre = 0.5 * (lo + hi), half = 0.5 * (hi - lo);
    camera.up = glm::normalize(up);
    // A frame in which `up` is the third axis; for an axis, the other two axes.
    int largest = 2;
    for (int i = 0; i < 2; ++i)
        if (std::abs(camera.up[i]) > std::abs(camera.up[largest])) largest = i;
    glm::dvec3 first(0);
    first[(largest + 1) % 3] = 1;
    first = glm::normalize(first - glm::dot(first, camera.up) * camera.up);
    const glm::dvec3 second = glm::cross(camera.up, first);
    const double elevation = 25 * kPi / 180;
    const glm::dvec3 direction = std::cos(elevation) * (std::cos(azimuth) * first + std::sin(azimuth) * second) +
                                 std::sin(elevation) * camera.up;
    // Far enough that all eight corners are inside the picture.
    const double tanV = std::tan(0.5 * camera.fovDegrees * kPi / 180) * 0.92, tanH = tanV * aspect;
    const glm::dvec3 forward = -direction, right = glm::normalize(glm::cross(forward, camera.up)),
                     down = glm::cross(forward, right);
    double distance = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 p(corner & 1 ? half.x : -half.x, corner & 2 ? half.y : -half.y, corner & 4 ? half.z : -half.z);
        const double depth = glm::dot(p, forward);
        distance = std::max(
            {distance, std::abs(glm::dot(p, right)) / tanH - depth, std::abs(glm::dot(p, down)) / tanV - depth});
    }
    if (!(distance > 0)) distance = 1;  // a single point
    camera.target = centre;
    camera.eye = centre + direction * distance;
    return camera;
}

}  // namespace

Camera CameraPath::at(double t) const {
    if (keys.size() == 1 || t <= keys.front().t) return keys.front().camera;
    if (t >= keys.back().t) return keys.back().camera;
    size_t i = 0;
    while (keys[i + 1].t <= t) ++i;
    const double s = (t - keys[i].t) / (keys[i + 1].t - keys[i].t);
    const Camera &a = keys[i > 0 ? i - 1 : 0].camera, &b = keys[i].camera, &c = keys[i + 1].camera,
                 &d = keys[std::min(i + 2, keys.size() - 1)].camera;
    Camera out;
    out.eye = catmullRom(a.eye, b.eye, c.eye, d.eye, s);
    out.target = catmullRom(a.target, b.target, c.target, d.target, s);
    out.up = catmullRom(a.up, b.up, c.up, d.up, s);
    out.fovDegrees = catmullRom(a.fovDegrees, b.fovDegrees, c.fovDegrees, d.fovDegrees, s);
    return out;
}

Camera fitCamera(const glm::dvec3& lo, const glm::dvec3& hi, const glm::dvec3& up, double aspect) {
    // y-up files face +z, which is a = z, b = x: 20 degrees off the front. z-up: from the south-west.
    return viewFrom(lo, hi, up, aspect, up.y > 0.9 ? 20 * kPi / 180 : 235 * kPi / 180);
}

CameraPath makeOrbit(const glm::dvec3& lo, const glm::dvec3& hi, const glm::dvec3& up, double aspect, int keys) {
    CameraPath path;
    for (int i = 0; i < keys; ++i)
        path.keys.push_back({double(i), viewFrom(lo, hi, up, aspect, (20.0 + 360.0 * i / keys) * kPi / 180)});
    return path;
}

lod::View makeView(const Camera& camera, uint32_t width, uint32_t height, double nearPlane) {
    lod::View view;
    view.eye = camera.eye;
    glm::dvec3 forward = camera.target - camera.eye;
    forward = glm::length(forward) > 0 ? glm::normalize(forward) : glm::dvec3(0, 0, -1);
    glm::dvec3 right = glm::cross(forward, camera.up);
    if (!(glm::length(right) > 1e-9))
        right = glm::cross(forward, std::abs(forward.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0));
    view.forward = forward;
    view.right = glm::normalize(right);
    view.down = glm::cross(view.forward, view.right);
    view.width = width;
    view.height = height;
    view.focalPixels = 0.5 * height / std::tan(0.5 * camera.fovDegrees * kPi / 180);
    view.nearPlane = nearPlane;
    return view;
}

Result<CameraPath> readCameraPath(const std::string& path) {
    STIPPLE_ASSIGN(const std::string text, readTextFile(path, uint64_t{64} << 20));
    CameraPath out;
    try {
        const nlohmann::json j = nlohmann::json::parse(text);
        out.fps = j.value("fps", 30.0);
        const auto vec = [](const nlohmann::json& v) {
            return glm::dvec3(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>());
        };
        for (const auto& k : j.at("keys")) {
            CameraKey key;
            key.t = k.at("t").get<double>();
            key.camera.eye = vec(k.at("eye"));
            key.camera.target = vec(k.at("target"));
            if (k.contains("up")) key.camera.up = vec(k.at("up"));
            key.camera.fovDegrees = k.value("fov", 50.0);
            if (!out.keys.empty() && !(key.t > out.keys.back().t))
                return fail(ErrorKind::input, fmt::format("key {} is not later than the one before", out.keys.size()),
                            path);
            out.keys.push_back(key);
        }
    } catch (const std::exception& e) {
        return fail(ErrorKind::input, fmt::format("is not a camera path: {}", e.what()), path,
                    R"(expected {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [x,y,z]}]})");
    }
    if (out.keys.empty() || !(out.fps > 0)) return fail(ErrorKind::input, "has no keys, or no frames per second", path);
    return out;
}

}  // namespace stipple::scene
