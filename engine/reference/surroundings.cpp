#include "engine/reference/surroundings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stipple::reference {
namespace {

using glm::dvec3;

dvec3 texelAt(const render::Backdrop& b, size_t level, int64_t x, int64_t y) {
    const auto sizeOf = [&](uint32_t size) { return std::max<int64_t>(size / (int64_t{1} << level), 1); };
    const int64_t width = sizeOf(b.width), height = sizeOf(b.height);
    const int64_t column = ((x % width) + width) % width, row = std::clamp<int64_t>(y, 0, height - 1);
    const uint32_t word = b.texels[b.first.at(level) + static_cast<size_t>(row * width + column)];
    const int exponent = static_cast<int>(word / (1u << 27)) - 24;
    return {std::ldexp(word % 512u, exponent), std::ldexp(word / 512u % 512u, exponent),
            std::ldexp(word / (512u * 512u) % 512u, exponent)};
}

dvec3 look(const render::Backdrop& b, size_t level, double u, double v) {
    const double x = u * std::max<double>(std::floor(b.width / std::exp2(level)), 1) - 0.5,
                 y = v * std::max<double>(std::floor(b.height / std::exp2(level)), 1) - 0.5;
    const double left = std::floor(x), top = std::floor(y);
    const auto at = [&](int dx, int dy) {
        return texelAt(b, level, static_cast<int64_t>(left) + dx, static_cast<int64_t>(top) + dy);
    };
    return glm::mix(glm::mix(at(0, 0), at(1, 0), x - left), glm::mix(at(0, 1), at(1, 1), x - left), y - top);
}

}  // namespace

dvec3 lightFrom(const render::Backdrop& b, const dvec3& direction, double angle) {
    const dvec3 d = glm::normalize(direction);
    const double u = 0.5 + std::atan2(d.x, -d.z) / (2 * std::numbers::pi),
                 v = std::acos(std::clamp(d.y, -1.0, 1.0)) / std::numbers::pi;
    const double level = std::clamp(angle > 0 ? std::log2(angle * b.height / std::numbers::pi) : 0.0, 0.0,
                                    static_cast<double>(b.levels) - 1);
    const auto fine = static_cast<size_t>(level);
    const size_t coarse = std::min<size_t>(fine + 1, b.levels - 1);
    return double{b.scale} * glm::mix(look(b, fine, u, v), look(b, coarse, u, v), level - static_cast<double>(fine));
}

dvec3 toMap(const dvec3& world, const dvec3& up) {
    const dvec3 y = glm::normalize(up);
    // The picture's x is the world's without its part along up, or, where that is up, the world's z.
    const dvec3 aside = std::abs(y.x) < 0.9 ? dvec3(1, 0, 0) : dvec3(0, 0, 1);
    const dvec3 x = glm::normalize(aside - glm::dot(aside, y) * y);
    return {glm::dot(x, world), glm::dot(y, world), glm::dot(glm::cross(x, y), world)};
}

}  // namespace stipple::reference
