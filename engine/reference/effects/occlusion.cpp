// Ambient occlusion of the reconstructed surface, restated: the same places are looked up; what of them hides how much
// is computed anew, by angles and their integrals, and by planes that rays meet.
#include <array>

#include "engine/reference/decode.h"
#include "engine/reference/effects/effects.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/occlusion.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

constexpr double kPi = 3.14159265358979323846;
/// The pattern: where in the order of 16 each pixel of 4 x 4 is, rows from above.
constexpr std::array<std::array<int, 4>, 4> kOrder{{{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}}};
constexpr int kSteps = 2;
constexpr double kMostPixels = 128, kTolerance = 0.25, kOpenWeight = 1e-3, kLeastSine = 0.1;

struct Asked {
    bool isThere = false;
    dvec3 place{0}, normal{0};
    double depth = 0, pixels = 0;  ///< pixels: of a world unit
    double open = 1;
};

class Occlusion {
  public:
    Occlusion(const render::DrawList& draws, const Level& level)
        : view_(draws.view),
          radius_(draws.tableAt<shared::OcclusionConstants>(shared::kOcclusionBinding)->radius),
          edge_(static_cast<int>(draws.tableAt<shared::OcclusionConstants>(shared::kOcclusionBinding)->edge)),
          width_((level.width + edge_ - 1) / edge_),
          height_((level.height + edge_ - 1) / edge_) {
        asked_.reserve(static_cast<size_t>(width_) * static_cast<size_t>(height_));
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x) asked_.push_back(surfaceAt(level, x * edge_, y * edge_));
        std::vector<double> open;
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x) open.push_back(lightAt(x, y));
        keep(open);
        for (const int isDown : {0, 1}) {
            open.clear();
            for (int y = 0; y < height_; ++y)
                for (int x = 0; x < width_; ++x) open.push_back(meanAt(x, y, 1 - isDown, isDown));
            keep(open);
        }
    }

    /// At any pixel of the picture, of those asked about it.
    double at(const Level& level, int x, int y) const {
        const Asked own = surfaceAt(level, x, y);
        if (!own.isThere) return 1;
        double sum = kOpenWeight, weights = kOpenWeight;
        const dvec2 place = dvec2(x, y) / double(edge_), low = glm::floor(place);
        for (const dvec2& corner : {dvec2(0, 0), dvec2(1, 0), dvec2(0, 1), dvec2(1, 1)}) {
            const dvec2 to = low + corner;
            const Asked* const a = asked(int(to.x), int(to.y));
            const dvec2 near = 1.0 - glm::abs(to - place);
            if (a == nullptr || !a->isThere) continue;
            const double w = near.x * near.y * weight(own, centreOf(x, y), *a, centreOf(to * double(edge_)));
            sum += w * a->open;
            weights += w;
        }
        return sum / weights;
    }

  private:
    static dvec2 centreOf(const dvec2& pixel) { return pixel + 0.5; }
    static dvec2 centreOf(int x, int y) { return centreOf(dvec2(x, y)); }

    Asked surfaceAt(const Level& level, int x, int y) const {
        Asked a;
        const Sample* const s = level.at(x, y);
        if (s == nullptr || !s->valid) return a;
        a.depth = depthAt(*s, centreOf(x, y), view_);
        a.isThere = a.depth > 0;
        if (!a.isThere) return a;
        a.place = viewRay(view_, centreOf(x, y)).at(a.depth);
        a.normal = normalAt(*s, centreOf(x, y), view_);
        a.pixels = pixelsAt(view_, a.depth);
        return a;
    }
    const Asked* asked(int x, int y) const {
        const bool isInside = x >= 0 && y >= 0 && x < width_ && y < height_;
        return isInside ? &asked_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)]
                        : nullptr;
    }
    void keep(const std::vector<double>& open) {
        for (size_t i = 0; i < open.size(); ++i) asked_[i].open = open[i];
    }
    double radiusAt(const Asked& a) const { return std::min(radius_, kMostPixels / a.pixels); }

    double lightAt(int x, int y) const {
        const Asked& a = *asked(x, y);
        if (!a.isThere) return 1;
        const int order = kOrder.at(static_cast<size_t>(y % 4)).at(static_cast<size_t>(x % 4));
        const double first = (order + 0.5) / 16 * kPi / 2, start = (order * 7 % 16 + 0.5) / 16;
        double hidden = 0;
        for (int k = 0; k < 4; ++k) {
            const double angle = first + k * kPi / 2;
            hidden += hiddenAlong(a, x, y, {std::cos(angle), std::sin(angle)}, start);
        }
        return 1 - std::clamp(radius_ * a.pixels - 1, 0.0, 1.0) * hidden / 2;
    }
    /// Light of the half-plane of the eye and `t`, both unit, from between the eye and `angle` from it: the integral of
    /// (n.v cos + n.t sin) sin.
    static double lightWithin(double nv, double nt, double angle) {
        return nv * (1 - std::cos(2 * angle)) / 4 + nt * (angle / 2 - std::sin(2 * angle) / 4);
    }
    double hiddenAlong(const Asked& a, int x, int y, const dvec2& along, double start) const {
        const double radius = radiusAt(a);
        const dvec3 toEye = view_.isOrthographic ? dvec3(0, 0, -1) : -glm::normalize(a.place);
        const dvec3 flat(along, 0), t = glm::normalize(flat - glm::dot(flat, toEye) * toEye);
        const double nv = std::max(glm::dot(a.normal, toEye), 1e-3), nt = glm::dot(a.normal, t);
        double open = lightWithin(nv, nt, kPi / 2 + std::atan2(nt, nv)), hidden = 0, nearer = 1;
        for (int step = 0; step < kSteps; ++step) {
            const dvec2 to =
                glm::floor(dvec2(x, y) + 0.5 + along * (radius * a.pixels * (step + start) / kSteps / edge_));
            const Asked* const met = asked(int(to.x), int(to.y));
            const dvec3 v = met == nullptr ? dvec3(0) : met->place - a.place;
            const double distance = glm::length(v);
            const bool isNear = met != nullptr && met->isThere && distance < radius;
            const bool isAbove = isNear && distance > 0 && glm::dot(v / distance, a.normal) > kLeastSine;
            if (isAbove) {
                const double angle = std::acos(std::clamp(glm::dot(v / distance, toEye), -1.0, 1.0));
                const double within = std::min(open, lightWithin(nv, nt, angle));
                hidden += nearer * (open - within);
                open = within;
            }
            nearer = isNear ? 1 - distance * distance / (radius * radius) : 0;
        }
        return hidden;
    }

    /// How much of `a`'s surface another place is: none from a quarter of the radius off its plane on.
    double weight(const Asked& a, const dvec2& own, const Asked& other, const dvec2& at) const {
        const ViewRay from = viewRay(view_, own), to = viewRay(view_, at);
        const double facing = -std::max(-glm::dot(a.normal, from.direction), 1e-2);
        double off = 0;
        if (view_.isOrthographic)
            off = other.depth - a.depth + glm::dot(a.normal, to.origin - from.origin) / facing;
        else
            off = other.depth * (1 + glm::dot(a.normal, to.direction - from.direction) / facing) - a.depth;
        return std::max(1 - std::abs(off) / (kTolerance * radiusAt(a)), 0.0);
    }
    double meanAt(int x, int y, int dx, int dy) const {
        const Asked& a = *asked(x, y);
        if (!a.isThere) return 1;
        double sum = 0, weights = 0;
        for (int k = -2; k <= 2; ++k) {
            const Asked* const b = asked(x + k * dx, y + k * dy);
            if (b == nullptr || !b->isThere) continue;
            const double w =
                (std::abs(k) == 2 ? 0.5 : 1.0) * weight(a, centreOf(dvec2(x, y) * double(edge_)), *b,
                                                        centreOf(dvec2(x + k * dx, y + k * dy) * double(edge_)));
            sum += w * b->open;
            weights += w;
        }
        return weights > 0 ? sum / weights : 1;
    }

    const lod::View& view_;
    double radius_;
    int edge_, width_, height_;
    std::vector<Asked> asked_;
};

void onSurface(const render::DrawList& draws, Level& level) {
    const Occlusion occlusion(draws, level);
    for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x)
            if (Sample& s = level.ref(x, y); !s.blends()) s.occlusion *= occlusion.at(level, x, y);
}

}  // namespace

extern const RestatedEffect occlusionRestated;
constinit const RestatedEffect occlusionRestated{.onSurface = onSurface};

}  // namespace stipple::reference
