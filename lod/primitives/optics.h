// What a surface does with light beyond metallic roughness: how much it lets through, how it bends and absorbs that,
// and how strongly it reflects straight on.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <string>

namespace stipple::lod {

/// As glTF's KHR_materials_transmission, _ior, _volume and _specular have it; their textures are not kept.
struct Optics {
    float transmission = 0;         ///< share of what is not reflected that goes through instead of being diffuse
    float ior = 1.5f;               ///< 0: all is reflected, as the extension has it
    float thickness = 0;            ///< store units; 0: a thin wall, which bends nothing; below 0: see kOfItsSize
    float attenuationDistance = 0;  ///< store units, after which white light is attenuationColour; 0: nothing absorbed
    glm::vec3 attenuationColour{1};
    float specular = 1;  ///< factor of what dielectrics reflect
    glm::vec3 specularColour{1};
    /// What is behind shows through as far as alpha says (glTF BLEND): of triangles that of material, vertices and
    /// texture, of all else `opacity`.
    bool blends = false;
    float opacity = 1;

    bool operator==(const Optics&) const = default;
    /// The thickness of a solid body that says none: minus the shortest edge of its box.
    static constexpr float kOfItsSize = -1;
    /// What a dielectric reflects straight on: ((n - 1) / (n + 1))^2, coloured.
    glm::vec3 straightOn() const;
    /// Nothing goes through, and it reflects as every surface without optics (0.04) does, but for 0.01. (Blending is
    /// apart.)
    bool isPlain() const;
    /// Is every number possible?
    bool isPossible() const;
};

/// glass or water: solid bodies.
std::optional<Optics> opticsNamed(const std::string& name);

}  // namespace stipple::lod
