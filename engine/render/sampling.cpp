#include "engine/render/sampling.h"

#include <cmath>

#include "engine/base/rng.h"

namespace stipple::render {
namespace {

constexpr int kBits = 32;

/// A primitive polynomial of GF(2) and the first direction numbers: of dimension 2 on (the first counts backwards).
struct Direction {
    int degree;
    uint32_t coefficients;
    std::array<uint32_t, 4> first;
};
constexpr std::array<Direction, 5> kDirections{
    {{1, 0, {1, 0, 0, 0}}, {2, 1, {1, 3, 0, 0}}, {3, 1, {1, 3, 1, 0}}, {3, 2, {1, 1, 1, 0}}, {4, 1, {1, 1, 3, 3}}}};

/// The binary fraction of Sobol's `index` in one dimension.
uint32_t sobol(uint32_t index, size_t dimension) {
    std::array<uint32_t, kBits> v{};
    for (int i = 0; i < kBits; ++i) {
        const auto bit = static_cast<size_t>(i);
        if (dimension == 0) {
            v[bit] = 1u << (kBits - 1 - i);
            continue;
        }
        const Direction& d = kDirections.at(dimension - 1);
        if (i < d.degree) {
            v[bit] = d.first.at(bit) << (kBits - 1 - i);
            continue;
        }
        const auto before = static_cast<size_t>(i - d.degree);
        v[bit] = v[before] ^ (v[before] >> d.degree);
        for (int k = 1; k < d.degree; ++k)
            if ((d.coefficients >> (d.degree - 1 - k) & 1u) != 0) v[bit] ^= v[static_cast<size_t>(i - k)];
    }
    uint32_t fraction = 0;
    for (size_t bit = 0; bit < kBits && index >> bit != 0; ++bit)
        if ((index >> bit & 1u) != 0) fraction ^= v[bit];
    return fraction;
}

/// Each digit is turned or not by what stands before it: nets stay nets, and their regularity goes.
uint32_t scrambled(uint32_t fraction, size_t dimension) {
    uint32_t out = 0;
    for (int bit = kBits - 1; bit >= 0; --bit) {
        const uint64_t before = uint64_t{fraction} >> (bit + 1) | uint64_t{1} << (kBits - 1 - bit);
        const auto turned = static_cast<uint32_t>(Rng(before << 3 | dimension).next() & 1u);
        out |= ((fraction >> bit & 1u) ^ turned) << bit;
    }
    return out;
}

/// Of the unit square onto the unit disc: concentric squares become circles.
glm::dvec2 onDisc(const glm::dvec2& square) {
    constexpr double kPi = 3.14159265358979323846;
    const glm::dvec2 p = 2.0 * square - 1.0;
    if (p == glm::dvec2(0)) return p;
    const bool isAcross = std::abs(p.x) > std::abs(p.y);
    const double radius = isAcross ? p.x : p.y;
    const double angle = isAcross ? kPi / 4 * (p.y / p.x) : kPi / 2 - kPi / 4 * (p.x / p.y);
    return radius * glm::dvec2(std::cos(angle), std::sin(angle));
}

}  // namespace

std::array<double, 6> lowDiscrepancy(uint32_t index) {
    std::array<double, 6> out{};
    for (size_t d = 0; d < out.size(); ++d) out.at(d) = (scrambled(sobol(index, d), d) + 0.5) * 0x1p-32;
    return out;
}

FrameSample sampleOf(uint32_t index) {
    const std::array<double, 6> u = lowDiscrepancy(index);
    return {glm::dvec2(u[0], u[1]) - 0.5, onDisc({u[2], u[3]}), u[4] - 0.5, u[5]};
}

double circleOfConfusion(const lod::View& view, const Lens& lens, double depth) {
    return lens.isPinhole() ? 0 : view.focalPixels * lens.aperture * std::abs(1 / lens.focus - 1 / depth);
}

lod::View viewOf(const lod::View& view, const FrameSample& sample, const Lens& lens) {
    lod::View out = view;
    out.shift -= sample.pixel;
    if (lens.isPinhole()) return out;
    const glm::dvec2 off = 0.5 * lens.aperture * sample.lens;
    out.eye += off.x * view.right + off.y * view.down;
    out.shift += view.focalPixels / lens.focus * off;
    return out;
}

}  // namespace stipple::render
