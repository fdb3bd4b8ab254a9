// What lights points beside their colours and normals, and a list of such materials that does for any.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lod/primitives/optics.h"

namespace stipple::lod {

/// As glTF 2.0 has it (3.9); both from 0 to 1. The base colour is the point's own.
struct PointMaterial {
    float roughness = 1, metallic = 0;
    Optics optics = {};
    bool operator==(const PointMaterial&) const = default;
};

/// The attribute that is an index into a list of materials.
inline constexpr const char* kMaterialAttribute = "material";
inline constexpr size_t kMostPointMaterials = 256;

/// Any of kMaterialNames.
std::optional<PointMaterial> materialNamed(const std::string& name);
inline constexpr const char* kMaterialNames = "matte, plastic, metal, mirror, glass, water";

/// All of it, for the identity of what is made from it.
std::string identityOf(const PointMaterial& material);

/// 16 steps of each property; the first is matte.
std::vector<PointMaterial> materialGrid();
/// The nearest of the grid: at most 1/30 off in either property. What is no number is that of a matte one.
uint8_t gridIndex(double roughness, double metallic);

}  // namespace stipple::lod
