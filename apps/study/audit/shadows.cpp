#include "apps/study/audit/shadows.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apps/study/audit/audit.h"
#include "engine/render/shadow_frame.h"

namespace stipple::study {
namespace {

constexpr double kFaces = 0.2;     ///< cosine to the light, from which on something is stated
constexpr double kSamePixels = 4;  ///< depths that are farther apart are of different things: no matter of shadows

/// How far from pixel `i` the nearest is that the traced picture has as dark, or as lit, as asked.
double nearestAs(bool isDark, const std::vector<double>& traced, uint32_t width, size_t i) {
    const auto height = static_cast<int>(traced.size() / width), w = static_cast<int>(width);
    const int x = static_cast<int>(i % width), y = static_cast<int>(i / width);
    double nearest = kShadowReach;
    for (int reach = 1; reach < nearest; ++reach) {  // rings: none beyond is nearer
        for (int dy = -reach; dy <= reach; ++dy)
            for (int dx = -reach; dx <= reach; dx += std::abs(dy) == reach ? 1 : 2 * reach) {
                if (x + dx < 0 || y + dy < 0 || x + dx >= w || y + dy >= height) continue;
                const double share = traced[static_cast<size_t>(y + dy) * width + static_cast<size_t>(x + dx)];
                if (share >= 0 && (share < 0.5) == isDark) nearest = std::min(nearest, std::hypot(dx, dy));
            }
    }
    return nearest;
}

}  // namespace

std::vector<double> lightShares(const LightPictures& p) {
    std::vector<double> shares;
    for (size_t i = 0; i < p.open.depth.size(); ++i) {
        const auto at = [i](const render::Image& image) { return double{image.linear[3 * i]}; };
        const double all = at(p.open) - at(p.dark);
        shares.push_back(all > 1e-3 ? (at(p.with) - at(p.dark)) / all : -1);
    }
    return shares;
}

ShadowAudit auditShadows(const std::vector<double>& shown, const std::vector<double>& traced,
                         const std::vector<double>& stated, uint32_t width) {
    ShadowAudit audit;
    for (size_t i = 0; i < shown.size(); ++i) {
        if (shown[i] < 0 || traced[i] < 0 || std::isnan(stated[i])) continue;
        ++audit.lookedAt;
        const bool isDark = traced[i] < 0.5;
        audit.dark += isDark;
        if ((shown[i] < 0.5) == isDark) continue;
        ++audit.wrong;
        const double off = nearestAs(!isDark, traced, width, i);
        audit.stated = std::max(audit.stated, stated[i]);
        audit.beyond += off > stated[i] + kBorderPixels;
        if (off <= audit.worst) continue;
        audit.worst = off;
        audit.worstPixel = i;
    }
    return audit;
}

std::vector<double> statedBorders(const render::FrameState& state, const lod::View& view, const render::Image& traced,
                                  const render::WorldLight& light) {
    std::vector<double> stated(traced.depth.size(), std::numeric_limits<double>::quiet_NaN());
    if (!state.draws.shadowMaps) return stated;
    const render::ShadowMaps& maps = *state.draws.shadowMaps;
    for (size_t i = 0; i < stated.size(); ++i) {
        const double z = traced.depth[i], pixel = (view.isOrthographic ? 1 : z) / view.focalPixels;
        if (!(z > 0) || !(std::abs(double{state.image.depth[i]} - z) <= kSamePixels * pixel)) continue;
        const glm::dvec3 p = placeOf(view, i, z),
                         n(traced.normal[3 * i], traced.normal[3 * i + 1], traced.normal[3 * i + 2]);
        const glm::dvec3 l =
            light.kind == shared::kLightDirectional ? -light.direction : glm::normalize(light.position - p);
        const double facing = std::abs(glm::dot(n, l));
        if (!(facing >= kFaces)) continue;
        const double distance = glm::length(p - view.eye),
                     offAxis = view.isOrthographic ? 1 : glm::dot(p - view.eye, view.forward) / distance;
        const auto used = std::find_if(maps.maps.begin(), maps.maps.end(), [&](const render::ShadowMapOf& m) {
            return view.isOrthographic || distance <= m.of.reach;
        });
        if (used == maps.maps.end()) continue;
        const lod::View& from = used->of.view;
        const double deep = from.isOrthographic ? 1 : glm::dot(p - from.eye, from.forward);
        const double caster = used->casterError * deep,
                     surface = maps.surfaceError / view.focalPixels * (view.isOrthographic ? 1 : distance);
        stated[i] = render::shadowErrorPixels(view, distance, offAxis, facing, caster, deep / from.focalPixels,
                                              caster + surface);
    }
    return stated;
}

}  // namespace stipple::study
