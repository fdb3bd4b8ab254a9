#include "lod/primitives/point_material.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stipple::lod {
namespace {

constexpr uint32_t kSteps = 15;

uint32_t stepOf(double value, double fallback) {
    return static_cast<uint32_t>(std::lround(std::clamp(std::isnan(value) ? fallback : value, 0.0, 1.0) * kSteps));
}

}  // namespace

std::optional<PointMaterial> materialNamed(const std::string& name) {
    if (name == "matte") return PointMaterial{1, 0};
    if (name == "plastic") return PointMaterial{0.35f, 0};
    if (name == "metal") return PointMaterial{0.3f, 1};
    if (name == "mirror") return PointMaterial{0, 1};
    if (const auto optics = opticsNamed(name)) return PointMaterial{0, 0, *optics};
    return {};
}

std::string identityOf(const PointMaterial& m) {
    const Optics& o = m.optics;
    return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}", m.roughness, m.metallic, o.transmission, o.ior,
                       o.thickness, o.attenuationDistance, o.attenuationColour.x, o.attenuationColour.y,
                       o.attenuationColour.z, o.specular, o.specularColour.x, o.specularColour.y, o.specularColour.z);
}

std::vector<PointMaterial> materialGrid() {
    std::vector<PointMaterial> grid;
    for (uint32_t i = 0; i < kMostPointMaterials; ++i)
        grid.push_back({static_cast<float>(kSteps - i % 16) / kSteps, static_cast<float>(i / 16) / kSteps});
    return grid;
}

uint8_t gridIndex(double roughness, double metallic) {
    return static_cast<uint8_t>((kSteps - stepOf(roughness, 1)) | stepOf(metallic, 0) << 4);
}

}  // namespace stipple::lod
