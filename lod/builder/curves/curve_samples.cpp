#include "lod/builder/curves/curve_samples.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "engine/base/rng.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Tubes wider than the discs are surfaces, and closed: they get twice the discs, and those are merged like any
/// surface's.
constexpr double kSolid = 2;

/// What a segment shows from one side, averaged over all directions round it.
double areaOf(const CurveSet& s, size_t curve, uint32_t i, double solidRadius) {
    const double band =
        glm::length(s.position[i + 1] - s.position[i]) * (double{s.radius[i]} + double{s.radius[i + 1]});
    if (s.isRibbon[curve] != 0) return band;
    return 0.5 * kPi * band * (std::min(s.radius[i], s.radius[i + 1]) > solidRadius ? 2 : 1);
}

glm::dvec3 linearOf(uint32_t colour) {
    const auto channel = [&](uint32_t shift) {
        return double{shared::linearFromSrgb(static_cast<float>(colour >> shift & 255u) / 255.0f)};
    };
    return {channel(0), channel(8), channel(16)};
}
uint32_t byteOf(double linear) {
    return static_cast<uint32_t>(
        std::lround(shared::srgbFromLinear(static_cast<float>(std::clamp(linear, 0.0, 1.0))) * 255.0f));
}

/// From the order of the runs to one in which the first n are spread evenly (the bits of the number reversed), with
/// colours as wide as they are then apart.
CurveSamples inOrder(CurveSamples in, const std::vector<glm::dvec3>& colour) {
    const size_t made = in.points.position.size();  // the last run may end early by rounding
    std::vector<glm::dvec3> sum(made + 1, glm::dvec3(0));
    for (size_t k = 0; k < made; ++k) sum[k + 1] = sum[k] + colour[k];
    CurveSamples out;
    out.radius = in.radius;
    const auto bits = static_cast<int>(std::bit_width(made));
    for (uint64_t i = 0; i < uint64_t{1} << bits; ++i) {
        uint64_t k = 0;
        for (int b = 0; b < bits; ++b) k |= (i >> b & 1u) << (bits - 1 - b);
        if (k >= made) continue;
        const size_t rank = out.points.position.size();
        out.points.position.push_back(in.points.position[k]);
        out.points.normal.push_back(in.points.normal[k]);
        const double half = 0.5 * static_cast<double>(made) / static_cast<double>(std::bit_ceil(rank + 1));
        const auto from = static_cast<size_t>(std::max(0.0, std::round(static_cast<double>(k) + 0.5 - half)));
        const size_t to = std::min(std::max(from + 1, k + static_cast<size_t>(std::round(half + 0.5))), made);
        const glm::dvec3 mean = (sum[to] - sum[from]) / static_cast<double>(to - from);
        out.points.colour.push_back(byteOf(mean.r) | byteOf(mean.g) << 8 | byteOf(mean.b) << 16 | in.points.colour[k]);
    }
    return out;
}

}  // namespace

CurveSamples sampleCurves(const CurveSet& curves, uint64_t count) {
    double solidRadius = 1e300;
    const auto forSegments = [&](const auto& use) {
        for (size_t s = 0; s < curves.curves(); ++s)
            for (uint32_t i = curves.first[s]; i + 1 < curves.first[s + 1]; ++i)
                use(s, i, areaOf(curves, s, i, solidRadius));
    };
    const auto wholeArea = [&] {
        double whole = 0;
        forSegments([&](size_t, uint32_t, double area) { whole += area; });
        return whole;
    };
    const double shown = wholeArea();
    CurveSamples out;
    if (!(shown > 0) || count == 0) return out;
    solidRadius = kSolid * std::sqrt(shown / static_cast<double>(count) / kPi);
    const double each = wholeArea() / static_cast<double>(count);
    out.radius = std::sqrt(each / kPi);
    Rng rng(0x5eed);
    std::vector<glm::dvec3> colour(count, glm::dvec3(0));
    double from = 0, wanted = rng.uniform();  // both in runs
    forSegments([&](size_t s, uint32_t i, double area) {
        const double to = from + area / each;
        const glm::dvec3 mean = 0.5 * (linearOf(curves.colour[i]) + linearOf(curves.colour[i + 1]));
        for (auto run = static_cast<uint64_t>(from); run < count && static_cast<double>(run) < to; ++run) {
            const double begin = std::max(from, static_cast<double>(run)),
                         end = std::min(to, static_cast<double>(run) + 1);
            colour[run] += (end - begin) * mean;
        }
        while (out.points.position.size() < count && wanted < to) {
            const double u = std::clamp((wanted - from) / std::max(to - from, 1e-300), 0.0, 1.0);
            const glm::dvec3 a = curves.position[i], b = curves.position[i + 1], t = glm::normalize(b - a);
            const double radius = (1 - u) * curves.radius[i] + u * curves.radius[i + 1];
            const glm::dvec3 n(glm::mix(glm::dvec3(curves.normal[i]), glm::dvec3(curves.normal[i + 1]), u));
            const glm::dvec3 aside = std::abs(t.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
            const glm::dvec3 x = glm::normalize(glm::cross(t, aside)), y = glm::cross(t, x);
            const double turn = 2 * kPi * rng.uniform(), side = 2 * rng.uniform() - 1;
            const glm::dvec3 out_ = std::cos(turn) * x + std::sin(turn) * y;
            const bool isRibbon = curves.isRibbon[s] != 0;
            const glm::dvec3 across = isRibbon ? glm::cross(n, t) : out_;
            out.points.position.push_back(glm::mix(a, b, u) + radius * (isRibbon ? side : 1.0) * across);
            out.points.normal.emplace_back(isRibbon ? n : out_);
            const bool isSolid = !isRibbon && std::min(curves.radius[i], curves.radius[i + 1]) > solidRadius;
            // Kept where the colour comes later.
            out.points.colour.push_back((shared::kFlagTwoSided | (isSolid ? 0u : shared::kFlagLeaf)) << 24);
            ++wanted;
            wanted = std::floor(wanted) + rng.uniform();
        }
        from = to;
    });
    return inOrder(std::move(out), colour);
}

std::vector<CurveSamples> splitSamples(const CurveSamples& samples, uint32_t most) {
    struct Cube {
        glm::dvec3 least;
        double edge;
        std::vector<uint32_t> of;
    };
    glm::dvec3 lo(1e300), hi(-1e300);
    Cube all;
    for (uint32_t k = 0; k < samples.points.position.size(); ++k) {
        lo = glm::min(lo, samples.points.position[k]);
        hi = glm::max(hi, samples.points.position[k]);
        all.of.push_back(k);
    }
    all.least = lo;
    all.edge = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
    std::vector<Cube> open{std::move(all)};
    std::vector<CurveSamples> out;
    while (!open.empty()) {
        const Cube cube = std::move(open.back());
        open.pop_back();
        if (cube.of.empty()) continue;
        if (cube.of.size() <= most || !(cube.edge > samples.radius)) {
            CurveSamples part;
            part.radius = samples.radius;
            for (const uint32_t k : cube.of) {
                part.points.position.push_back(samples.points.position[k]);
                part.points.normal.push_back(samples.points.normal[k]);
                part.points.colour.push_back(samples.points.colour[k]);
            }
            out.push_back(std::move(part));
            continue;
        }
        std::array<Cube, 8> octants;
        const double half = 0.5 * cube.edge;
        for (size_t o = 0; o < 8; ++o)
            octants.at(o) = {cube.least + half * glm::dvec3(o & 1u, o >> 1 & 1u, o >> 2), half, {}};
        for (const uint32_t k : cube.of) {
            const glm::dvec3 p = samples.points.position[k] - cube.least;
            octants.at((p.x >= half ? 1u : 0u) | (p.y >= half ? 2u : 0u) | (p.z >= half ? 4u : 0u)).of.push_back(k);
        }
        for (Cube& o : octants) open.push_back(std::move(o));
    }
    return out;
}

}  // namespace stipple::lod
