#include "tests/support/drawn_shapes.h"

#include <cmath>

#include "engine/base/rng.h"
#include "engine/scene/camera.h"

namespace stipple::test {
namespace {

using glm::dvec3;

constexpr double kThin = 0.35;

/// Distance of the statue's surface from the origin in a unit direction.
double reachOf(const dvec3& n) {
    return 1 + 0.22 * std::sin(5 * n.x + 1) * std::sin(4 * n.y) * std::sin(6 * n.z + 0.5) + 0.15 * n.y * n.x;
}
dvec3 onStatue(const dvec3& direction) {
    const dvec3 n = glm::normalize(direction);
    return reachOf(n) * n;
}

std::vector<TestPoint> statue(size_t count, uint64_t seed) {
    Rng rng(seed);
    const double shake = 0.33 * spacingOf(Shape::statue, count);
    std::vector<TestPoint> points;
    for (size_t k = 0; k < count; ++k) {
        // A spiral from pole to pole, Fibonacci's.
        const double z = 1 - 2 * (static_cast<double>(k) + 0.5) / static_cast<double>(count),
                     a = static_cast<double>(k) * M_PI * (3 - std::sqrt(5.0)), r = std::sqrt(1 - z * z);
        const dvec3 off = shake * dvec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
        const dvec3 n = glm::normalize(dvec3(r * std::cos(a), r * std::sin(a), z) + off);
        const dvec3 u = glm::normalize(glm::cross(std::abs(n.x) < 0.8 ? dvec3(1, 0, 0) : dvec3(0, 1, 0), n)),
                    v = glm::cross(n, u);
        constexpr double h = 1e-5;
        const dvec3 alongU = onStatue(n + h * u) - onStatue(n - h * u),
                    alongV = onStatue(n + h * v) - onStatue(n - h * v);
        points.push_back({onStatue(n), glm::vec3(glm::normalize(glm::cross(alongU, alongV))), 0xc0c0c0, 0});
    }
    return points;
}

std::vector<TestPoint> torus(size_t count, uint64_t seed) {
    Rng rng(seed);
    const double spacing = spacingOf(Shape::torus, count);
    std::vector<TestPoint> points;
    const int around = static_cast<int>(2 * M_PI / spacing);
    for (int i = 0; i < around; ++i)
        for (double b = 0; b < 2 * M_PI;) {
            const double a = (i + 0.33 * rng.uniform(-1, 1)) * 2 * M_PI / around, r = 1 + kThin * std::cos(b);
            const dvec3 out(std::cos(a), std::sin(a), 0), n = std::cos(b) * out + dvec3(0, 0, std::sin(b));
            points.push_back({out + kThin * n, glm::vec3(n), 0xc0c0c0, 0});
            b += spacing * spacing / (kThin * r * 2 * M_PI / around) * (1 + 0.33 * rng.uniform(-1, 1));
        }
    return points;
}

}  // namespace

double insideOf(Shape shape, const dvec3& p) {
    if (shape == Shape::torus) return std::hypot(std::hypot(p.x, p.y) - 1, p.z) - kThin;
    const double length = glm::length(p);
    return length < 0.1 ? -1 : length - reachOf(p / length);
}

std::vector<TestPoint> samplesOf(Shape shape, size_t count, uint64_t seed) {
    return shape == Shape::torus ? torus(count, seed) : statue(count, seed);
}

double spacingOf(Shape shape, size_t count) {
    const double area = shape == Shape::torus ? 4 * M_PI * M_PI * kThin : 4 * M_PI;
    return std::sqrt(area / static_cast<double>(count));
}

bool meetsShape(Shape shape, const dvec3& eye, const dvec3& direction) {
    const dvec3 d = glm::normalize(direction);
    const double middle = -glm::dot(eye, d);
    constexpr double kStep = 1e-3;
    for (double t = std::max(middle - 1.6, 0.0); t < middle + 1.6;) {
        const double f = insideOf(shape, eye + t * d);
        if (f < 0) return true;
        t += std::max(0.3 * f, kStep);  // neither function grows by more than 3 a unit
    }
    return false;
}

lod::View lookAt(const lod::Store& store, double azimuth, double elevation, double distance, uint32_t size) {
    const lod::StoreDescription& d = store.description;
    scene::Camera camera;
    camera.up = d.up;
    const dvec3 first(d.up.z, d.up.x, d.up.y), second(d.up.y, d.up.z, d.up.x);
    const double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
    const dvec3 towards = std::cos(e) * (std::cos(a) * first + std::sin(a) * second) + std::sin(e) * d.up;
    camera.target = 0.5 * (d.boundsMin + d.boundsMax);
    const double extent = glm::length(d.boundsMax - d.boundsMin);
    camera.eye = camera.target + towards * (extent * distance);
    return scene::makeView(camera, size, size, 1e-5 * extent);
}

}  // namespace stipple::test
