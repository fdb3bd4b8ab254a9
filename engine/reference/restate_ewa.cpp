// Mode ewa once more, in fp64: every disc against every pixel that it may reach. The image of the circle is found from
// the homography between image and disc, not from the closed form that the backends use.
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/reference/restate_discs.h"
#include "shaders/shared/border.h"
#include "shaders/shared/surface.h"

namespace stipple::reference {
namespace {

using glm::dmat2;
using glm::dvec2;
using glm::dvec3;

constexpr double kNone = std::numeric_limits<double>::infinity();

/// An ellipse on the image: variances about its middle, px.
struct Ellipse {
    bool isThere = false;
    dvec2 middle{0};
    dmat2 variance{0};
};

/// The image of the circle of `radius` about a disc's centre, as that of a Gaussian that ends there at `support`
/// sigmas.
Ellipse imageOfCircle(const lod::View& view, const PlacedDisc& d, double radius, double support) {
    const dvec3 aside = std::abs(d.normal.x) < 0.7 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
    const dvec3 s = glm::normalize(glm::cross(d.normal, aside)), t = glm::cross(d.normal, s);
    // Where the ray of an image point meets the disc's plane, from the centre along s and t, times the third: all
    // three are linear in the point.
    const dvec2 principal = view.principal();
    const auto onDisc = [&](const dvec2& point) {
        const ViewRay ray = viewRay(view, principal + point);
        const double facing = glm::dot(d.normal, ray.direction);
        const dvec3 off = facing * (ray.origin - d.centre) + ray.direction * glm::dot(d.normal, d.centre - ray.origin);
        return dvec3(glm::dot(off, s), glm::dot(off, t), facing);
    };
    const dvec3 h0 = onDisc({0, 0}), hx = onDisc({1, 0}) - h0, hy = onDisc({0, 1}) - h0;
    const auto form = [&](const dvec3& a, const dvec3& b) {
        return a.x * b.x + a.y * b.y - radius * radius * a.z * b.z;
    };
    const dmat2 m(form(hx, hx), form(hx, hy), form(hx, hy), form(hy, hy));
    const dvec2 b(form(h0, hx), form(h0, hy));
    const double det = glm::determinant(m);
    Ellipse e;
    if (!(det > 0) || !(m[0][0] > 0)) return e;
    e.middle = -(glm::inverse(m) * b);
    const double size = -(form(h0, h0) + glm::dot(b, e.middle));
    if (!(size > 0)) return e;
    e.isThere = true;
    e.variance = glm::inverse(m) * (size / (support * support));
    return e;
}

/// Kernels of one surface at a pixel.
struct Sums {
    const PlacedDisc* first = nullptr;  ///< of those that reach it
    double weight = 0, linear = 0;
    dvec3 colour{0}, normal{0};
    double share = 0, metallic = 0, roughness = 0;  ///< of materials
};
/// A surface at a pixel that is opaque there.
struct Front {
    double limit = kNone;  ///< what lies beyond is no part of it
    const PlacedDisc* disc = nullptr;
    double depth = 0;
    bool isMissed = false;  ///< the pixel's ray does not meet it
    bool isSurface() const { return disc != nullptr && (disc->flags & shared::kFlagLeaf) == 0; }
    /// What lies before that is no part of it, either. (Leaves are no surface.)
    double begin() const { return isSurface() ? depth - (limit - depth) : -kNone; }
};
/// What a pixel has gathered.
struct Gathered {
    Front front, second;  ///< the second begins behind the first
    Sums ofFront, before, behind;
    Sums beforeOther;  ///< before another kind's surface
    bool hasBehind = false;
};

class Filter {
  public:
    Filter(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level,
           const BlendVariation& variation)
        : view_(draws.view),
          variation_(variation),
          support_(double{draws.frame.kernelSupport}),
          lowPass_(double{draws.frame.lowPass}),
          isPerSurfel_(draws.frame.perSurfel != 0),
          level_(level),
          pixels_(level.samples.size()) {
        for (const PlacedDisc& d : discs) {
            PlacedDisc sized = d;
            if ((d.flags & shared::kFlagNoNormal) != 0 && !(d.centre.z > view_.nearPlane)) continue;
            sized.radius = std::max(d.radius, std::min(1.0275 * d.spacing, 1.5 * d.radius));
            if ((d.flags & shared::kFlagScattered) != 0)
                sized.radius = std::min(
                    sized.radius, std::max(view_.height / 128.0, 4.0) / pixelsAt(view_, std::max(d.centre.z, 1e-300)));
            discs_.push_back(sized);
        }
    }

    void run() {
        others_ = level_.samples;
        for (const PlacedDisc& d : discs_) findFronts(d);
        for (const PlacedDisc& d : discs_) findSeconds(d);
        for (const PlacedDisc& d : discs_) add(d);
        show();
        showSeconds();
    }

  private:
    bool isOnImage(int x, int y) const { return x >= 0 && y >= 0 && x < level_.width && y < level_.height; }
    Gathered& pixel(int x, int y) {
        return pixels_[static_cast<size_t>(y) * static_cast<size_t>(level_.width) + static_cast<size_t>(x)];
    }
    static double roughness(const PlacedDisc& d) {
        return d.radius * ((d.flags & shared::kFlagLeaf) != 0 ? 1.0 / 12 : 4.0 / 3);
    }
    double depthOnPlane(const PlacedDisc& d, const ViewRay& ray) const {
        return glm::dot(d.normal, d.centre - ray.origin) / glm::dot(d.normal, ray.direction);
    }
    bool isMet(const PlacedDisc& d, const ViewRay& ray, double depth) const {
        const dvec3 off = ray.at(depth) - d.centre;
        return depth > view_.nearPlane && glm::dot(off, off) <= d.radius * d.radius;
    }
    /// Pixels that a sphere about the disc may reach; all where it is not before the eye.
    template <typename Use>
    void forPixels(const PlacedDisc& d, double radius, double margin, const Use& use) {
        int x0 = 0, y0 = 0, x1 = level_.width - 1, y1 = level_.height - 1;
        if (view_.isOrthographic || d.centre.z > 1.2 * radius) {
            const double nearest = view_.isOrthographic ? 1 : d.centre.z - radius;
            const double most =
                margin + 2 +
                pixelsAt(view_, nearest) * radius * (view_.isOrthographic ? 1 : glm::length(d.centre) / d.centre.z);
            const dvec2 p = imageOf(view_, d.centre);
            const auto clamp = [](double v, int last) { return static_cast<int>(std::clamp(v, -1.0, last + 1.0)); };
            x0 = std::max(0, clamp(p.x - most, x1));
            y0 = std::max(0, clamp(p.y - most, y1));
            x1 = std::min(x1, clamp(p.x + most, x1));
            y1 = std::min(y1, clamp(p.y + most, y1));
        }
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) use(x, y, viewRay(view_, dvec2(x + 0.5, y + 0.5)));
    }

    /// Between which depths the plane of a disc counts: as far as its kernel and the low-pass reach on it.
    struct Range {
        double nearest, farthest;
    };
    Range rangeOf(const PlacedDisc& d) const {
        const double facing = std::abs(glm::dot(d.normal, sightOf(view_, d.centre)));
        const double pixelSize = d.centre.z > 0 || view_.isOrthographic ? 1 / pixelsAt(view_, d.centre.z) : 0;
        const double reach = support_ * (d.radius / 1.5 + std::sqrt(lowPass_) * pixelSize / std::max(facing, 1.0 / 32));
        const double slab = reach * std::sqrt(std::max(0.0, 1 - d.normal.z * d.normal.z));
        const double nearest = std::max(d.centre.z - slab, 1e-3 * std::abs(d.centre.z) + 1e-30);
        return {nearest, std::max(d.centre.z + slab, nearest)};
    }
    /// Beyond the horizon of its plane (behind the eye) it is as far as it gets.
    double depthWithin(const Range& range, const PlacedDisc& d, const ViewRay& ray) const {
        const double plane = depthOnPlane(d, ray);
        return plane > 0 ? std::clamp(plane, range.nearest, range.farthest) : range.farthest;
    }

    void offer(Front& front, const PlacedDisc& d, const ViewRay& ray, double depth, bool isMissed = false) const {
        const double limit = depth + (variation_.movesDiscsAway ? 0 : roughness(d) / glm::length(ray.direction));
        if (limit < front.limit) front = {limit, &d, depth, isMissed};
    }
    void findSeconds(const PlacedDisc& d) {
        forPixels(d, d.radius, 0, [&](int x, int y, const ViewRay& ray) {
            Gathered& p = pixel(x, y);
            const double depth = depthOnPlane(d, ray);
            if (!isMet(d, ray, depth) || !(depth > p.front.limit)) return;
            p.hasBehind = true;
            offer(p.second, d, ray, depth);
        });
    }
    void findFronts(const PlacedDisc& disc) {
        PlacedDisc d = disc;
        if (variation_.movesDiscsAway) d.centre.z += roughness(d);
        forPixels(d, d.radius, 0, [&](int x, int y, const ViewRay& ray) {
            const double depth = depthOnPlane(d, ray);
            if (isMet(d, ray, depth)) offer(pixel(x, y).front, disc, ray, depth);
        });
        if (!(d.centre.z > view_.nearPlane)) return;
        const dvec2 c = imageOf(view_, d.centre);
        if (!(c.x >= 0 && c.y >= 0 && c.x < level_.width && c.y < level_.height)) return;
        const int x = static_cast<int>(c.x), y = static_cast<int>(c.y);
        const ViewRay ray = viewRay(view_, dvec2(x + 0.5, y + 0.5));
        if (!isMet(d, ray, depthOnPlane(d, ray)))
            offer(pixel(x, y).front, disc, ray, depthWithin(rangeOf(d), d, ray), true);
    }

    void add(const PlacedDisc& d) {
        const double sigma = d.radius / 1.5, radius = support_ * sigma, end = std::exp(-0.5 * support_ * support_);
        const double lean2 = std::max(0.0, 1 - d.normal.z * d.normal.z);
        const Range range = rangeOf(d);
        const bool isNear =
            !view_.isOrthographic && !(d.centre.z > 0 && lean2 * radius * radius < 0.95 * d.centre.z * d.centre.z);
        const Ellipse e = isNear ? Ellipse{} : imageOfCircle(view_, d, radius, support_);
        if (!isNear && !e.isThere) return;  // edge-on: it has no area
        const bool isBlended = isNear || d.centre.z > view_.nearPlane;
        const dmat2 wide = e.variance + dmat2(lowPass_);
        const double amplitude = isNear       ? 1
                                 : !isBlended ? 0
                                              : std::sqrt(glm::determinant(e.variance) / glm::determinant(wide));
        // Weights were measured for kernels of two sigmas.
        const double scale = !isPerSurfel_  ? 1
                             : d.weight > 0 ? d.weight * onGrid(2) / onGrid(support_)
                                            : 1 / onGrid(support_);
        const dmat2 inverse = isNear ? dmat2(1) : glm::inverse(wide);
        const dvec2 principal = view_.principal();
        forPixels(d, radius, support_ * std::sqrt(lowPass_), [&](int x, int y, const ViewRay& ray) {
            const dvec2 off = dvec2(x + 0.5, y + 0.5) - principal - e.middle;
            const double plane = depthOnPlane(d, ray);
            const dvec3 onPlane = ray.at(plane) - d.centre;
            double rho2 = glm::dot(off, inverse * off);
            if (isNear) rho2 = plane > view_.nearPlane ? glm::dot(onPlane, onPlane) / (sigma * sigma) : kNone;
            const double depth = depthWithin(range, d, ray);
            if (!(rho2 < support_ * support_)) return;
            const double w = scale * amplitude * (std::exp(-0.5 * rho2) - end) / (1 - end);
            if (!(w > 0)) return;
            Gathered& p = pixel(x, y);
            if (depth < p.front.begin())
                addTo(p.before, d, w, depth);
            else if (depth <= p.front.limit)
                addTo(p.ofFront, d, w, depth);
            else if (depth <= p.second.limit)
                addTo(p.behind, d, w, depth);
            // Those of its border are part of what they border on.
            const double margin = roughness(d) / glm::length(ray.direction);
            const bool isBorder = (d.flags & shared::kFlagBorder) != 0;
            if (depth + (isBorder ? -margin : margin) < depthOfOther(index(x, y))) addTo(p.beforeOther, d, w, depth);
        });
    }
    void addTo(Sums& p, const PlacedDisc& d, double w, double depth) const {
        if (!p.first) p.first = &d;
        p.weight += w;
        p.linear += view_.isOrthographic ? w * depth : w / depth;
        p.colour += w * d.colour;
        if (d.material) {
            p.share += w;
            p.metallic += w * double{d.material->metallic};
            p.roughness += w * double{d.material->roughness};
        }
        p.normal += w * (glm::dot(d.normal, sightOf(view_, d.centre)) > 0 ? -d.normal : d.normal);
    }
    /// Of another kind's surface at a pixel.
    double depthOfOther(size_t i) const {
        const Sample& s = others_[i];
        return !s.valid ? kNone : s.isTriangle ? s.depth : s.key;
    }

    /// Has the pixel, or one of its eight neighbours, nothing opaque?
    bool isAtGap(int x, int y) {
        for (int j = y - 1; j <= y + 1; ++j)
            for (int i = x - 1; i <= x + 1; ++i)
                if (isOnImage(i, j) && !others_[index(i, j)].valid && pixel(i, j).front.disc == nullptr) return true;
        return false;
    }
    /// Or is one of them deeper than that?
    bool isAtJump(int x, int y, double limit) {
        for (int j = y - 1; j <= y + 1; ++j)
            for (int i = x - 1; i <= x + 1; ++i)
                if (isOnImage(i, j) && shown_[index(i, j)] > limit) return true;
        return isAtGap(x, y);
    }
    size_t index(int x, int y) const {
        return static_cast<size_t>(y) * static_cast<size_t>(level_.width) + static_cast<size_t>(x);
    }

    /// What kernels of a square grid add up to, whose sigma is 0.685 of its spacing.
    static double onGrid(double support) {
        const double end = std::exp(-0.5 * support * support);
        const double kept = 1 - 0.5 * support * support * end / (1 - end);
        return 2 * 3.14159265358979 * 0.685 * 0.685 * kept;
    }
    double dividedBy(double weight, double grid) const {
        if (!variation_.isNormalised) return grid;
        return isPerSurfel_ ? std::min(weight, 1.0) : weight;
    }

    double grid() const { return isPerSurfel_ ? 1 : onGrid(support_); }
    double coveredBy(const Sums& sums) const { return std::min(1.0, sums.weight / grid()); }
    /// Does the front stand before what other kinds have there?
    bool wins(size_t i) const { return pixels_[i].front.disc && pixels_[i].front.limit < depthOfOther(i); }

    /// Within half a pixel of the front disc; of one that the ray misses, and of a rim, no place beyond the disc.
    double shownDepth(double blended, const PlacedDisc& d, const Front& front, const ViewRay& ray) const {
        if (front.disc && !front.isMissed) {
            const double most = 0.5 / (pixelsAt(view_, front.depth) * glm::length(ray.direction));
            return std::clamp(blended, front.depth - most, front.depth + most);
        }
        const double reach = d.radius * std::sqrt(std::max(0.0, 1 - d.normal.z * d.normal.z));
        const double place = std::clamp(front.disc ? front.depth : blended, d.centre.z - reach, d.centre.z + reach);
        return front.disc ? place : std::max(place, view_.nearPlane);
    }
    Sample shownBy(int x, int y, const Sums& p, const Front& front) const {
        const PlacedDisc& d = front.disc ? *front.disc : *p.first;
        const dvec2 at(x + 0.5, y + 0.5);
        const bool isLeaf = (d.flags & shared::kFlagLeaf) != 0;
        if (!(p.weight > 1.0 / 1024)) {
            const dvec3 n = glm::dot(d.normal, sightOf(view_, d.centre)) > 0 ? -d.normal : d.normal;
            Sample s = shownPixel(view_, at, front.depth, n, d.colour, isLeaf);
            setMaterial(s, d.material);
            return s;
        }
        Sample s = shownPixel(view_, at, view_.isOrthographic ? p.linear / p.weight : p.weight / p.linear,
                              glm::normalize(p.normal), p.colour / dividedBy(p.weight, grid()), isLeaf);
        s.materialShare = p.share / p.weight;
        if (p.share > 0) {
            s.metallic = p.metallic / p.share;
            s.roughness = p.roughness / p.share;
        }
        return s;
    }

    void show() {
        shown_.assign(pixels_.size(), kNone);
        for (int y = 0; y < level_.height; ++y)
            for (int x = 0; x < level_.width; ++x) {
                const size_t i = index(x, y);
                const Gathered& p = pixels_[i];
                const bool isOther = others_[i].valid, isFront = wins(i);
                shown_[i] = depthOfOther(i);
                const double covered = std::min(1.0, (p.ofFront.weight + p.before.weight) / grid());
                if (!isFront && (p.front.disc || isOther || !p.ofFront.first || covered < 0.5 / 255)) continue;
                Sample& s = level_.ref(x, y);
                s = shownBy(x, y, p.ofFront, p.front);
                const PlacedDisc& first = p.front.disc ? *p.front.disc : *p.ofFront.first;
                s.depth = s.key = shownDepth(s.depth, first, p.front, viewRay(view_, dvec2(x + 0.5, y + 0.5)));
                shown_[i] = s.depth;
                const bool isBefore = isFront && (p.hasBehind || isOther);
                if (!isBefore && isAtGap(x, y)) s.coverage = covered;
            }
    }

    /// Where fronts end: what is behind them; before what is shown: rims that are not opaque.
    void showSeconds() {
        for (int y = 0; y < level_.height; ++y)
            for (int x = 0; x < level_.width; ++x) {
                const size_t i = index(x, y);
                const Gathered& p = pixels_[i];
                const bool isFront = wins(i);
                if (!isFront && !others_[i].valid) continue;
                const Sums& before = isFront ? p.before : p.beforeOther;
                const double covered = coveredBy(p.ofFront), rims = coveredBy(before);
                // Whichever is more of the pixel: there is one.
                const bool isOpen =
                    isFront && (p.hasBehind || others_[i].valid) && 1 - covered >= std::max(rims, 1.0 / 64);
                if (!isOpen && rims >= 1.0 / 64) level_.seconds[i] = {shownBy(x, y, before, {}), rims, false};
                if (!isOpen || !p.front.isSurface() || !isAtJump(x, y, p.front.limit)) continue;
                if (p.second.disc && p.second.limit < depthOfOther(i)) {
                    level_.seconds[i] = {shownBy(x, y, p.behind, p.second), 1 - covered, false};
                } else if (others_[i].valid) {
                    level_.seconds[i] = {level_.samples[i], covered, true};
                    level_.samples[i] = others_[i];
                }
            }
    }

    const lod::View& view_;
    BlendVariation variation_;
    double support_, lowPass_;
    bool isPerSurfel_;
    Level& level_;
    std::vector<Gathered> pixels_;
    std::vector<PlacedDisc> discs_;
    std::vector<Sample> others_;  ///< of other kinds
    std::vector<double> shown_;   ///< depths
};

}  // namespace

void blendDiscs(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level,
                const BlendVariation& variation) {
    Filter(draws, discs, level, variation).run();
}

}  // namespace stipple::reference
