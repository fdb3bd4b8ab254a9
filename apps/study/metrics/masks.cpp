#include "apps/study/metrics/masks.h"

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <limits>

#include "apps/study/statistics/intervals.h"

namespace stipple::study {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kFar = 1e18;

struct Mask {
    int64_t width = 0, height = 0;
    std::vector<uint8_t> isCovered;
    explicit Mask(const render::Image& image) : width(image.width), height(image.height) {
        for (const uint32_t c : image.rgba) isCovered.push_back(c >> 24 >= 128 ? 1 : 0);
    }
    bool at(int64_t x, int64_t y) const { return isCovered[static_cast<size_t>(y * width + x)] != 0; }
    /// Covered, with a neighbour in the picture that is not.
    bool isBoundary(int64_t x, int64_t y) const {
        return at(x, y) && ((x > 0 && !at(x - 1, y)) || (x + 1 < width && !at(x + 1, y)) || (y > 0 && !at(x, y - 1)) ||
                            (y + 1 < height && !at(x, y + 1)));
    }
    /// All of the 5 x 5 pixels around one are like that.
    bool isAllAround(int64_t x, int64_t y, bool covered) const {
        if (x < 2 || y < 2 || x + 2 >= width || y + 2 >= height) return false;
        for (int64_t k = 0; k < 25; ++k)
            if (at(x + k % 5 - 2, y + k / 5 - 2) != covered) return false;
        return true;
    }
};

/// One line of squared distances: the lower envelope of parabolas (Felzenszwalb & Huttenlocher 2012). `f` in and out.
void lowerEnvelope(std::vector<double>& f) {
    const size_t n = f.size();
    std::vector<size_t> at(n, 0);
    std::vector<double> from(n + 1, 0);
    size_t last = 0;
    from[0] = -kFar;
    from[1] = kFar;
    const auto meet = [&](size_t p, size_t q) {
        const auto a = static_cast<double>(p), b = static_cast<double>(q);
        return ((f[q] + b * b) - (f[p] + a * a)) / (2 * (b - a));
    };
    for (size_t q = 1; q < n; ++q) {
        double s = meet(at[last], q);
        while (last > 0 && s <= from[last]) s = meet(at[--last], q);
        at[++last] = q;
        from[last] = s;
        from[last + 1] = kFar;
    }
    std::vector<double> out(n);
    for (size_t q = 0, k = 0; q < n; ++q) {
        while (from[k + 1] < static_cast<double>(q)) ++k;
        const double d = static_cast<double>(q) - static_cast<double>(at[k]);
        out[q] = d * d + f[at[k]];
    }
    f = out;
}

/// Of every pixel from the nearest boundary pixel, px.
std::vector<double> distancesFrom(const Mask& mask) {
    std::vector<double> d(mask.isCovered.size(), 1e12), line;
    for (int64_t y = 0; y < mask.height; ++y)
        for (int64_t x = 0; x < mask.width; ++x)
            if (mask.isBoundary(x, y)) d[static_cast<size_t>(y * mask.width + x)] = 0;
    for (int64_t x = 0; x < mask.width; ++x) {
        line.clear();
        for (int64_t y = 0; y < mask.height; ++y) line.push_back(d[static_cast<size_t>(y * mask.width + x)]);
        lowerEnvelope(line);
        for (int64_t y = 0; y < mask.height; ++y)
            d[static_cast<size_t>(y * mask.width + x)] = line[static_cast<size_t>(y)];
    }
    for (int64_t y = 0; y < mask.height; ++y) {
        const auto begin = d.begin() + y * mask.width;
        line.assign(begin, begin + mask.width);
        lowerEnvelope(line);
        std::transform(line.begin(), line.end(), begin, [](double v) { return std::sqrt(v); });
    }
    return d;
}

double boundaryDistance(const Mask& a, const Mask& b) {
    const std::vector<double> toA = distancesFrom(a), toB = distancesFrom(b);
    double sum = 0;
    uint64_t ofA = 0, ofB = 0;
    for (int64_t y = 0; y < a.height; ++y)
        for (int64_t x = 0; x < a.width; ++x) {
            const auto i = static_cast<size_t>(y * a.width + x);
            if (a.isBoundary(x, y)) {
                sum += toB[i];
                ++ofA;
            }
            if (b.isBoundary(x, y)) {
                sum += toA[i];
                ++ofB;
            }
        }
    if (ofA == 0 && ofB == 0) return 0;
    return ofA > 0 && ofB > 0 ? sum / static_cast<double>(ofA + ofB) : kNone;
}

glm::dvec3 normalAt(const render::Image& image, size_t i) {
    return {image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]};
}

}  // namespace

MaskErrors compareMasks(const render::Image& image, const render::Image& reference) {
    const Mask a(image), b(reference);
    MaskErrors e;
    uint64_t both = 0, either = 0;
    for (int64_t y = 0; y < a.height; ++y)
        for (int64_t x = 0; x < a.width; ++x) {
            both += a.at(x, y) && b.at(x, y) ? 1 : 0;
            either += a.at(x, y) || b.at(x, y) ? 1 : 0;
            e.holes += !a.at(x, y) && b.isAllAround(x, y, true) ? 1 : 0;
            e.spill += a.at(x, y) && b.isAllAround(x, y, false) ? 1 : 0;
        }
    if (either > 0) e.overlap = static_cast<double>(both) / static_cast<double>(either);
    e.boundaryPixels = boundaryDistance(a, b);
    std::vector<double> depths, angles;
    double squares = 0;
    for (size_t i = 0; i < image.depth.size() && i < reference.depth.size(); ++i) {
        if (!(image.depth[i] > 0) || !(reference.depth[i] > 0)) continue;
        const double relative = std::abs(double{image.depth[i]} / double{reference.depth[i]} - 1);
        squares += relative * relative;
        depths.push_back(relative);
        const glm::dvec3 m = normalAt(image, i), n = normalAt(reference, i);
        if (glm::length(m) > 0.5 && glm::length(n) > 0.5)
            angles.push_back(std::atan2(glm::length(glm::cross(m, n)), glm::dot(m, n)) * 57.29577951308232);
    }
    e.depthRmse = depths.empty() ? kNone : std::sqrt(squares / static_cast<double>(depths.size()));
    e.depthP99 = quantile(depths, 0.99);
    double sum = 0;
    for (const double v : angles) sum += v;
    e.normalMean = angles.empty() ? kNone : sum / static_cast<double>(angles.size());
    e.normalP95 = quantile(angles, 0.95);
    return e;
}

}  // namespace stipple::study
