#include "lod/builder/mesh/parts_cover.h"

namespace stipple::lod {
namespace {

struct Span {
    double from, to;
};

double unionOf(std::vector<Span>& spans) {
    if (spans.size() < 2) return spans.empty() ? 0 : std::max(0.0, spans[0].to - spans[0].from);
    std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.from < b.from; });
    double sum = 0, reached = -1e300;
    for (const Span& s : spans) {
        sum += std::max(0.0, s.to - std::max(s.from, reached));
        reached = std::max(reached, s.to);
    }
    return sum;
}

/// Corners of triangles, coordinate by coordinate, and what of them is above a direction: long loops over plain arrays.
struct Corners {
    std::array<std::array<std::vector<double>, 3>, 3> at;  ///< by corner and coordinate
    std::array<std::vector<double>, 3> height;             ///< by corner
    bool areTwoSided = true;                               ///< all of them

    void take(const std::vector<CoverTriangle>& triangles) {
        areTwoSided = true;
        for (size_t k = 0; k < 3; ++k) {
            for (size_t c = 0; c < 3; ++c) at.at(k).at(c).resize(triangles.size());
            height.at(k).resize(triangles.size());
        }
        for (size_t i = 0; i < triangles.size(); ++i) {
            areTwoSided = areTwoSided && triangles[i].isTwoSided;
            for (size_t k = 0; k < 3; ++k)
                for (size_t c = 0; c < 3; ++c)
                    at.at(k).at(c)[i] = triangles[i].corners.at(k)[static_cast<glm::length_t>(c)];
        }
    }
    /// Sets heights along `up`; the least and the greatest of them.
    std::pair<double, double> measure(const glm::dvec3& up) {
        double low = 1e300, high = -1e300;
        for (size_t k = 0; k < 3; ++k) {
            const size_t n = height[k].size();
            const double *const x = at[k][0].data(), *const y = at[k][1].data(), *const z = at[k][2].data();
            double* const h = height[k].data();
            for (size_t i = 0; i < n; ++i) h[i] = x[i] * up.x + y[i] * up.y + z[i] * up.z;
            for (size_t i = 0; i < n; ++i) {
                low = h[i] < low ? h[i] : low;
                high = h[i] > high ? h[i] : high;
            }
        }
        return {low, high};
    }
    /// Heights as rows.
    void toRows(double low, double step) {
        for (auto& of : height) {
            double* const h = of.data();
            const size_t n = of.size();
            for (size_t i = 0; i < n; ++i) h[i] = (h[i] - low) / step;
        }
    }
};

/// (What fits into an int; the library's function is a call.)
int ceiling(double v) {
    const int whole = static_cast<int>(v);
    return whole + (v > whole ? 1 : 0);
}

/// Of one direction and the opposite one.
double coverAlong(const std::vector<CoverTriangle>& triangles, Corners& corners, const glm::dvec3& direction,
                  const glm::dvec3& axis, int count, double offset) {
    glm::dvec3 up = axis - glm::dot(axis, direction) * direction;
    const glm::dvec3 other = std::abs(direction.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    up = glm::normalize(glm::length(up) > 1e-3 ? up : glm::cross(direction, other));
    const glm::dvec3 right = glm::cross(up, direction);
    const auto [low, high] = corners.measure(up);
    const double step = (high - low) / count;
    if (!(step > 0)) return 0;
    corners.toRows(low, step);
    // Seen from the front, from behind; both are the same where all is drawn from both sides.
    thread_local std::vector<std::array<std::vector<Span>, 2>> rows;
    rows.resize(std::max(rows.size(), static_cast<size_t>(count)));
    const bool isSame = corners.areTwoSided;
    for (size_t i = 0; i < triangles.size(); ++i) {
        const glm::dvec3 y(corners.height[0][i], corners.height[1][i], corners.height[2][i]);
        const double bottom = std::min(std::min(y.x, y.y), y.z), top = std::max(std::max(y.x, y.y), y.z);
        const int first = std::max(0, ceiling(bottom - offset)), last = std::min(count - 1, ceiling(top - offset) - 1);
        if (first > last) continue;  // between two rows
        const CoverTriangle& t = triangles[i];
        const std::array<glm::dvec2, 3> p{{{glm::dot(t.corners[0], right), y.x},
                                           {glm::dot(t.corners[1], right), y.y},
                                           {glm::dot(t.corners[2], right), y.z}}};
        const glm::dvec2 a = p[1] - p[0], b = p[2] - p[0];
        const bool isFront = a.x * b.y - a.y * b.x > 0;
        for (int r = first; r <= last; ++r) {
            Span span{1e300, -1e300};
            for (size_t k = 0; k < 3; ++k) {
                const glm::dvec2 &c = p.at(k), &d = p.at((k + 1) % 3);
                if ((c.y <= r + offset) == (d.y <= r + offset)) continue;
                const double x = c.x + (r + offset - c.y) / (d.y - c.y) * (d.x - c.x);
                span.from = std::min(span.from, x);
                span.to = std::max(span.to, x);
            }
            if (span.from > span.to) continue;
            auto& row = rows.at(static_cast<size_t>(r));
            if (t.isTwoSided || isFront) row[0].push_back(span);
            if (!isSame && (t.isTwoSided || !isFront)) row[1].push_back(span);
        }
    }
    double sum = 0;
    for (size_t r = 0; r < static_cast<size_t>(count); ++r) {
        const double front = unionOf(rows[r][0]);
        sum += front + (isSame ? front : unionOf(rows[r][1]));
        for (auto& side : rows[r]) side.clear();
    }
    return 0.5 * sum * step;
}

}  // namespace

const std::array<CoverDirection, kCoverDirections>& coverDirections() {
    static const std::array<CoverDirection, kCoverDirections> all = [] {
        constexpr double g = 1.618033988749895, corner = 25.0 / 420, face = 27.0 / 420;
        std::array<CoverDirection, kCoverDirections> out{{{{0, 1, g}, corner},
                                                          {{0, -1, g}, corner},
                                                          {{1, g, 0}, corner},
                                                          {{-1, g, 0}, corner},
                                                          {{g, 0, 1}, corner},
                                                          {{g, 0, -1}, corner},
                                                          {{1, 1, 1}, face},
                                                          {{1, 1, -1}, face},
                                                          {{1, -1, 1}, face},
                                                          {{-1, 1, 1}, face},
                                                          {{0, g, 1 / g}, face},
                                                          {{0, g, -1 / g}, face},
                                                          {{1 / g, 0, g}, face},
                                                          {{-1 / g, 0, g}, face},
                                                          {{g, 1 / g, 0}, face},
                                                          {{g, -1 / g, 0}, face}}};
        for (CoverDirection& d : out) d.to = glm::normalize(d.to);
        return out;
    }();
    return all;
}

double coverOf(const std::vector<CoverTriangle>& triangles, const glm::dvec3& axis, int rows) {
    double sum = 0;
    thread_local Corners corners;
    corners.take(triangles);
    // Rows of different directions lie at different places, so that shapes that all parts share are not all missed.
    for (size_t d = 0; d < kCoverDirections; ++d) {
        const double offset = (static_cast<double>(d * 7 % kCoverDirections) + 0.5) / kCoverDirections;
        sum += coverDirections().at(d).share *
               coverAlong(triangles, corners, coverDirections().at(d).to, axis, rows, offset);
    }
    return sum;
}

}  // namespace stipple::lod
