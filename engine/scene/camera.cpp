#include "engine/scene/camera.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/base/file.h"
#include "engine/base/numbers.h"
#include "engine/base/text.h"
#include "engine/base/words.h"

namespace stipple::scene {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kLeastFov = 0.001, kGreatestFov = 179;
constexpr double kLeastOrtho = 1e-12, kGreatestOrtho = 1e15;  // world units

template <typename T>
T catmullRom(const T& a, const T& b, const T& c, const T& d, double s) {
    return 0.5 * ((2.0 * b) + (c - a) * s + (2.0 * a - 5.0 * b + 4.0 * c - d) * (s * s) +
                  (3.0 * b - a - 3.0 * c + d) * (s * s * s));
}

/// Two directions across `up`; for an axis, the other two axes.
std::pair<glm::dvec3, glm::dvec3> across(const glm::dvec3& up) {
    int largest = 2;
    for (int i = 0; i < 2; ++i)
        if (std::abs(up[i]) > std::abs(up[largest])) largest = i;
    glm::dvec3 first(0);
    first[(largest + 1) % 3] = 1;
    first = glm::normalize(first - glm::dot(first, up) * up);
    return {first, glm::cross(up, first)};
}

/// The size along across(up) and up.
glm::dvec3 sizeOf(std::span<const glm::dvec3> points, const glm::dvec3& up) {
    const auto [first, second] = across(up);
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : points) {
        const glm::dvec3 q(glm::dot(p, first), glm::dot(p, second), glm::dot(p, up));
        lo = glm::min(lo, q);
        hi = glm::max(hi, q);
    }
    return hi - lo;
}

/// From how high above the horizon: 25 degrees for what is as tall as wide, up to 50 for what is flat.
double elevationFor(std::span<const glm::dvec3> points, const glm::dvec3& up) {
    const glm::dvec3 size = sizeOf(points, up);
    const double wide = std::sqrt(std::max(size.x, 1e-300)) * std::sqrt(std::max(size.y, 1e-300));
    const double flatness = std::clamp(1 - 2 * size.z / wide, 0.0, 1.0);
    return (25 + 25 * flatness) * kPi / 180;
}

/// From where around: y-up files face +z, which is the first axis across, so from 20 degrees off the front; z-up: from
/// the south-west. What is long is seen from its side.
double azimuthFor(std::span<const glm::dvec3> points, const glm::dvec3& up) {
    constexpr double kLong = 2;
    const glm::dvec3 size = sizeOf(points, up);
    const bool isFront = up.y > 0.9;
    double degrees = isFront ? 20 : 235;
    if (size.x > kLong * size.y) degrees = isFront ? 70 : 250;
    if (size.y > kLong * size.x) degrees = isFront ? 20 : 200;
    return degrees * kPi / 180;
}

/// Points in the axes of a picture, from a middle.
struct Projected {
    std::vector<glm::dvec3> points;  ///< right, down, forward
    double tanX, tanY;               ///< of the part of the half field of view that may be filled

    /// The nearest distance of the eye from the middle at which an axis' extent fits, wherever the eye is moved to
    /// along that axis. A point (p, z) is seen inside iff |p - shift| <= t (z + distance): over all pairs of points
    /// that leaves room for a shift iff max(p - t z) - min(p + t z) <= 2 t distance.
    double nearest(int axis, double t) const {
        double most = -1e300, least = 1e300;
        for (const glm::dvec3& p : points) {
            most = std::max(most, p[axis] - t * p.z);
            least = std::min(least, p[axis] + t * p.z);
        }
        return (most - least) / (2 * t);
    }
    /// The nearest distance with the eye straight before the middle.
    double nearestStraight() const {
        double distance = 0;
        for (const glm::dvec3& p : points)
            distance = std::max({distance, std::abs(p.x) / tanX - p.z, std::abs(p.y) / tanY - p.z});
        return distance;
    }
    /// The shift along an axis that puts the projection into the middle of the picture.
    double centred(int axis, double distance) const {
        double lo = 1e300, hi = -1e300;
        for (const glm::dvec3& p : points) {
            lo = std::min(lo, p[axis]);
            hi = std::max(hi, p[axis]);
        }
        for (int i = 0; i < 60; ++i) {  // the sum falls as the shift grows
            const double middle = 0.5 * (lo + hi);
            double most = -1e300, least = 1e300;
            for (const glm::dvec3& p : points) {
                const double at = (p[axis] - middle) / (p.z + distance);
                most = std::max(most, at);
                least = std::min(least, at);
            }
            (most + least > 0 ? lo : hi) = middle;
        }
        return 0.5 * (lo + hi);
    }
};

/// What is seen along `forward`, from a middle that is given.
Projected project(std::span<const glm::dvec3> points, const glm::dvec3& middle, const Camera& axes,
                  const glm::dvec3& forward, double aspect) {
    const glm::dvec3 right = glm::normalize(glm::cross(forward, axes.up)), down = glm::cross(forward, right);
    Projected out;
    out.tanY = std::tan(0.5 * axes.fovDegrees * kPi / 180) * kFitShare;
    out.tanX = out.tanY * aspect;
    out.points.reserve(points.size());
    for (const glm::dvec3& p : points) {
        const glm::dvec3 from = p - middle;
        out.points.emplace_back(glm::dot(from, right), glm::dot(from, down), glm::dot(from, forward));
    }
    return out;
}

glm::dvec3 middleOf(std::span<const glm::dvec3> points) {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : points) {
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    return lo + 0.5 * (hi - lo);
}

/// Towards the eye.
glm::dvec3 directionFrom(const glm::dvec3& up, double elevation, double azimuth) {
    const auto [first, second] = across(up);
    return std::cos(elevation) * (std::cos(azimuth) * first + std::sin(azimuth) * second) + std::sin(elevation) * up;
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
    const bool isOrthographic = b.orthoWidth > 0;
    if (isOrthographic)
        out.orthoWidth = std::clamp(catmullRom(a.orthoWidth, b.orthoWidth, c.orthoWidth, d.orthoWidth, s),
                                    std::min(b.orthoWidth, c.orthoWidth), std::max(b.orthoWidth, c.orthoWidth));
    return out;
}

std::array<glm::dvec3, 8> cornersOf(const glm::dvec3& lo, const glm::dvec3& hi) {
    std::array<glm::dvec3, 8> corners;
    for (size_t i = 0; i < 8; ++i)
        corners.at(i) = {(i & 1) != 0 ? hi.x : lo.x, (i & 2) != 0 ? hi.y : lo.y, (i & 4) != 0 ? hi.z : lo.z};
    return corners;
}

Camera fitCamera(std::span<const glm::dvec3> points, const glm::dvec3& up, double aspect, double fovDegrees) {
    Camera camera;
    camera.up = glm::normalize(up);
    camera.fovDegrees = fovDegrees;
    const glm::dvec3 middle = middleOf(points);
    const glm::dvec3 forward =
        -directionFrom(camera.up, elevationFor(points, camera.up), azimuthFor(points, camera.up));
    const Projected seen = project(points, middle, camera, forward, aspect);
    double distance = std::max(seen.nearest(0, seen.tanX), seen.nearest(1, seen.tanY));
    // A long thing in a very wide picture: not from its end itself.
    const auto byDepth = [](const glm::dvec3& a, const glm::dvec3& b) { return a.z < b.z; };
    const auto [front, back] = std::minmax_element(seen.points.begin(), seen.points.end(), byDepth);
    distance = std::max(distance, 0.02 * (back->z - front->z) - front->z);
    if (!(distance > 0) || !std::isfinite(distance)) {  // a single point
        camera.target = middle;
        camera.eye = middle - forward;
        return camera;
    }
    const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.up)), down = glm::cross(forward, right);
    camera.target = middle + right * seen.centred(0, distance) + down * seen.centred(1, distance);
    camera.eye = camera.target - forward * distance;
    return camera;
}

Camera fitOrthographic(const Camera& perspective, std::span<const glm::dvec3> points, double width) {
    Camera camera = perspective;
    const glm::dvec3 forward = glm::normalize(camera.target - camera.eye), middle = middleOf(points);
    const Projected seen = project(points, middle, camera, forward, 1);
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : seen.points) {
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.up)), down = glm::cross(forward, right);
    camera.target = middle + 0.5 * (lo.x + hi.x) * right + 0.5 * (lo.y + hi.y) * down;
    // Half the size before it all: splats and what wind moves reach beyond the points.
    const double size = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z, width});
    camera.eye = camera.target + (lo.z - 0.5 * size) * forward;
    camera.orthoWidth = width;
    return camera;
}

Camera fitCamera(const glm::dvec3& lo, const glm::dvec3& hi, const glm::dvec3& up, double aspect, double fovDegrees) {
    return fitCamera(cornersOf(lo, hi), up, aspect, fovDegrees);
}

CameraPath makeOrbit(std::span<const glm::dvec3> points, const glm::dvec3& up, double aspect, int keys,
                     double fovDegrees) {
    Camera camera;
    camera.up = glm::normalize(up);
    camera.fovDegrees = fovDegrees;
    const glm::dvec3 middle = middleOf(points);
    const double elevation = elevationFor(points, camera.up);
    std::vector<glm::dvec3> directions;
    directions.reserve(static_cast<size_t>(std::max(keys, 0)));
    for (int i = 0; i < keys; ++i)
        directions.push_back(directionFrom(camera.up, elevation, (20.0 + 360.0 * i / keys) * kPi / 180));
    const auto distanceAt = [&](const glm::dvec3& target, size_t stride) {
        double distance = 0;
        for (size_t i = 0; i < directions.size(); i += stride)
            distance = std::max(distance, project(points, target, camera, -directions[i], aspect).nearestStraight());
        return distance;
    };
    // Looked down upon, the near edge takes more room than the far one: a lower target needs less distance.
    constexpr size_t kTried = 32;
    double low = -0.5, high = 0.5;
    const glm::dvec3 size = sizeOf(points, camera.up);
    const double reach = std::max({size.x, size.y, size.z});
    for (int i = 0; i < 24; ++i) {
        const double a = low + (high - low) / 3, b = high - (high - low) / 3;
        const size_t stride = directions.size() / kTried + 1;
        const bool isLower =
            distanceAt(middle + a * reach * camera.up, stride) < distanceAt(middle + b * reach * camera.up, stride);
        (isLower ? high : low) = isLower ? b : a;
    }
    camera.target = middle + 0.5 * (low + high) * reach * camera.up;
    double distance = distanceAt(camera.target, 1);
    if (!(distance > 0) || !std::isfinite(distance)) distance = 1;  // a single point
    CameraPath path;
    for (int i = 0; i < keys; ++i) {
        camera.eye = camera.target + directions[static_cast<size_t>(i)] * distance;
        path.keys.push_back({double(i), camera});
    }
    return path;
}

lod::View makeView(const Camera& camera, uint32_t width, uint32_t height, double nearPlane) {
    lod::View view;
    view.eye = camera.eye;
    // However far away or near the target is, and however long `up`: their directions count.
    const auto directionOf = [](const glm::dvec3& v, const glm::dvec3& other) {
        return hasDirection(v) ? glm::normalize(withoutScale(v)) : other;
    };
    const glm::dvec3 forward = directionOf(camera.target - camera.eye, {0, 0, -1});
    glm::dvec3 right = glm::cross(forward, directionOf(camera.up, glm::dvec3(0)));
    if (!(glm::length(right) > 1e-9))
        right = glm::cross(forward, std::abs(forward.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0));
    view.forward = forward;
    view.right = glm::normalize(right);
    view.down = glm::cross(view.forward, view.right);
    view.width = width;
    view.height = height;
    view.focalPixels = 0.5 * height / std::tan(0.5 * camera.fovDegrees * kPi / 180);
    view.isOrthographic = camera.isOrthographic();
    if (view.isOrthographic) view.focalPixels = 1 / std::max(camera.orthoWidth / width, camera.orthoHeight / height);
    view.nearPlane = view.isOrthographic ? std::max(nearPlane, camera.orthoNear) : nearPlane;
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
    /// Nothing but these: a misspelt name would be passed over without a word.
    Result<void> holdsOnly(const std::vector<std::string>& names) const {
        if (!key_.is_object()) return {};
        for (const auto& [name, value] : key_.items()) {
            if (std::find(names.begin(), names.end(), name) != names.end()) continue;
            const std::string nearest = nearestWord(name, names);
            return fail(ErrorKind::input, fmt::format("{}: '{}' is not known", where_, printable(name)), path_,
                        nearest.empty() ? fmt::format("there are {}", fmt::join(names, ", "))
                                        : fmt::format("did you mean '{}'?", nearest));
        }
        return {};
    }
    tl::unexpected<Error> bad(const char* name, const std::string& what) const {
        return fail(ErrorKind::input, fmt::format("{}: '{}' {}", where_, name, what), path_,
                    R"(expected {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [x,y,z]}]})");
    }

  private:
    const json& key_;
    std::string path_, where_;
};

Result<CameraKey> readKey(const KeyReader& from, const glm::dvec3& up) {
    CameraKey key;
    key.camera.up = up;
    STIPPLE_TRY(from.holdsOnly({"t", "eye", "target", "up", "fov", "ortho"}));
    STIPPLE_ASSIGN(key.t, from.number("t", -1e9, 1e9));
    STIPPLE_ASSIGN(key.camera.eye, from.vector("eye"));
    STIPPLE_ASSIGN(key.camera.target, from.vector("target"));
    if (key.camera.eye == key.camera.target) return from.bad("target", "is where the eye is");
    if (from.has("up")) {
        STIPPLE_ASSIGN(key.camera.up, from.vector("up"));
        if (!(glm::length(key.camera.up) > 0)) return from.bad("up", "has no length");
    }
    if (from.has("fov") && from.has("ortho")) return from.bad("ortho", "is given beside 'fov'");
    if (from.has("ortho")) {
        STIPPLE_ASSIGN(key.camera.orthoWidth, from.number("ortho", kLeastOrtho, kGreatestOrtho));
    }
    if (from.has("fov")) {
        STIPPLE_ASSIGN(key.camera.fovDegrees, from.number("fov", kLeastFov, kGreatestFov));
    }
    return key;
}

}  // namespace

Result<CameraPath> readCameraPath(const std::string& path, const glm::dvec3& up) {
    STIPPLE_ASSIGN(const std::string text, readTextFile(path, uint64_t{64} << 20));
    const json j = json::parse(text, nullptr, false);
    static const json none = json::array();
    if (!j.is_object())
        return fail(ErrorKind::input, "is not a camera path: no JSON object, or one with a number that is too large",
                    path, R"(expected {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [x,y,z]}]})");
    CameraPath out;
    const KeyReader whole(j, path, "the path");
    STIPPLE_TRY(whole.holdsOnly({"fps", "keys"}));
    constexpr double kLeastRate = 1e-6, kGreatestRate = 10'000, kMostFrames = 10'000'000;
    if (whole.has("fps")) {
        STIPPLE_ASSIGN(out.fps, whole.number("fps", kLeastRate, kGreatestRate));
    }
    const json& keys = j.contains("keys") && j["keys"].is_array() ? j["keys"] : none;
    if (keys.empty()) return whole.bad("keys", "holds no key");
    for (const json& k : keys) {
        STIPPLE_ASSIGN(const CameraKey key, readKey(KeyReader(k, path, fmt::format("key {}", out.keys.size())), up));
        if (!out.keys.empty() && !(key.t > out.keys.back().t))
            return fail(ErrorKind::input, fmt::format("key {} is not later than the one before", out.keys.size()),
                        path);
        if (!out.keys.empty() && out.keys[0].camera.isOrthographic() != key.camera.isOrthographic())
            return fail(ErrorKind::input,
                        fmt::format("'ortho' stands in some keys only: key {} differs from key 0", out.keys.size()),
                        path, "give it in all keys or in none");
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
