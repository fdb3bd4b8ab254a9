#include "lod/builder/patches/moving_least_squares.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/numbers.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr size_t kNeighbours = 16, kFewest = 5, kForQuadratic = 10;
constexpr double kUsualReach = 2.5, kReach = 4;  ///< spacings, of neighbours; the farther where there are few
constexpr double kSupport = 1.5;                 ///< h, spacings
constexpr double kSameSide = 0.3;                ///< cosine between normals of one sheet
constexpr double kSheet = 0.75;                  ///< h, from the plane of the guide
constexpr double kBesideBorder = 0.7;            ///< spacings, as far as the surface goes on beyond its last points
constexpr double kSteepest = 3.732;              ///< tan 75 degrees
constexpr double kLoose = 0.25;                  ///< h, of the weighted residuals
constexpr int kMostMoves = 10;
constexpr double kAtRest = 1e-6;  ///< h
constexpr double kFlat = 1e-8;    ///< least pivot over the largest

/// Places in units of h: along U, V and N, about the place that was asked about.
struct Fitted {
    static constexpr size_t kRoom = NearPoints::kMost;
    double x[kRoom], y[kRoom], z[kRoom];  // NOLINT: set as far as they are read
    double inPlane[kRoom];                // NOLINT: exp(-(x^2 + y^2))
    double weight[kRoom];                 // NOLINT
    uint32_t index[kRoom];                // NOLINT: points
    size_t n = 0;
};

constexpr size_t kMostTerms = 6;  ///< 1, x, y, x^2, x y, y^2
using Terms = std::array<double, kMostTerms>;

/// Weighted normal equations of the first `terms` of them; the matrix's lower half.
void accumulate(const Fitted& f, std::array<Terms, kMostTerms>& m, Terms& right) {
    for (size_t k = 0; k < f.n; ++k) {
        const double x = f.x[k], y = f.y[k], w = f.weight[k];
        const double wx = w * x, wy = w * y, xx = wx * x, xy = wx * y, yy = wy * y;
        const double xxx = xx * x, xxy = xx * y, xyy = xy * y, yyy = yy * y;
        const std::array<double, kMostTerms> t{w, wx, wy, xx, xy, yy};
        for (size_t i = 0; i < kMostTerms; ++i) {
            m[i][0] += t[i];
            right[i] += t[i] * f.z[k];
        }
        m[1][1] += xx;
        m[2][1] += xy;
        m[2][2] += yy;
        m[3][1] += xxx;
        m[3][2] += xxy;
        m[4][2] += xyy;
        m[5][2] += yyy;
        m[3][3] += xxx * x;
        m[4][3] += xxx * y;
        m[4][4] += xxy * y;
        m[5][4] += xyy * y;
        m[5][5] += yyy * y;
    }
    m[4][1] = m[3][2];
    m[5][1] = m[4][2];
    m[5][3] = m[4][4];
}

/// By Cholesky; false where the points say too little. (Coordinates are of the order of 1, so that pivots tell.)
bool solve(const Fitted& f, size_t terms, Terms& c) {
    std::array<Terms, kMostTerms> m{};
    Terms right{};
    accumulate(f, m, right);
    const double largest = m[0][0];
    for (size_t i = 0; i < terms; ++i) {
        for (size_t j = 0; j <= i; ++j) {
            double v = m[i][j];
            for (size_t k = 0; k < j; ++k) v -= m[i][k] * m[j][k];
            if (i == j) {
                if (!(v > kFlat * largest)) return false;
                m[i][i] = std::sqrt(v);
            } else {
                m[i][j] = v / m[j][j];
            }
        }
        for (size_t k = 0; k < i; ++k) right[i] -= m[i][k] * right[k];
        right[i] /= m[i][i];
    }
    c = {};
    for (size_t i = terms; i-- > 0;) {
        c[i] = right[i];
        for (size_t k = i + 1; k < terms; ++k) c[i] -= m[k][i] * c[k];
        c[i] /= m[i][i];
    }
    return true;
}

/// Do the points leave half of all directions in the plane empty?
bool isOneSided(const Fitted& f) {
    uint32_t sectors = 0;
    for (size_t k = 0; k < f.n; ++k) {
        const double x = f.x[k], y = f.y[k];
        const uint32_t sector = (x < 0 ? 4u : 0u) | (y < 0 ? 2u : 0u) | (std::abs(x) < std::abs(y) ? 1u : 0u);
        // In their order around: 0, 1, 5, 4, 6, 7, 3, 2.
        static constexpr std::array<uint32_t, 8> kAround{0, 1, 7, 6, 3, 2, 4, 5};
        sectors |= 1u << kAround.at(sector);
    }
    uint32_t empty = ~sectors & 255u;
    empty |= empty << 8;
    return (empty & empty >> 1 & empty >> 2 & empty >> 3) != 0;
}

/// Weights of distances from (0, 0, height), times whatever makes the largest 1 or less.
void weigh(double height, Fitted& f) {
    for (size_t k = 0; k < f.n; ++k) {
        const double d = f.z[k] - height;
        f.weight[k] = f.inPlane[k] * std::exp(-d * d);
    }
}

double looseness(const Fitted& f, const Terms& c) {
    double sum = 0, weights = 0;
    for (size_t k = 0; k < f.n; ++k) {
        const double x = f.x[k], y = f.y[k];
        const double r = f.z[k] - (c[0] + x * (c[1] + c[3] * x + c[4] * y) + y * (c[2] + c[5] * y));
        sum += f.weight[k] * r * r;
        weights += f.weight[k];
    }
    return std::sqrt(sum / weights);
}

/// The points of the guide's sheet around a place.
void gather(const PointSurface& s, const glm::dvec3& place, const glm::dmat3& frame, uint32_t guide, double h,
            Fitted& f) {
    const glm::dvec3 sheet(s.elements.normal[guide]), from = s.elements.centre[guide];
    const glm::dmat3 toLocal = glm::transpose(frame) * (1 / h);
    NearPoints::Found near;
    for (const double reach : {kUsualReach, kReach}) {
        const double limit = reach * static_cast<double>(s.spacing[guide]);
        s.near.find(place, kNeighbours, toFloat(limit * limit), near);
        f.n = 0;
        double least = 1e300;
        for (size_t k = 0; k < near.count; ++k) {
            const uint32_t i = near.index[k];
            const glm::dvec3& p = s.elements.centre[i];
            if (s.isSurface[i] == 0 || !(glm::dot(glm::dvec3(s.elements.normal[i]), sheet) > kSameSide) ||
                !(std::abs(glm::dot(p - from, sheet)) <= kSheet * h))
                continue;
            const glm::dvec3 q = toLocal * (p - place);
            f.x[f.n] = q.x;
            f.y[f.n] = q.y;
            f.z[f.n] = q.z;
            f.index[f.n] = i;
            f.inPlane[f.n] = q.x * q.x + q.y * q.y;
            least = std::min(least, f.inPlane[f.n]);
            ++f.n;
        }
        for (size_t k = 0; k < f.n; ++k) f.inPlane[k] = std::exp(least - f.inPlane[k]);
        if (f.n >= kForQuadratic) return;
    }
}

const std::array<float, 256>& linearTable() {
    static const std::array<float, 256> kTable = [] {
        std::array<float, 256> t{};
        for (size_t k = 0; k < 256; ++k) t.at(k) = shared::linearFromSrgb(static_cast<float>(k) / 255.0f);
        return t;
    }();
    return kTable;
}

}  // namespace

bool leastSquaresAt(const PointSurface& s, const glm::dvec3& place, const glm::dmat3& frame, uint32_t guide,
                    LeastSquaresSample& sample) {
    const auto spacing = static_cast<double>(s.spacing[guide]);
    const double h = kSupport * spacing;
    if (!(h > 0)) return false;
    Fitted f;
    gather(s, place, frame, guide, h, f);
    if (f.n < kFewest) return false;
    const bool isBorder = isOneSided(f);
    size_t terms = f.n >= kForQuadratic && !isBorder ? 6 : 3;
    double height = 0;
    Terms c{};
    for (int move = 0;; ++move) {
        if (move == kMostMoves) return false;
        weigh(height, f);
        if (!solve(f, terms, c)) {
            if (terms == 3) return false;
            terms = 3;
            continue;
        }
        const double moved = c[0] - height;
        height = c[0];
        if (!(std::abs(height) <= 1)) return false;
        if (std::abs(moved) < kAtRest) break;
    }
    if (c[1] * c[1] + c[2] * c[2] > kSteepest * kSteepest || looseness(f, c) > kLoose) return false;
    double closest = 1e300;
    for (size_t k = 0; k < f.n; ++k) {
        const double distance = glm::length(glm::dvec3(f.x[k], f.y[k], f.z[k] - height));
        if (distance >= closest) continue;
        closest = distance;
        sample.nearestPoint = f.index[k];
    }
    if (isBorder && closest * h > kBesideBorder * spacing) return false;
    sample.height = height * h;
    sample.slope = {c[1], c[2]};
    sample.nearest = closest * h;
    if (s.colour.empty()) return true;
    glm::dvec3 sum(0);
    double weights = 0;
    for (size_t k = 0; k < f.n; ++k) {
        const uint32_t rgb = s.colour[f.index[k]];
        const auto& linear = linearTable();
        sum += f.weight[k] * glm::dvec3(linear.at(rgb & 255u), linear.at(rgb >> 8 & 255u), linear.at(rgb >> 16 & 255u));
        weights += f.weight[k];
    }
    sample.colour = glm::vec3(sum / weights);
    return true;
}

}  // namespace stipple::lod
