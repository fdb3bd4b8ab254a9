#include "apps/study/sweep/paths.h"

#include <algorithm>
#include <cmath>

namespace stipple::study {
namespace {

using glm::dvec3;
constexpr double kAspect = 16.0 / 9;

/// Along `axis`, the least and the greatest of the points.
std::pair<double, double> spanOf(std::span<const dvec3> points, const dvec3& axis) {
    double low = 1e300, high = -1e300;
    for (const dvec3& p : points) {
        low = std::min(low, glm::dot(p, axis));
        high = std::max(high, glm::dot(p, axis));
    }
    return {low, high};
}

}  // namespace

std::vector<PathView> viewsOfPath(const scene::CameraPath& path, const std::string& name, uint32_t count) {
    std::vector<PathView> views;
    for (uint32_t i = 0; i < count; ++i) {
        const double share = count > 1 ? static_cast<double>(i) / (count - 1) : 0.5;
        views.push_back({name, i, path.at(path.keys.front().t + share * path.duration())});
    }
    return views;
}

std::vector<PathView> usualViews(std::span<const dvec3> outline, const dvec3& up, uint32_t perPath) {
    std::vector<PathView> views;
    const auto share = [&](uint32_t i) { return (i + 0.5) / perPath; };
    const scene::CameraPath orbit =
        scene::makeOrbit(outline, up, kAspect, static_cast<int>(std::max(2u, perPath + 1)), 50);
    for (uint32_t i = 0; i < perPath; ++i)
        views.push_back({"orbit", i, orbit.at(orbit.keys.front().t + share(i) * orbit.duration())});
    const scene::Camera fit = scene::fitCamera(outline, up, kAspect);
    for (uint32_t i = 0; i < perPath; ++i) {
        scene::Camera c = fit;
        c.eye = fit.target + (fit.eye - fit.target) * 2.0 * std::exp2(-4 * share(i));
        views.push_back({"dolly", i, c});
    }
    const dvec3 u = glm::normalize(up), first = glm::normalize(std::abs(u.x) < 0.9 ? glm::cross(u, dvec3(1, 0, 0))
                                                                                   : glm::cross(u, dvec3(0, 1, 0)));
    const dvec3 second = glm::cross(u, first);
    const auto [low, high] = spanOf(outline, u);
    const auto [left, right] = spanOf(outline, first);
    const auto [back, front] = spanOf(outline, second);
    const double along = right - left, height = low + (high - low) / 3;
    const auto at = [&](double s) { return (left + s * along) * first + 0.5 * (back + front) * second + height * u; };
    for (uint32_t i = 0; i < perPath; ++i) {
        scene::Camera c = fit;
        c.eye = at(0.1 + 0.6 * share(i)) + 0.2 * (high - low) * u;
        c.target = c.eye + (at(1) - at(0)) * 0.5 - 0.1 * (high - low) * u;
        c.up = u;
        views.push_back({"fly-through", i, c});
    }
    const double radius = 0.5 * std::hypot(along, front - back, high - low);
    const dvec3 middle = 0.5 * (left + right) * first + 0.5 * (back + front) * second + 0.5 * (low + high) * u;
    for (uint32_t i = 0; i < perPath; ++i) {
        scene::Camera c = fit;
        const double angle = 6.283185307179586 * share(i), above = 4 * 0.017453292519943295;
        c.target = middle;
        c.eye =
            middle + 1.5 * radius *
                         (std::cos(above) * (std::cos(angle) * first + std::sin(angle) * second) + std::sin(above) * u);
        c.up = u;
        views.push_back({"grazing", i, c});
    }
    return views;
}

}  // namespace stipple::study
