#include "lod/builder/patches/deviation.h"

#include <algorithm>
#include <cmath>

namespace stipple::lod {
namespace {

constexpr int kMostDivisions = 3;      ///< of a triangle beyond the segment
constexpr int kLookAround = 4;         ///< cells, from one that is not drawn to samples; one farther off, if none
constexpr double kBesideSteps = 1e-9;  ///< of places on lines between cells, samples

/// Raises `bound` where a triangle needs it.
void divide(const MeshSurface& s, const std::array<glm::dvec3, 3>& t, size_t hint, int divided, double& bound) {
    const auto fromOne = [&](size_t one) {
        return std::max({s.distance(t[0], one), s.distance(t[1], one), s.distance(t[2], one)});
    };
    if (fromOne(hint) <= bound) return;
    const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0;
    const double around =
        std::max({glm::distance(t[0], middle), glm::distance(t[1], middle), glm::distance(t[2], middle)});
    const auto [distance, nearest] = s.nearest(middle, hint, bound - around);
    double most = distance + around;
    if (most > bound) most = std::min(most, fromOne(nearest));
    if (most <= bound) return;
    if (divided == kMostDivisions) {
        bound = most;
        return;
    }
    const glm::dvec3 ab = 0.5 * (t[0] + t[1]), bc = 0.5 * (t[1] + t[2]), ca = 0.5 * (t[2] + t[0]);
    divide(s, {ab, bc, ca}, nearest, divided + 1, bound);
    divide(s, {t[0], ab, ca}, nearest, divided + 1, bound);
    divide(s, {ab, t[1], bc}, nearest, divided + 1, bound);
    divide(s, {ca, bc, t[2]}, nearest, divided + 1, bound);
}

/// For each place of the grid a sample not far from it, found row by row and column by column.
std::vector<uint32_t> samplesNear(const Patch& patch) {
    constexpr uint32_t kNone = ~0u;
    std::vector<uint32_t> near(patch.heights.size(), kNone);
    const auto squared = [&](uint32_t of, size_t to) {
        const double x = static_cast<double>(of % patch.width) - static_cast<double>(to % patch.width),
                     y = static_cast<double>(of / patch.width) - static_cast<double>(to / patch.width);
        return of == kNone ? 1e300 : x * x + y * y;
    };
    const auto take = [&](size_t to, size_t from) {
        if (squared(near[from], to) < squared(near[to], to)) near[to] = near[from];
    };
    for (size_t s = 0; s < near.size(); ++s)
        if (patch.heights[s] != 0) near[s] = static_cast<uint32_t>(s);
    const size_t w = patch.width, n = near.size();
    for (size_t s = 1; s < n; ++s)
        if (s % w != 0) take(s, s - 1);
    for (size_t s = n - 1; s-- > 0;)
        if ((s + 1) % w != 0) take(s, s + 1);
    for (size_t s = w; s < n; ++s) take(s, s - w);
    for (size_t s = n - w; s-- > 0;) take(s, s + w);
    return near;
}

class Measure {
  public:
    Measure(const OwnSurface& own, const Patch& patch, const OverPatch& over)
        : own_(own), s_(own.surface), patch_(patch), heights_(patch), surface_(patch), over_(over) {
        above_.assign(patch.cells.size(), 0);
    }

    Deviation run() {
        d_.overOwn = 0.5 * patch_.quantum() + over_.apart;  // at the samples themselves
        for (const uint32_t t : own_.segment) {
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t other = s_.across[t][k];
                const bool isShared = other != MeshSurface::kNobody && own_.owner[other] == own_.self;
                if (!isShared || t < other) alongEdge(s_.at(t, k), s_.at(t, (k + 1) % 3));
            }
            atMiddle(t);
            if (over_.isOpen) undrawn(t);
        }
        d_.toSource = d_.overOwn;
        isOwn_ = false;
        for (const uint32_t t : own_.beyond)
            for (size_t k = 0; k < 3; ++k) alongEdge(s_.at(t, k), s_.at(t, (k + 1) % 3));
        d_.fromSource = d_.overOwn;
        d_.fromSource = std::max(d_.fromSource, undrawn_);
        for (uint32_t j = 0; j + 1 < patch_.height; ++j)
            for (uint32_t i = 0; i + 1 < patch_.width; ++i) {
                if (!patch_.hasCell(i, j)) continue;
                const double above = above_[size_t{j} * (patch_.width - 1) + i];
                // (A step off is another sheet, maybe.)
                const bool isInside = over_.isInside(i, j) && above <= double{patch_.step};
                if (!isInside || above > d_.toSource) {
                    const double bound = divided(i, j);
                    d_.toSource = std::max(d_.toSource, isInside ? std::min(above, bound) : bound);
                }
                if (!isInside || (i + 2 * j) % 4 == 0) atCentre(i, j, isInside ? 4 : 1);
            }
        return d_;
    }

  private:
    /// The difference of heights along an edge of the source is linear between the lines of the grid and diagonals.
    void alongEdge(const glm::dvec3& p, const glm::dvec3& q) {
        glm::dvec3 a = heights_.local(p), b = heights_.local(q);
        if (glm::dot(b, b) < glm::dot(a, a)) std::swap(a, b);  // the far end rounds, the near one does not
        linesAlong(a, b, patch_.width, patch_.height, at_);
        for (size_t k = 0; k + 1 < at_.size(); ++k) piece(a, b, at_[k], at_[k + 1]);
    }
    void piece(const glm::dvec3& a, const glm::dvec3& b, double from, double to) {
        const glm::dvec3 p = a + from * (b - a), q = a + to * (b - a), m = 0.5 * (p + q);
        const double fi = std::floor(m.x), fj = std::floor(m.y);
        if (!(fi >= 0 && fj >= 0 && fi + 1 < patch_.width && fj + 1 < patch_.height) ||
            !patch_.hasCell(static_cast<uint32_t>(fi), static_cast<uint32_t>(fj)))
            return;
        const auto i = static_cast<uint32_t>(fi), j = static_cast<uint32_t>(fj);
        if (!isOwn_ && !over_.isInside(i, j)) return;
        double most = 0;
        const auto compare = [&](const glm::dvec3& at) {
            const double x = std::clamp(at.x, fi + kBesideSteps, fi + 1 - kBesideSteps),
                         y = std::clamp(at.y, fj + kBesideSteps, fj + 1 - kBesideSteps);
            most = std::max(most, std::abs(heights_.at(x, y) - at.z));
        };
        compare(p);
        compare(q);
        const size_t s = patch_.at(i, j);
        const auto& h = patch_.heights;
        const bool rises = cellTriangles(h[s], h[s + 1], h[s + patch_.width], h[s + patch_.width + 1])[2] == 3;
        // Which side of the diagonal each end is on.
        const auto side = [&](const glm::dvec3& at) {
            return rises ? (at.x - fi) - (at.y - fj) : (at.x - fi) + (at.y - fj) - 1;
        };
        const double u = side(p), v = side(q);
        if ((u < 0) != (v < 0) && u != v) compare(p + (u / (u - v)) * (q - p));
        if (isOwn_)
            d_.overOwn = std::max(d_.overOwn, most);
        else
            above_[size_t{j} * (patch_.width - 1) + i] = std::max(above_[size_t{j} * (patch_.width - 1) + i], most);
    }
    /// What a cell's triangles need, and no less than is known.
    double divided(uint32_t i, uint32_t j) const {
        double bound = d_.toSource;
        surface_.trianglesOf(i, j, [&](size_t a, size_t b, size_t c) {
            bound = boundToSource(s_, {surface_.position(a), surface_.position(b), surface_.position(c)},
                                  over_.triangle(a), bound);
        });
        return bound;
    }
    /// What no cell is drawn over, in modes that leave the border open: the part of a triangle over a cell is convex,
    /// so none of it is farther from a sample than its farthest corner is.
    void undrawn(uint32_t t) {
        const std::array<glm::dvec3, 3> q{heights_.local(s_.at(t, 0)), heights_.local(s_.at(t, 1)),
                                          heights_.local(s_.at(t, 2))};
        const auto whole = [](double v) { return static_cast<int>(std::floor(v)); };
        const auto isDrawn = [&](int i, int j) {
            return i >= 0 && j >= 0 && i + 1 < static_cast<int>(patch_.width) &&
                   j + 1 < static_cast<int>(patch_.height) &&
                   patch_.hasCell(static_cast<uint32_t>(i), static_cast<uint32_t>(j));
        };
        const auto [low, high] = std::minmax({q[0].y, q[1].y, q[2].y});
        for (int j = whole(low); j <= whole(high); ++j) {
            row_.assign(q.begin(), q.end());
            cut(row_, 1, j);
            if (row_.empty()) continue;
            const auto byX = [](const glm::dvec3& a, const glm::dvec3& b) { return a.x < b.x; };
            const auto [left, right] = std::minmax_element(row_.begin(), row_.end(), byX);
            const int last = whole(right->x);
            for (int i = whole(left->x); i <= last; ++i) {
                if (isDrawn(i, j)) continue;
                part_ = row_;
                cut(part_, 0, i);
                if (!part_.empty()) undrawn_ = std::max(undrawn_, toSamples(i, j));
            }
        }
    }
    /// A convex polygon to what lies in [at, at + 1] along an axis.
    void cut(std::vector<glm::dvec3>& polygon, int axis, double at) {
        for (const double side : {1.0, -1.0}) {
            const double line = side > 0 ? at : at + 1;
            const auto inside = [&](const glm::dvec3& p) { return side * (p[axis] - line); };
            cut_.clear();
            for (size_t k = 0; k < polygon.size(); ++k) {
                const glm::dvec3 &p = polygon[k], &q = polygon[(k + 1) % polygon.size()];
                const double u = inside(p), v = inside(q);
                if (u >= 0) cut_.push_back(p);
                if ((u < 0 && v > 0) || (u > 0 && v < 0)) cut_.push_back(p + (u / (u - v)) * (q - p));
            }
            polygon.swap(cut_);
        }
    }
    /// From the part over a cell to the sample that is nearest to all of it.
    double toSamples(int i, int j) {
        double least = 1e300;
        const auto offer = [&](int x, int y) {
            const uint16_t code = patch_.heights[patch_.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y))];
            if (code == 0) return;
            double most = 0;
            for (const glm::dvec3& p : part_)
                most = std::max(most,
                                glm::length(glm::dvec3((p.x - x) * double{patch_.step}, (p.y - y) * double{patch_.step},
                                                       p.z - code * patch_.quantum())));
            least = std::min(least, most);
        };
        const int w = static_cast<int>(patch_.width), h = static_cast<int>(patch_.height);
        for (int y = std::max(0, j - kLookAround); y <= std::min(h - 1, j + kLookAround + 1); ++y)
            for (int x = std::max(0, i - kLookAround); x <= std::min(w - 1, i + kLookAround + 1); ++x) offer(x, y);
        if (least < 1e300) return least;
        if (near_.empty()) near_ = samplesNear(patch_);
        const uint32_t far = near_[patch_.at(static_cast<uint32_t>(std::clamp(i, 0, w - 1)),
                                             static_cast<uint32_t>(std::clamp(j, 0, h - 1)))];
        offer(static_cast<int>(far % patch_.width), static_cast<int>(far / patch_.width));
        return least;
    }

    void atMiddle(uint32_t t) {
        const glm::dvec3 q = heights_.local(s_.elements.centre[t]);
        const double height = heights_.at(q.x, q.y);
        if (!(height == height)) return;
        const double facing = glm::dot(glm::dvec3(s_.elements.normal[t]), surface_.frame()[2]);
        const double d = (height - q.z) * facing;
        d_.fromSourceSquares += s_.elements.area[t] * d * d;
        d_.fromSourceWeight += s_.elements.area[t];
    }

    void atCentre(uint32_t i, uint32_t j, double weight) {
        const size_t s = patch_.at(i, j);
        const glm::dvec3 middle = 0.5 * (surface_.position(s) + surface_.position(s + patch_.width + 1));
        const double d = s_.nearest(middle, over_.triangle(s)).first;
        const double area = double{patch_.step} * double{patch_.step} * weight;
        d_.toSourceSquares += area * d * d;
        d_.toSourceWeight += area;
    }

    const OwnSurface& own_;
    const MeshSurface& s_;
    const Patch& patch_;
    PatchHeights heights_;
    PatchSurface surface_;
    const OverPatch& over_;
    std::vector<double> above_;  ///< of cells: the most that heights differ from what is beyond the segment
    bool isOwn_ = true;          ///< the triangles that are looked at
    Deviation d_;
    double undrawn_ = 0;
    std::vector<double> at_;
    std::vector<glm::dvec3> row_, part_, cut_;  ///< polygons
    std::vector<uint32_t> near_;                ///< of `samplesNear`, once one is asked for
};

}  // namespace

void linesAlong(const glm::dvec2& a, const glm::dvec2& b, uint32_t width, uint32_t height, std::vector<double>& at) {
    at.assign({0, 1});
    for (int axis = 0; axis < 2; ++axis) {
        const double last = static_cast<double>(axis == 0 ? width : height) - 1;
        const double from = std::max(std::ceil(std::min(a[axis], b[axis])), 0.0),
                     to = std::min(std::max(a[axis], b[axis]), last);
        if (a[axis] == b[axis]) continue;
        for (double line = from; line <= to; ++line)
            at.push_back(std::clamp((line - a[axis]) / (b[axis] - a[axis]), 0.0, 1.0));
    }
    std::sort(at.begin(), at.end());
}

double boundToSource(const MeshSurface& surface, const std::array<glm::dvec3, 3>& triangle, size_t hint,
                     double atLeast) {
    divide(surface, triangle, hint, 0, atLeast);
    return atLeast;
}

Deviation deviationOf(const OwnSurface& own, const Patch& patch, const OverPatch& over) {
    return Measure(own, patch, over).run();
}

}  // namespace stipple::lod
