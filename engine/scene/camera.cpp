#include "engine/scene/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/base/file.h"

namespace stipple::scene {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kLeastFov = 0.001, kGreatestFov = 179;

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
    // (The curve swings out beyond its keys.)
    out.fovDegrees =
        std::clamp(catmullRom(a.fovDegrees, b.fovDegrees, c.fovDegrees, d.fovDegrees, s), kLeastFov, kGreatestFov);
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

namespace {

using json = nlohmann::json;

/// Beyond this coordinates of a camera have no use, and squares of them no room.
constexpr double kFarthest = 1e15;

/// The checks of one key; `where` names it.
class KeyReader {
  public:
    KeyReader(const json& key, std::string path, std::string where)
        : key_(key), path_(std::move(path)), where_(std::move(where)) {}

    Result<double> number(const char* name, double least, double greatest) const {
        const auto found = key_.find(name);
        if (found == key_.end() || !found->is_number()) return bad(name, "is not a number");
        const auto value = found->get<double>();
        if (!(value >= least && value <= greatest))
            return bad(name, fmt::format("is {}, must be between {} and {}", value, least, greatest));
        return value;
    }
    Result<glm::dvec3> vector(const char* name) const {
        const auto found = key_.find(name);
        if (found == key_.end() || !found->is_array() || found->size() != 3) return bad(name, "is not three numbers");
        glm::dvec3 v(0);
        for (size_t i = 0; i < 3; ++i) {
            if (!(*found)[i].is_number()) return bad(name, "is not three numbers");
            v[static_cast<int>(i)] = (*found)[i].get<double>();
            if (!(std::abs(v[static_cast<int>(i)]) <= kFarthest))
                return bad(name, fmt::format("holds {}, which is too far away", (*found)[i].dump()));
        }
        return v;
    }
    bool has(const char* name) const { return key_.contains(name); }
    tl::unexpected<Error> bad(const char* name, const std::string& what) const {
        return fail(ErrorKind::input, fmt::format("{}: '{}' {}", where_, name, what), path_,
                    R"(expected {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [x,y,z]}]})");
    }

  private:
    const json& key_;
    std::string path_, where_;
};

Result<CameraKey> readKey(const KeyReader& from) {
    CameraKey key;
    STIPPLE_ASSIGN(key.t, from.number("t", -1e9, 1e9));
    STIPPLE_ASSIGN(key.camera.eye, from.vector("eye"));
    STIPPLE_ASSIGN(key.camera.target, from.vector("target"));
    if (key.camera.eye == key.camera.target) return from.bad("target", "is where the eye is");
    if (from.has("up")) {
        STIPPLE_ASSIGN(key.camera.up, from.vector("up"));
        if (!(glm::length(key.camera.up) > 0)) return from.bad("up", "has no length");
    }
    if (from.has("fov")) {
        STIPPLE_ASSIGN(key.camera.fovDegrees, from.number("fov", kLeastFov, kGreatestFov));
    }
    return key;
}

}  // namespace

Result<CameraPath> readCameraPath(const std::string& path) {
    STIPPLE_ASSIGN(const std::string text, readTextFile(path, uint64_t{64} << 20));
    const json j = json::parse(text, nullptr, false);
    static const json none = json::array();
    if (!j.is_object())
        return fail(ErrorKind::input, "is not a camera path: no JSON object, or one with a number that is too large",
                    path, R"(expected {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [x,y,z]}]})");
    CameraPath out;
    const KeyReader whole(j, path, "the path");
    constexpr double kLeastRate = 1e-6, kGreatestRate = 10'000, kMostFrames = 10'000'000;
    if (whole.has("fps")) {
        STIPPLE_ASSIGN(out.fps, whole.number("fps", kLeastRate, kGreatestRate));
    }
    const json& keys = j.contains("keys") && j["keys"].is_array() ? j["keys"] : none;
    if (keys.empty()) return whole.bad("keys", "holds no key");
    for (const json& k : keys) {
        STIPPLE_ASSIGN(const CameraKey key, readKey(KeyReader(k, path, fmt::format("key {}", out.keys.size()))));
        if (!out.keys.empty() && !(key.t > out.keys.back().t))
            return fail(ErrorKind::input, fmt::format("key {} is not later than the one before", out.keys.size()),
                        path);
        out.keys.push_back(key);
    }
    if (out.duration() * out.fps > kMostFrames)
        return fail(
            ErrorKind::input,
            fmt::format("asks for {:.0f} frames, at most {:.0f} are made", out.duration() * out.fps, kMostFrames), path,
            "give a smaller 'fps', or keys that are closer in time");
    return out;
}

}  // namespace stipple::scene
