#include "engine/render/shadow_views.h"

#include <algorithm>
#include <cmath>

#include "shaders/shared/shadow.h"

namespace stipple::render {
namespace {

constexpr int kMostCascades = 8;
constexpr double kWider = 1.26;      // than the ball: a fifth of the map for the camera to move in, and a texel
constexpr double kStepShare = 0.2;   // of the map's edge: the grid that it stands on
constexpr double kWidestCone = 1.4;  // radians: a map of nearly half of all directions has no texels left in its middle
constexpr double kLeastCone = 1e-4;

struct PlacedBall {
    glm::dvec3 centre;
    double radius;
};
PlacedBall ballOfNode(const lod::CutScene& scene, uint32_t instance, uint32_t number) {
    const lod::Instance& place = scene.instances[instance];
    const lod::Hierarchy& h = *scene.hierarchies[place.hierarchy];
    const lod::Node& node = h.nodes[number];
    return {place.translation + place.rotation * (place.scale * (h.origin + h.unit * node.centre)),
            node.radius * place.scale * h.unit + place.sway};
}

bool isFinite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Across and along a light's direction, the same whatever the camera does.
void setAxes(const glm::dvec3& direction, lod::View& view) {
    view.forward = direction;
    const glm::dvec3 aside = std::abs(direction.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
    view.right = glm::normalize(glm::cross(direction, aside));
    view.down = glm::cross(direction, view.right);
}

/// A view of parallel light on a ball that stands before the camera.
ShadowView farView(const WorldLight& light, const ShadowMapSettings& settings, const SceneBall& ball,
                   const glm::dvec3& centre, double radius) {
    ShadowView out;
    lod::View& v = out.view;
    setAxes(glm::normalize(light.direction), v);
    v.isOrthographic = true;
    v.width = v.height = settings.edge;
    const double texel = 2 * kWider * radius / settings.edge, step = std::floor(kStepShare * settings.edge) * texel;
    v.focalPixels = 1 / texel;
    const auto snapped = [&](double at) { return std::round(at / step) * step; };
    // Before all that is placed.
    constexpr double kBefore = 1.01;
    const double from = glm::dot(ball.centre, v.forward) - kBefore * ball.radius;
    v.eye =
        v.right * snapped(glm::dot(centre, v.right)) + v.down * snapped(glm::dot(centre, v.down)) + v.forward * from;
    v.nearPlane = (kBefore - 1) * 0.5 * ball.radius;
    out.centreDepth = std::round((glm::dot(centre, v.forward) - from) / step) * step;
    out.size = std::tan(0.5 * light.size);
    return out;
}

void addCascades(const WorldLight& light, const ShadowMapSettings& settings, const SceneBall& ball,
                 const SeenRange& seen, const lod::View& camera, std::vector<ShadowView>& out) {
    if (camera.isOrthographic) {
        const double across = std::hypot(camera.width, camera.height) / camera.focalPixels;
        // In steps, so that the map stays where it is while what is seen changes a little.
        const double half = 0.5 * std::hypot(across, seen.farthest - seen.nearest);
        const double radius = std::exp2(std::ceil(4 * std::log2(half)) / 4);
        const double middle = 0.5 * (seen.nearest + seen.farthest);
        out.push_back(farView(light, settings, ball, camera.eye + camera.forward * middle, radius));
        out.back().reach = HUGE_VAL;
        return;
    }
    // (Samples of a pixel look by less than a pixel aside: maps do not follow them.)
    const auto aside = [](double shift) {
        return std::abs(shift) > 1 ? std::exp2(std::ceil(std::log2(std::abs(shift)))) : 0;
    };
    const double f = camera.focalPixels, corner = std::hypot(0.5 * camera.width + aside(camera.shift.x),
                                                             0.5 * camera.height + aside(camera.shift.y));
    const double cosine = f / std::hypot(f, corner), sine = corner / std::hypot(f, corner);
    // The smallest ball of a cone of length 1 from its tip: through its tip and its rim, unless the cone is wide.
    const bool isNarrow = 2 * cosine * cosine > 1;
    const double ahead = isNarrow ? 0.5 / cosine : cosine, radius = isNarrow ? ahead : sine;
    const int last = static_cast<int>(std::ceil(std::log2(seen.farthest)));
    const int nearest = seen.nearest > 0 ? static_cast<int>(std::ceil(std::log2(seen.nearest))) : -1'000'000;
    for (int k = std::max(nearest, last - kMostCascades + 1); k <= last; ++k) {
        const double reach = std::exp2(k);
        out.push_back(farView(light, settings, ball, camera.eye + camera.forward * (ahead * reach), radius * reach));
        out.back().reach = reach;
    }
}

ShadowView spotView(const WorldLight& light, const ShadowMapSettings& settings, const SceneBall& ball) {
    ShadowView out;
    lod::View& v = out.view;
    setAxes(glm::normalize(light.direction), v);
    v.eye = light.position;
    v.width = v.height = settings.edge;
    v.focalPixels = 0.5 * settings.edge / std::tan(std::min(double{light.outerCone}, kWidestCone));
    v.nearPlane = 1e-6 * ball.radius;
    out.reach = HUGE_VAL;
    out.size = light.size;
    return out;
}

}  // namespace

bool ShadowView::isOf(const ShadowView& other) const {
    const lod::View &a = view, &b = other.view;
    return a.eye == b.eye && a.right == b.right && a.forward == b.forward && a.focalPixels == b.focalPixels &&
           a.width == b.width && a.nearPlane == b.nearPlane && a.isOrthographic == b.isOrthographic &&
           centreDepth == other.centreDepth;
}

SceneBall ballOf(const lod::CutScene& scene) {
    glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
    for (uint32_t i = 0; i < scene.instances.size(); ++i) {
        if (scene.hierarchies[scene.instances[i].hierarchy]->nodes.empty()) continue;
        const PlacedBall b = ballOfNode(scene, i, 0);
        low = glm::min(low, b.centre - b.radius);
        high = glm::max(high, b.centre + b.radius);
    }
    if (!(low.x <= high.x)) return {};
    return {0.5 * (low + high), 0.5 * glm::length(high - low)};
}

std::vector<SeenBall> seenBalls(const lod::Cut& cut, const lod::CutScene& scene, const lod::View& camera) {
    std::vector<SeenBall> seen;
    seen.reserve(cut.draw.size() + cut.meshDraw.size());
    const auto add = [&](const PlacedBall& b) {
        const glm::dvec3 d = b.centre - camera.eye;
        seen.push_back({b.centre, b.radius, camera.isOrthographic ? glm::dot(d, camera.forward) : glm::length(d)});
    };
    for (const lod::CutDraw& d : cut.draw) add(ballOfNode(scene, d.instance, d.node));
    for (const lod::CutMeshDraw& d : cut.meshDraw) add(ballOfNode(scene, d.instance, d.node));
    return seen;
}

SeenRange seenRange(std::span<const SeenBall> seen) {
    SeenRange range{HUGE_VAL, 0};
    for (const SeenBall& b : seen) {
        range.nearest = std::min(range.nearest, std::max(b.away - b.radius, 0.0));
        range.farthest = std::max(range.farthest, b.away + b.radius);
    }
    return range;
}

ShadowViews shadowViews(std::span<const WorldLight> lights, const ShadowMapSettings& settings, const SceneBall& ball,
                        const SeenRange& seen, const lod::View& camera) {
    ShadowViews out;
    if (seen.isEmpty() || !(ball.radius > 0) || !std::isfinite(ball.radius)) return out;
    uint32_t slots = 0;
    for (uint32_t l = 0; l < lights.size(); ++l) {
        const WorldLight& light = lights[l];
        if (!light.castsShadow) continue;
        const bool isFar = light.kind == shared::kLightDirectional;
        const bool isPossible = isFinite(light.direction) && glm::length(light.direction) > 0 &&
                                (isFar || (isFinite(light.position) && light.outerCone > kLeastCone)) &&
                                light.kind != shared::kLightPoint;
        if (!isPossible || slots == shared::kMostShadowLights) {
            ++out.left;
            continue;
        }
        const size_t first = out.views.size();
        if (isFar)
            addCascades(light, settings, ball, seen, camera, out.views);
        else
            out.views.push_back(spotView(light, settings, ball));
        for (size_t v = first; v < out.views.size(); ++v) {
            out.views[v].light = l;
            out.views[v].slot = slots;
        }
        ++slots;
    }
    return out;
}

bool hasReceivers(std::span<const SeenBall> seen, const lod::View& camera, const lod::View& light, double from,
                  double to) {
    const double half = 0.5 * light.width / light.focalPixels;
    return std::any_of(seen.begin(), seen.end(), [&](const SeenBall& b) {
        if (!camera.isOrthographic && (b.away - b.radius > to || b.away + b.radius < from)) return false;
        const glm::dvec3 d = b.centre - light.eye;
        const double depth = glm::dot(d, light.forward);
        // (In perspective the sides of the frustum lean outwards by half / depth.)
        const double most = light.isOrthographic ? half + b.radius
                                                 : half * std::max(depth, 0.0) + b.radius * std::sqrt(1 + half * half);
        return depth > -b.radius && std::abs(glm::dot(d, light.right)) < most &&
               std::abs(glm::dot(d, light.down)) < most;
    });
}

double shadowErrorPixels(const lod::View& camera, double distance, double offAxis, double facing, double error,
                         double texel, double bias) {
    const double world = (error + texel / std::sqrt(2.0) + bias) / facing;
    if (camera.isOrthographic) return camera.focalPixels * world;
    return camera.focalPixels * world / (distance * offAxis * offAxis);
}

}  // namespace stipple::render
