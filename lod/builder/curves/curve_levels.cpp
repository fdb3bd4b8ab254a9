// From the curves of the children to those of their parent: fewer vertices, then fewer curves.
//
// Merging: a run of parts becomes one, as long as every point left out is near the chord. Matched by arc length both
// are piecewise linear, so the largest distance lies at a point: |p - q| + |r - rho| bounds the Hausdorff distance of
// the swept balls, and what a ribbon's edge moves by turning is added. Both radii are changed by as much as keeps the
// area (a leaf is thin at both ends). Errors add up level by level.
//
// Stochastic pruning (Cook et al. 2007): where curves are thinner than the error and still too many, those with the
// smallest hash survive, wider by what went (so that the area stays) and with less contrast (a mean of n colours varies
// by 1/sqrt(n)). What wider curves are too wide by is part of the bound; where the lost ones were is a matter of
// chance.
#include <algorithm>
#include <cmath>

#include "lod/builder/curves/curve_work.h"

namespace stipple::lod {
namespace {

constexpr size_t kLongestRun = 64;    ///< parts that are merged into one
constexpr double kFewestKept = 0.25;  ///< of one level
constexpr int kColourStep = 48;       ///< sRGB steps from which colours count as different, as for points

class Merger {
  public:
    Merger(const std::vector<CurvePoint>& points, const std::vector<CurvePart>& children, const CurveLevel& level)
        : points_(points), children_(children), level_(level) {}

    CurveMerge run() {
        CurveMerge out;
        out.standsFor.resize(children_.size());
        for (size_t first = 0; first < children_.size();) {
            size_t end = first + 1;
            while (end < children_.size() && children_[end - 1].b == children_[end].a) ++end;
            mergeChain(first, end, out);
            first = end;
        }
        return out;
    }

  private:
    void mergeChain(size_t first, size_t end, CurveMerge& out) const {
        for (size_t i = first; i < end;) {
            size_t k = i + 1;
            Chord chord;
            chord.radiusA = children_[i].radiusA;
            chord.radiusB = children_[i].radiusB;
            while (k < end && k - i < kLongestRun) {
                const Chord longer = chordOver(i, k + 1);
                if (longer.deviation > level_.tolerance) break;
                chord = longer;
                ++k;
            }
            CurvePart part = children_[i];
            part.b = children_[k - 1].b;
            part.radiusA = chord.radiusA;
            part.radiusB = chord.radiusB;
            part.colourB = children_[k - 1].colourB;
            double below = 0;
            part.octants = 0;
            for (size_t c = i; c < k; ++c) {
                below = std::max(below, children_[c].error);
                part.octants |= children_[c].octants;
                out.standsFor[c] = static_cast<uint32_t>(out.parts.size());
            }
            part.error = below + chord.deviation + level_.rounding;
            out.parts.push_back(part);
            i = k;
        }
    }

    struct Chord {
        double deviation = 0;
        float radiusA = 0, radiusB = 0;
    };

    /// Over children [i, k).
    Chord chordOver(size_t i, size_t k) const {
        const CurvePart &first = children_[i], &last = children_[k - 1];
        const CurvePoint &a = points_[first.a], &b = points_[last.b];
        double whole = 0, area = 0;
        for (size_t c = i; c < k; ++c) {
            const double length = lengthOf(children_[c]);
            whole += length;
            area += 0.5 * length * (double{children_[c].radiusA} + double{children_[c].radiusB});
        }
        const double straight = glm::length(b.p - a.p), mean = 0.5 * (double{first.radiusA} + double{last.radiusB});
        double wider = straight > 0 ? area / straight - mean : 0;
        wider = std::clamp(wider, -std::min(0.5 * level_.tolerance, 0.9 * std::min(first.radiusA, last.radiusB)),
                           0.5 * level_.tolerance);
        Chord chord;
        chord.radiusA = static_cast<float>(first.radiusA + wider);
        chord.radiusB = static_cast<float>(last.radiusB + wider);
        chord.deviation = std::abs(wider);
        const bool isRibbon = a.isRibbon != 0;
        double at = 0;
        for (size_t c = i; c + 1 < k; ++c) {
            at += lengthOf(children_[c]);
            const double u = whole > 0 ? at / whole : 0;
            const CurvePoint& p = points_[children_[c].b];
            const double radius = (1 - u) * chord.radiusA + u * chord.radiusB;
            // Parts that were merged before may end in different radii where they meet.
            double d = glm::length(p.p - glm::mix(a.p, b.p, u)) +
                       std::max(std::abs(children_[c].radiusB - radius), std::abs(children_[c + 1].radiusA - radius));
            if (isRibbon) {
                const glm::dvec3 n = glm::mix(glm::dvec3(a.direction), glm::dvec3(b.direction), u);
                const double length = glm::length(n);
                d += double{std::max(children_[c].radiusB, children_[c + 1].radiusA)} *
                     (length > 0.1 ? glm::length(glm::dvec3(p.direction) - n / length) : 2.0);
            }
            for (uint32_t shift = 0; shift < 24; shift += 8) {
                const double mixed = (1 - u) * (first.colourA >> shift & 255u) + u * (last.colourB >> shift & 255u);
                if (std::abs(mixed - (children_[c].colourB >> shift & 255u)) > kColourStep) d += 0.5 * whole;
            }
            chord.deviation = std::max(chord.deviation, d);
        }
        return chord;
    }
    double lengthOf(const CurvePart& p) const { return glm::length(points_[p.b].p - points_[p.a].p); }

    const std::vector<CurvePoint>& points_;
    const std::vector<CurvePart>& children_;
    const CurveLevel& level_;
};

/// Number of a curve in the order in which curves are left out; has nothing to do with where they are.
uint32_t rankOf(uint32_t curve) {
    uint32_t h = curve * 0x9e3779b1u;
    h ^= h >> 16;
    h *= 0x7feb352du;
    h ^= h >> 15;
    h *= 0x846ca68bu;
    return h ^ h >> 16;
}

void drawLots(const std::vector<CurvePoint>& points, const CurveLevel& level, CurveMerge& merge) {
    std::vector<CurvePart>& parts = merge.parts;
    const auto radiusOf = [](const CurvePart& p) { return double{std::max(p.radiusA, p.radiusB)}; };
    std::vector<uint8_t> isThin(parts.size());
    std::vector<uint32_t> ranks(parts.size()), order;
    for (size_t i = 0; i < parts.size(); ++i) {
        isThin[i] = radiusOf(parts[i]) <= level.thin ? 1 : 0;
        ranks[i] = rankOf(points[parts[i].a].curve);
        if (isThin[i] != 0) order.push_back(ranks[i]);
    }
    const size_t thick = parts.size() - order.size();
    const auto wanted =
        static_cast<size_t>(std::max(kFewestKept * static_cast<double>(order.size()),
                                     static_cast<double>(level.mostParts) - static_cast<double>(thick)));
    if (wanted >= order.size()) return;
    std::nth_element(order.begin(), order.begin() + static_cast<ptrdiff_t>(wanted), order.end());
    const uint32_t limit = order[wanted];
    double areaBefore = 0, areaAfter = 0;
    glm::dvec3 sum(0);
    for (size_t i = 0; i < parts.size(); ++i) {
        if (isThin[i] == 0) continue;
        const CurvePart& p = parts[i];
        const double area = glm::length(points[p.b].p - points[p.a].p) * (double{p.radiusA} + double{p.radiusB});
        areaBefore += area;
        areaAfter += ranks[i] < limit ? area : 0;
        for (int c = 0; c < 3; ++c) sum[c] += area * (p.colourA >> (8 * c) & 255u);
    }
    if (!(areaAfter > 0)) return;
    const auto wider = static_cast<float>(areaBefore / areaAfter);
    const double contrast = 1 / std::sqrt(static_cast<double>(wider));
    const auto softer = [&](uint32_t colour) {
        uint32_t out = 0;
        for (int c = 0; c < 3; ++c) {
            const double mean = sum[c] / areaBefore;
            out |= static_cast<uint32_t>(std::lround(mean + contrast * ((colour >> (8 * c) & 255u) - mean))) << (8 * c);
        }
        return out;
    };
    // All thin parts change at once: the survivors grow when the others go.
    std::vector<CurvePart> kept;
    std::vector<uint32_t> place(parts.size(), kPruned);
    for (size_t i = 0; i < parts.size(); ++i) {
        CurvePart p = parts[i];
        if (isThin[i] != 0) merge.commonError = std::max(merge.commonError, p.error);
        if (isThin[i] != 0 && ranks[i] >= limit) continue;
        if (isThin[i] != 0) {
            merge.commonError = std::max(merge.commonError, p.error + radiusOf(p) * (double{wider} - 1));
            p.radiusA *= wider;
            p.radiusB *= wider;
            p.colourA = softer(p.colourA);
            p.colourB = softer(p.colourB);
        }
        place[i] = static_cast<uint32_t>(kept.size());
        kept.push_back(p);
    }
    for (size_t i = 0; i < parts.size(); ++i)
        if (isThin[i] != 0 && place[i] != kPruned) kept[place[i]].error = merge.commonError;
    for (uint32_t& s : merge.standsFor) s = place[s];
    merge.kept = areaAfter / areaBefore;
    parts = std::move(kept);
}

}  // namespace

CurveMerge mergeParts(const std::vector<CurvePoint>& points, const std::vector<CurvePart>& children,
                      const CurveLevel& level) {
    CurveMerge merge = Merger(points, children, level).run();
    if (merge.parts.size() > level.mostParts) drawLots(points, level, merge);
    return merge;
}

}  // namespace stipple::lod
