// Reflections of the screen, restated: the mirror ray of a smooth pixel is cut with the picture pixel by pixel, each of
// which is a wall at its depth; what counts of what it meets, and the light of that, are computed anew.
#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/reference/decode.h"
#include "engine/reference/effects/effects.h"
#include "engine/reference/surface.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/reflection.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

double faded(double x) { return std::clamp(x, 0.0, 1.0); }

class MirrorImages {
  public:
    MirrorImages(const render::DrawList& draws, const Level& level)
        : draws_(draws),
          level_(level),
          view_(draws.view),
          size_(level.width, level.height),
          reach_(draws.tableAt<shared::ReflectionConstants>(shared::kReflectionBinding)->reach) {
        for (int y = 0; y < level.height; ++y)
            for (int x = 0; x < level.width; ++x) {
                const Sample& s = *level.at(x, y);
                depths_.push_back(s.valid ? std::max(depthAt(s, dvec2(x + 0.5, y + 0.5), view_), 0.0) : 0.0);
            }
    }

    /// What light adds to a pixel.
    dvec3 at(int x, int y) const {
        const Sample& s = *level_.at(x, y);
        const double smooth = faded((0.3 - s.roughness) / 0.2);
        if (!s.valid || !isMirror(s) || !(smooth > 0) || !(depthOf(x, y) > 0)) return dvec3(0);
        const dvec2 pixel(x + 0.5, y + 0.5);
        const dvec3 n = normalAt(s, pixel, view_), place = viewRay(view_, pixel).at(depthOf(x, y)),
                    toEye = -sightOf(view_, place);
        const double facing = std::max(glm::dot(n, toEye), 1e-3);
        const dvec3 mirror = 2 * facing * n - toEye;
        const double own = smooth * faded(1 - 2 * glm::dot(mirror, toEye));
        if (!(own > 0)) return dvec3(0);
        const auto met = follow(place + n / pixelsAt(view_, place.z), mirror);
        if (!met) return dvec3(0);
        const double share = own * shareOf(*met, mirror, place);
        const dvec3 around = double(draws_.frame.ambient) * surroundingsOf(mirror, n, s.roughness, draws_);
        return s.occlusion * share * mirrorShareOf(s, facing) * lightAbout(met->at, mirror, around);
    }

  private:
    struct Met {
        dvec2 at{0}, pixel{0};
        double depth = 0, off = 0;  ///< off: offWall
        int passed = 0;             ///< things before it that the ray was behind
    };
    struct Ray {
        dvec2 from{0}, to{0};  ///< px
        dvec3 begin{0}, end{0};
        double inside = 1;  ///< share of the way on the picture
        double pixels = 1;
    };

    bool isMirror(const Sample& s) const {
        const uint32_t shade = draws_.frame.shade;
        if (s.isTriangle) return !s.isUnlit && !s.isLitAsPoint && (shade & shared::kShadeTriangles) != 0;
        return s.hasMaterial() && (shade & shared::kShadeLit) != 0;
    }
    double depthOf(int x, int y) const {
        return depths_[static_cast<size_t>(y) * static_cast<size_t>(level_.width) + static_cast<size_t>(x)];
    }
    /// Depth of the ray at a share of its way on the picture.
    double depthAlong(const Ray& r, double share) const {
        const double s = share * r.inside;
        return view_.isOrthographic ? glm::mix(r.begin.z, r.end.z, s) : 1 / glm::mix(1 / r.begin.z, 1 / r.end.z, s);
    }
    /// The share at which the ray has a depth.
    double shareAtDepth(const Ray& r, double depth) const {
        const double s = view_.isOrthographic ? (depth - r.begin.z) / (r.end.z - r.begin.z)
                                              : (1 / depth - 1 / r.begin.z) / (1 / r.end.z - 1 / r.begin.z);
        return s / r.inside;
    }
    Ray rayOf(const dvec3& begin, const dvec3& mirror) const {
        double way = reach_;
        if (mirror.z < 0) way = std::min(way, 0.9 * begin.z / -mirror.z);
        Ray r;
        r.begin = begin;
        r.end = begin + way * mirror;
        r.from = imageOf(view_, begin);
        const dvec2 whole = imageOf(view_, r.end) - r.from;
        for (int k = 0; k < 2; ++k)
            if (whole[k] != 0) r.inside = std::min(r.inside, ((whole[k] > 0 ? size_[k] : 0) - r.from[k]) / whole[k]);
        r.inside = faded(r.inside);
        r.to = r.from + r.inside * whole;
        r.pixels = std::max({std::abs(r.to.x - r.from.x), std::abs(r.to.y - r.from.y), 1.0});
        return r;
    }
    /// How far the ray is from the surface that it went behind in pixel `low`, of what it may be: on the way into that
    /// pixel its depth is taken to go as it goes on, within what the normal allows.
    double offWall(const Ray& r, double share, const dvec2& low) const {
        const double depth = depthOf(int(low.x), int(low.y)), z = std::max(depthAlong(r, share), depth);
        const dvec2 on =
            glm::clamp(glm::floor(r.from + (share + 2 / r.pixels + 1e-9) * (r.to - r.from)), dvec2(0), size_ - 1.0);
        const double facing = std::abs(glm::dot(normalAt(*level_.at(int(low.x), int(low.y)), low + 0.5, view_),
                                                sightOf(view_, viewRay(view_, low + 0.5).at(depth))));
        const double pixel = 1 / pixelsAt(view_, depth), tangent = std::sqrt(std::max(1 - facing * facing, 0.0));
        const double steepest = tangent / std::max(facing, 1.0 / 16) * pixel;
        const double next = depthOf(int(on.x), int(on.y));
        const double into = (next > 0 ? std::clamp((depth - next) / 2, -steepest, steepest) : -steepest) / 2;
        return std::abs(z - (depth + into)) /
               (std::abs(z - depthAlong(r, share - 1 / r.pixels)) + pixel + std::abs(into));
    }

    /// Through one pixel after another, to the first wall that the ray goes behind.
    std::optional<Met> follow(const dvec3& begin, const dvec3& mirror) const {
        const Ray r = rayOf(begin, mirror);
        const dvec2 way = r.to - r.from;
        double share = 0;
        int passed = 0;
        bool isInFront = true;
        while (share < 1 && passed < 4) {
            // The pixel that a little more of the way lies in, and where it ends.
            const dvec2 here = r.from + (share + 1e-9) * way;
            const dvec2 low = glm::clamp(glm::floor(here), dvec2(0), size_ - 1.0);
            double end = 1;
            for (int k = 0; k < 2; ++k)
                if (way[k] != 0) {
                    const double at = (low[k] + (way[k] > 0 ? 1 : 0) - r.from[k]) / way[k];
                    if (at > share) end = std::min(end, at);
                }
            const double wall = depthOf(int(low.x), int(low.y));
            const double entry = depthAlong(r, share), exit = depthAlong(r, end);
            if (wall > 0 && isInFront && std::max(entry, exit) > wall) {
                const double at = entry > wall ? share : std::clamp(shareAtDepth(r, wall), share, end);
                const double off = offWall(r, at, low);
                const dvec3 n = normalAt(*level_.at(int(low.x), int(low.y)), low + 0.5, view_);
                if (off < 2 && glm::dot(n, mirror) < 0)
                    return Met{r.from + at * way, low, std::max(entry, wall), off, passed};
                ++passed;
            }
            isInFront = !(wall > 0 && exit > wall);
            share = std::max(end, share + 1e-9);
        }
        return {};
    }

    double shareOf(const Met& met, const dvec3& mirror, const dvec3& place) const {
        const dvec2& low = met.pixel;
        const dvec3 n = normalAt(*level_.at(int(low.x), int(low.y)), low + 0.5, view_);
        const double border = std::min(size_.x, size_.y) / 16;
        const double inside = std::min({met.at.x, size_.x - met.at.x, met.at.y, size_.y - met.at.y});
        const double distance = glm::length(viewRay(view_, met.at).at(met.depth) - place);
        return faded((4 - met.passed) / 3.0) * faded(2 - met.off) * faded(-4 * glm::dot(n, mirror)) *
               faded(inside / border) * faded(4 - 4 * distance / reach_);
    }

    /// Bilinear, of what the four pixels about a place send; nothing of those that show nothing, and as if those that
    /// turn their back to the ray were not there.
    dvec3 lightAbout(const dvec2& at, const dvec3& mirror, const dvec3& around) const {
        const dvec2 p = glm::clamp(at - 0.5, dvec2(0), size_ - 1.0), low = glm::floor(p);
        dvec3 sum(0);
        double counted = 0;
        for (const dvec2& corner : {dvec2(0, 0), dvec2(1, 0), dvec2(0, 1), dvec2(1, 1)}) {
            const dvec2 to = glm::min(low + corner, size_ - 1.0), near = 1.0 - glm::abs(low + corner - p);
            const Sample& s = *level_.at(int(to.x), int(to.y));
            const double depth = depthOf(int(to.x), int(to.y));
            const dvec3 n = depth > 0 ? normalAt(s, to + 0.5, view_) : -mirror;
            if (glm::dot(n, mirror) >= 0) continue;
            counted += near.x * near.y;
            if (!(depth > 0)) continue;
            const dvec3 light =
                sentBy(s, n, viewRay(view_, to + 0.5).at(depth), draws_, (draws_.frame.shade & shared::kShadeLit) != 0);
            sum += near.x * near.y * (light - around);
        }
        return sum / std::max(counted, 0.25);
    }

    const render::DrawList& draws_;
    const Level& level_;
    const lod::View& view_;
    dvec2 size_;
    double reach_;
    std::vector<double> depths_;
};

void onSurface(const render::DrawList& draws, Level& level) {
    const MirrorImages images(draws, level);
    std::vector<dvec3> added;
    for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x) added.push_back(images.at(x, y));
    for (size_t i = 0; i < added.size(); ++i) level.samples[i].mirrored = added[i];
}

}  // namespace

extern const RestatedEffect reflectionRestated;
constinit const RestatedEffect reflectionRestated{.onSurface = onSurface};

}  // namespace stipple::reference
