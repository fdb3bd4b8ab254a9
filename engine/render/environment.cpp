#include "engine/render/environment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <numbers>

#include "shaders/shared/environment.h"

namespace stipple::render {
namespace {

struct Sample {
    glm::vec3 direction, light;  ///< light times solid angle
    float solidAngle;
};

glm::dvec3 directionOf(double u, double v) {
    const double azimuth = (u - 0.5) * 2 * std::numbers::pi, elevation = (0.5 - v) * std::numbers::pi;
    return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation), -std::cos(azimuth) * std::cos(elevation)};
}

/// The picture in width x height cells, each the mean of what lies in it.
std::vector<Sample> reduce(const HdrImage& image, float scale, uint32_t width, uint32_t height) {
    std::vector<Sample> out;
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const uint32_t x0 = x * image.width / width, x1 = std::max((x + 1) * image.width / width, x0 + 1),
                           y0 = y * image.height / height, y1 = std::max((y + 1) * image.height / height, y0 + 1);
            glm::dvec3 sum(0);
            for (uint32_t j = y0; j < y1; ++j)
                for (uint32_t i = x0; i < x1; ++i) {
                    const float* c = &image.rgb[(size_t{j} * image.width + i) * 3];
                    for (int k = 0; k < 3; ++k) sum[k] += std::isfinite(c[k]) ? std::clamp(c[k], 0.0f, 6e4f) : 0;
                }
            const double top = std::sin((0.5 - double(y) / height) * std::numbers::pi),
                         bottom = std::sin((0.5 - double(y + 1) / height) * std::numbers::pi);
            const double angle = (top - bottom) * 2 * std::numbers::pi / width;
            const glm::dvec3 light = sum * (scale * angle / (double(x1 - x0) * (y1 - y0)));
            out.push_back({glm::vec3(directionOf((x + 0.5) / width, (y + 0.5) / height)), glm::vec3(light),
                           static_cast<float>(angle)});
        }
    return out;
}

void addHarmonics(const std::vector<Sample>& samples, std::vector<float>& table) {
    // Basis constants squared, times the cosine's factors over pi: 1, 2/3, 1/4.
    const double c0 = 1 / (4 * std::numbers::pi), c1 = 3 / (4 * std::numbers::pi) * (2.0 / 3),
                 c2 = 15 / (4 * std::numbers::pi) * 0.25, c20 = 5 / (16 * std::numbers::pi) * 0.25,
                 c22 = 15 / (16 * std::numbers::pi) * 0.25;
    std::array<glm::dvec3, 9> sum{};
    for (const Sample& s : samples) {
        const glm::dvec3 l(s.light), d(s.direction);
        const std::array<double, 9> basis{c0,
                                          c1 * d.y,
                                          c1 * d.z,
                                          c1 * d.x,
                                          c2 * d.x * d.y,
                                          c2 * d.y * d.z,
                                          c20 * (3 * d.z * d.z - 1),
                                          c2 * d.x * d.z,
                                          c22 * (d.x * d.x - d.y * d.y)};
        for (size_t k = 0; k < 9; ++k) sum.at(k) += l * basis.at(k);
    }
    for (const glm::dvec3& v : sum)
        for (int k = 0; k < 3; ++k) table.push_back(static_cast<float>(v[k]));
}

glm::vec3 directionOfTexel(uint32_t x, uint32_t y, uint32_t edgeTexels) {
    const auto edge = static_cast<float>(edgeTexels);
    glm::vec3 d(2 * (static_cast<float>(x) + 0.5f) / edge - 1, 0, 2 * (static_cast<float>(y) + 0.5f) / edge - 1);
    d.y = 1 - std::abs(d.x) - std::abs(d.z);
    if (d.y < 0) {
        const float px = d.x, pz = d.z;
        d.x = (1 - std::abs(pz)) * (px >= 0 ? 1.0f : -1.0f);
        d.z = (1 - std::abs(px)) * (pz >= 0 ? 1.0f : -1.0f);
    }
    return glm::normalize(d);
}

glm::vec3 plainLook(const HdrImage& image, const glm::vec3& d) {
    const double u = 0.5 + std::atan2(double(d.x), -double(d.z)) / (2 * std::numbers::pi),
                 v = 0.5 - std::asin(std::clamp(double(d.y), -1.0, 1.0)) / std::numbers::pi;
    const double px = u * image.width - 0.5, py = std::clamp(v * image.height - 0.5, 0.0, image.height - 1.0);
    const double left = std::floor(px), top = std::floor(py);
    const auto x0 = static_cast<uint32_t>((static_cast<int64_t>(left) + image.width) % image.width),
               x1 = (x0 + 1) % image.width, y0 = static_cast<uint32_t>(top), y1 = std::min(y0 + 1, image.height - 1);
    const auto at = [&](uint32_t x, uint32_t y) {
        glm::dvec3 c(0);
        for (int k = 0; k < 3; ++k) {
            const float v0 = image.rgb[(size_t{y} * image.width + x) * 3 + static_cast<size_t>(k)];
            c[k] = std::isfinite(v0) ? std::clamp(v0, 0.0f, 6e4f) : 0;
        }
        return c;
    };
    return glm::vec3(
        glm::mix(glm::mix(at(x0, y0), at(x1, y0), px - left), glm::mix(at(x0, y1), at(x1, y1), px - left), py - top));
}

/// What mirrors see: twice as many texels around as the picture has, up to kMostEdge, and three maps of half the edge
/// each, the means of four.
void addSharpMaps(const HdrImage& image, float scale, Executor& executor, Environment& out) {
    constexpr uint32_t kLeastEdge = 256, kMostEdge = 2048;
    uint32_t edge = kLeastEdge;
    while (edge < kMostEdge && edge < 2 * image.width) edge *= 2;
    out.sharpEdge = edge;
    out.table.resize(shared::environmentSharp(edge, shared::kEnvironmentSharp));
    executor.parallelFor(edge, 16, [&](size_t begin, size_t end) {
        for (auto y = static_cast<uint32_t>(begin); y < end; ++y)
            for (uint32_t x = 0; x < edge; ++x) {
                const glm::vec3 c = scale * plainLook(image, directionOfTexel(x, y, edge));
                float* const to = &out.table[shared::kEnvironmentFloats + (size_t{y} * edge + x) * 3];
                for (int k = 0; k < 3; ++k) to[k] = c[k];
            }
    });
    for (uint32_t l = 1; l < shared::kEnvironmentSharp; ++l) {
        const float* const from = &out.table[shared::environmentSharp(edge, l - 1)];
        float* const to = &out.table[shared::environmentSharp(edge, l)];
        const size_t half = edge >> l, row = size_t{6} * half;
        for (size_t y = 0; y < half; ++y)
            for (size_t x = 0; x < half; ++x)
                for (size_t k = 0; k < 3; ++k) {
                    const float* const at = from + 2 * y * row + 6 * x + k;
                    to[(y * half + x) * 3 + k] = 0.25f * (at[0] + at[3] + at[row] + at[row + 3]);
                }
    }
}

}  // namespace

glm::dmat3 environmentAxes(const glm::dvec3& worldUp) {
    const glm::dvec3 up = glm::normalize(worldUp);
    const glm::dvec3 aside = std::abs(up.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
    const glm::dvec3 back = glm::normalize(glm::cross(aside, up));
    return {glm::cross(up, back), up, back};
}

Environment makeEnvironment(const HdrImage& image, float scale, Executor& executor, bool hasMirrors) {
    Environment out;
    const std::vector<Sample> fine = reduce(image, scale, 256, 128), coarse = reduce(image, scale, 64, 32);
    addHarmonics(coarse, out.table);
    out.table.resize(shared::kEnvironmentFloats);
    constexpr uint32_t kEdge = shared::kEnvironmentEdge;
    // Doublings of the cosine: exponents 512, 32, 4, 1 for roughness 1/4 to 1.
    constexpr std::array<int, shared::kEnvironmentLevels> kDoublings{-1, 9, 5, 2, 0};
    executor.parallelFor(kEdge, 2, [&](size_t begin, size_t end) {
        for (auto y = static_cast<uint32_t>(begin); y < end; ++y)
            for (uint32_t x = 0; x < kEdge; ++x) {
                const glm::vec3 d = directionOfTexel(x, y, kEdge);
                for (uint32_t l = 0; l < shared::kEnvironmentLevels; ++l) {
                    glm::vec3 sum(0);
                    float weights = 0;
                    if (kDoublings.at(l) < 0) {  // a plain look
                        const double u = 0.5 + std::atan2(double(d.x), -double(d.z)) / (2 * std::numbers::pi),
                                     v = 0.5 - std::asin(std::clamp(double(d.y), -1.0, 1.0)) / std::numbers::pi;
                        const auto px = std::min(static_cast<uint32_t>(u * 256), 255u),
                                   py = std::min(static_cast<uint32_t>(v * 128), 127u);
                        const Sample& s = fine[size_t{py} * 256 + px];
                        sum = s.light;
                        weights = s.solidAngle;
                    } else {
                        for (const Sample& s : coarse) {
                            float w = glm::dot(d, s.direction);
                            if (w <= 0) continue;
                            for (int k = 0; k < kDoublings.at(l); ++k) w *= w;
                            sum += w * s.light;
                            weights += w * s.solidAngle;
                        }
                    }
                    float* to = &out.table[shared::kEnvironmentHarmonics + ((size_t{l} * kEdge + y) * kEdge + x) * 3];
                    for (int k = 0; k < 3; ++k) to[k] = weights > 0 ? sum[k] / weights : 0;
                }
            }
    });
    if (hasMirrors) addSharpMaps(image, scale, executor, out);
    return out;
}

}  // namespace stipple::render
