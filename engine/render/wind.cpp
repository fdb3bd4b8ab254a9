#include "engine/render/wind.h"

#include <cmath>
#include <numbers>

namespace stipple::render {
namespace {

/// In [-1, 1]. Taller plants swing more slowly; gusts are kGust metres apart and travel with the wind.
double gust(const Wind& wind, const glm::dvec3& foot, double height) {
    constexpr double kGust = 60;
    const double frequency = 0.9 / std::sqrt(std::max(height, 0.1));
    const double phase = glm::dot(wind.towards, foot) / kGust;
    // Turns are taken off in fp64, so that the motion is as smooth after a day as at once (hard case 54).
    const auto wave = [&](double turns) { return std::sin(2 * std::numbers::pi * (turns - std::floor(turns))); };
    return 0.7 * wave(frequency * wind.seconds - phase) + 0.3 * wave(2.3 * frequency * wind.seconds - 1.7 * phase);
}

}  // namespace

Bend bendOf(const Wind& wind, const lod::Hierarchy& h, const lod::Instance& instance, uint32_t node,
            const lod::View& view, const glm::dvec3& up) {
    if (!(instance.sway > 0) || instance.group != lod::Instance::kNone) return {};
    const auto world = [&](const glm::dvec3& lattice) {
        return instance.translation + instance.rotation * (instance.scale * (h.origin + h.unit * lattice));
    };
    const double perStep = instance.scale * h.unit, reach = perStep * h.nodes[0].radius, height = 2 * reach;
    const glm::dvec3 middle = world(h.nodes[0].centre);
    const double nearest = view.isOrthographic ? 1 : std::max(glm::length(middle - view.eye) - reach, view.nearPlane);
    if (instance.sway * view.focalPixels < kLeastSway * nearest) return {};
    const double foot = glm::dot(up, middle) - reach;
    const double at = std::clamp((glm::dot(up, world(h.nodes[node].centre)) - foot) / height, 0.0, 1.0);
    const double swing = instance.sway * gust(wind, instance.translation, height);
    // swing * u^2 with u = (dot(up, p) - foot) / height, as 2 at u - at^2.
    Bend bend;
    bend.up = up;
    bend.along = glm::normalize(wind.towards - up * glm::dot(wind.towards, up));
    bend.slope = swing * 2 * at / height;
    bend.offset = -bend.slope * foot - swing * at * at;
    return bend;
}

bool mayBend(const lod::Hierarchy& h, const lod::Instance& instance) {
    return h.hasOverlappingCells() && !h.isRigid && instance.group == lod::Instance::kNone && !h.nodes.empty();
}

void setSway(const Wind& wind, std::span<const lod::Hierarchy* const> hierarchies, std::span<lod::Instance> instances,
             std::span<const lod::InstanceGroup> groups) {
    for (lod::Instance& i : instances) {
        const lod::Hierarchy& h = *hierarchies[i.hierarchy];
        i.sway = mayBend(h, i) ? wind.strength * 2 * i.scale * h.unit * h.nodes[0].radius : 0;
    }
    // What stands in for something rigid is as rigid.
    for (const lod::Instance& i : instances) {
        if (!hierarchies[i.hierarchy]->isRigid) continue;
        for (uint32_t k = i.proxy; k != lod::Instance::kNone; k = instances[k].proxy) instances[k].sway = 0;
    }
    for (const lod::InstanceGroup& group : groups) {
        double sway = 0;
        for (const uint32_t m : group.members)
            for (uint32_t k = m; k != lod::Instance::kNone; k = instances[k].proxy)
                sway = std::max(sway, instances[k].sway);
        instances[group.points].sway = instances[group.points].inputError = sway;
    }
}

}  // namespace stipple::render
