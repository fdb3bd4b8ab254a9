#include "apps/study/metrics/flip.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <glm/glm.hpp>

namespace stipple::study {
namespace {

using glm::dvec3;

constexpr double kColourExponent = 0.7, kFeatureExponent = 0.5;  // q_c, q_f
constexpr double kShare = 0.4, kUpTo = 0.95;                     // p_c, p_t
constexpr double kFeatureDegrees = 0.082;                        // w

const glm::dmat3 kXyzFromRgb = glm::transpose(glm::dmat3(
    10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794, 2613072.0 / 12288897, 8788810.0 / 12288897,
    887015.0 / 12288897, 1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382));
const dvec3 kWhite = kXyzFromRgb * dvec3(1);

double linearOf(uint32_t byte) {
    const double s = byte / 255.0;
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

/// Y, Cx, Cz: linear in light, so that filtering is what the eye does.
dvec3 opponentOf(const dvec3& rgb) {
    const dvec3 t = kXyzFromRgb * rgb / kWhite;
    return {116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z)};
}
dvec3 rgbOf(const dvec3& opponent) {
    const double y = (opponent.x + 16) / 116;
    return glm::inverse(kXyzFromRgb) * (kWhite * dvec3(y + opponent.y / 500, y, y - opponent.z / 200));
}

/// CIELAB; colours count less where it is dark (Hunt effect).
dvec3 huntLabOf(const dvec3& rgb) {
    const dvec3 t = kXyzFromRgb * rgb / kWhite;
    const auto f = [](double v) {
        constexpr double kDelta = 6.0 / 29;
        return v > kDelta * kDelta * kDelta ? std::cbrt(v) : v / (3 * kDelta * kDelta) + 4.0 / 29;
    };
    const double l = 116 * f(t.y) - 16;
    return {l, 0.01 * l * 500 * (f(t.x) - f(t.y)), 0.01 * l * 200 * (f(t.y) - f(t.z))};
}
double hyab(const dvec3& a, const dvec3& b) {
    const dvec3 d = a - b;
    return std::abs(d.x) + std::hypot(d.y, d.z);
}

/// Y, Cx, Cz of a picture.
std::array<Plane, 3> opponentPlanes(const render::Image& image) {
    std::array<double, 256> linear{};
    for (uint32_t v = 0; v < 256; ++v) linear.at(v) = linearOf(v);
    std::array<Plane, 3> planes;
    planes.fill(Plane(image.width, image.height));
    for (size_t i = 0; i < image.rgba.size(); ++i) {
        const uint32_t c = image.rgba[i];
        const dvec3 o = opponentOf({linear.at(c & 255u), linear.at(c >> 8 & 255u), linear.at(c >> 16 & 255u)});
        for (size_t k = 0; k < 3; ++k) planes.at(k).values[i] = static_cast<float>(o[static_cast<int>(k)]);
    }
    return planes;
}

struct Sensitivity {
    double a1, b1, a2, b2;
};
constexpr std::array<Sensitivity, 3> kSensitivity{
    {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}}};
constexpr double kPi = 3.14159265358979323846;

/// A plane as the eye resolves it: one or two Gaussians, whose weights sum up to one together.
Plane seen(const Plane& plane, const Sensitivity& s, double pixelsPerDegree) {
    const auto radius = static_cast<int>(std::ceil(3 * std::sqrt(0.04 / (2 * kPi * kPi)) * pixelsPerDegree));
    Plane out(plane.width, plane.height);
    std::array<std::vector<float>, 2> rows;
    std::array<double, 2> weight{};
    double total = 0;
    const std::array<std::pair<double, double>, 2> terms{{{s.a1, s.b1}, {s.a2, s.b2}}};
    for (size_t t = 0; t < 2; ++t) {
        double sum = 0;
        for (int k = -radius; k <= radius; ++k) {
            const double degrees = k / pixelsPerDegree;
            const double g = std::exp(-kPi * kPi / terms.at(t).second * degrees * degrees);
            rows.at(t).push_back(static_cast<float>(g));
            sum += g;
        }
        for (float& v : rows.at(t)) v = static_cast<float>(v / sum);
        weight.at(t) = terms.at(t).first * std::sqrt(kPi / terms.at(t).second) * sum * sum;
        total += weight.at(t);
    }
    for (size_t t = 0; t < 2; ++t) {
        if (!(weight.at(t) > 0)) continue;
        const Plane one = filtered(plane, rows.at(t), rows.at(t));
        const auto share = static_cast<float>(weight.at(t) / total);
        for (size_t i = 0; i < out.values.size(); ++i) out.values[i] += share * one.values[i];
    }
    return out;
}

/// What is seen, in Hunt-adjusted CIELAB.
std::vector<dvec3> seenColours(const std::array<Plane, 3>& planes, double pixelsPerDegree) {
    std::array<Plane, 3> s;
    for (size_t k = 0; k < 3; ++k) s.at(k) = seen(planes.at(k), kSensitivity.at(k), pixelsPerDegree);
    std::vector<dvec3> out(s[0].values.size());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = huntLabOf(glm::clamp(rgbOf({s[0].values[i], s[1].values[i], s[2].values[i]}), 0.0, 1.0));
    return out;
}

/// Strength of edges and of points at each pixel of the achromatic plane.
std::array<std::vector<double>, 2> featuresOf(const Plane& y, double pixelsPerDegree) {
    const double sigma = 0.5 * kFeatureDegrees * pixelsPerDegree;
    const auto radius = static_cast<int>(std::ceil(3 * sigma));
    std::vector<float> smooth, edge, point;
    double all = 0, ahead = 0, above = 0, below = 0;
    const auto gauss = [&](int k) { return std::exp(-k * k / (2 * sigma * sigma)); };
    const auto bend = [&](int k) { return (k * k / (sigma * sigma) - 1) * gauss(k); };
    for (int k = -radius; k <= radius; ++k) {
        all += gauss(k);
        ahead += k > 0 ? k * gauss(k) : 0;
        (bend(k) > 0 ? above : below) += std::abs(bend(k));
    }
    for (int k = -radius; k <= radius; ++k) {
        smooth.push_back(static_cast<float>(gauss(k) / all));
        edge.push_back(static_cast<float>(-k * gauss(k) / ahead));
        point.push_back(static_cast<float>(bend(k) / (bend(k) > 0 ? above : below)));
    }
    Plane achromatic = y;
    for (float& v : achromatic.values) v = (v + 16) / 116;
    std::array<std::vector<double>, 2> out;
    for (size_t f = 0; f < 2; ++f) {
        const std::vector<float>& kernel = f == 0 ? edge : point;
        const Plane x = filtered(achromatic, kernel, smooth), down = filtered(achromatic, smooth, kernel);
        for (size_t i = 0; i < x.values.size(); ++i) out.at(f).push_back(std::hypot(x.values[i], down.values[i]));
    }
    return out;
}

}  // namespace

Result<Plane> flip(const render::Image& image, const render::Image& reference, double pixelsPerDegree) {
    if (image.width != reference.width || image.height != reference.height)
        return fail(ErrorKind::input, fmt::format("the images have different sizes: {} x {} and {} x {}", image.width,
                                                  image.height, reference.width, reference.height));
    const auto a = opponentPlanes(image), b = opponentPlanes(reference);
    const std::vector<dvec3> colourA = seenColours(a, pixelsPerDegree), colourB = seenColours(b, pixelsPerDegree);
    const auto featureA = featuresOf(a[0], pixelsPerDegree), featureB = featuresOf(b[0], pixelsPerDegree);
    const double most = std::pow(hyab(huntLabOf({0, 1, 0}), huntLabOf({0, 0, 1})), kColourExponent);
    Plane out(image.width, image.height);
    for (size_t i = 0; i < out.values.size(); ++i) {
        const double e = std::pow(hyab(colourA[i], colourB[i]), kColourExponent);
        const double colour = e < kShare * most ? kUpTo / (kShare * most) * e
                                                : kUpTo + (e - kShare * most) / (most - kShare * most) * (1 - kUpTo);
        const double change =
            std::max(std::abs(featureA[0][i] - featureB[0][i]), std::abs(featureA[1][i] - featureB[1][i]));
        const double feature = std::pow(change / std::sqrt(2.0), kFeatureExponent);
        out.values[i] = static_cast<float>(std::pow(std::min(colour, 1.0), 1 - std::min(feature, 1.0)));
    }
    return out;
}

}  // namespace stipple::study
