#include "engine/render/length_unit.h"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"

namespace stipple::render {

double unitsOfLength(const lod::Cut& cut, std::span<const lod::Hierarchy* const> hierarchies,
                     std::span<const lod::Instance> instances, const lod::View& view) {
    double reach = 0;
    const auto look = [&](uint32_t instance, uint32_t number) {
        const lod::Instance& place = instances[instance];
        const lod::Hierarchy& h = *hierarchies[place.hierarchy];
        const lod::Node& node = h.nodes[number];
        glm::dvec3 apart =
            place.translation + place.rotation * (place.scale * (h.origin + h.unit * node.centre)) - view.eye;
        // Orthographic eyes may stand anywhere along their rays (draw_list.cpp moves them).
        if (view.isOrthographic) apart -= glm::dot(apart, view.forward) * view.forward;
        // (Of a length near the ends of doubles the square would be none.)
        const double largest = std::max({std::abs(apart.x), std::abs(apart.y), std::abs(apart.z)});
        reach = std::max(reach, largest + node.radius * place.scale * h.unit + place.sway);
    };
    for (const lod::CutDraw& draw : cut.draw) look(draw.instance, draw.node);
    for (const lod::CutMeshDraw& draw : cut.meshDraw) look(draw.instance, draw.node);
    const bool isUsual = reach >= 0x1p-20 && reach <= 0x1p40;
    if (isUsual || !std::isnormal(reach)) return 1;
    return std::ldexp(1.0, std::clamp(-std::ilogb(reach), -1000, 1000));
}

lod::View inUnits(lod::View view, double units) {
    view.eye *= units;
    view.nearPlane *= units;
    if (view.isOrthographic) view.focalPixels /= units;
    return view;
}

void inUnits(std::span<const lod::Instance> instances, double units, std::vector<lod::Instance>& out) {
    out.assign(instances.begin(), instances.end());
    for (lod::Instance& i : out) {
        i.translation *= units;
        i.scale *= units;
        i.inputError *= units;
        i.sway *= units;
    }
}

DrawSettings inUnits(DrawSettings settings, double units) {
    for (WorldLight& light : settings.lights) {
        light.position *= units;
        light.range = toFloat(light.range * units);
        if (light.kind == shared::kLightDirectional) continue;
        for (int c = 0; c < 3; ++c) light.colour[c] = toFloat(light.colour[c] * units * units);
    }
    settings.parameters.occlusion.radius *= units;
    settings.parameters.reflection.distance *= units;
    settings.parameters.facts.extent *= units;
    FogSettings& fog = settings.parameters.fog;
    fog.density /= units;
    fog.height *= units;
    fog.base *= units;
    return settings;
}

void inWorldUnits(std::span<float> depths, double units) {
    for (float& depth : depths) depth = toFloat(depth / units);
}

}  // namespace stipple::render
