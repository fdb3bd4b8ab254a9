#include "lod/primitives/optics.h"

#include <algorithm>
#include <cmath>

namespace stipple::lod {
namespace {

constexpr float kUsual = 0.04f;      // of what has no optics (shaders/shared/shade.h)
constexpr float kLeastSeen = 0.01f;  // of what is reflected straight on
constexpr float kLargest = 1e9f;

bool isShare(float v) { return v >= 0 && v <= 1; }
bool isFactor(float v) { return v >= 0 && v <= kLargest; }

}  // namespace

glm::vec3 Optics::straightOn() const {
    const float root = ior == 0 ? 1.0f : (ior - 1) / (ior + 1);
    return glm::min(root * root * specularColour, glm::vec3(1)) * specular;
}

bool Optics::isPlain() const {
    const glm::vec3 off = glm::abs(straightOn() - kUsual);
    return transmission == 0 && std::max({off.x, off.y, off.z}) <= kLeastSeen;
}

bool Optics::isPossible() const {
    const bool isThickness = isFactor(thickness) || (thickness < 0 && thickness >= -kLargest);
    const bool isBent = ior == 0 || (ior >= 1 && ior <= kLargest);
    return isShare(transmission) && isBent && isThickness && isFactor(attenuationDistance) &&
           isShare(attenuationColour.x) && isShare(attenuationColour.y) && isShare(attenuationColour.z) &&
           isShare(opacity) && isShare(specular) && isFactor(specularColour.x) && isFactor(specularColour.y) &&
           isFactor(specularColour.z);
}

std::optional<Optics> opticsNamed(const std::string& name) {
    Optics o;
    o.transmission = 1;
    o.thickness = Optics::kOfItsSize;
    if (name == "glass") return o;
    if (name != "water") return {};
    o.ior = 1.333f;
    return o;
}

}  // namespace stipple::lod
