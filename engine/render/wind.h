// Wind: plants bend as a whole, more towards the top, in gusts that travel with the wind. A closed form of time: the
// same time gives the same picture.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>

#include "lod/cut/cut.h"

namespace stipple::render {

struct Wind {
    double strength = 0;          ///< how far the top moves at most, share of the height; 0: no wind
    double seconds = 0;           ///< time
    glm::dvec3 towards{1, 0, 0};  ///< unit, world
};

/// How a node of an instance is moved: p' = p + along * (slope * dot(up, p) + offset). Of the bend's curve this is the
/// tangent at the node's centre: at most sway (size of the node / height)^2 off. |p' - p| <= Instance::sway for all p
/// between foot and top. Distances become longer by no more than lod::longestIn says, which errors are multiplied by;
/// normals follow the inverse transpose (nodeNormal); discs and curves keep their radii.
struct Bend {
    glm::dvec3 along{0}, up{0};
    double slope = 0, offset = 0;
    bool isStill() const { return slope == 0 && offset == 0; }
    glm::dvec3 moved(const glm::dvec3& p) const { return p + along * (slope * glm::dot(up, p) + offset); }
};

/// None where it would be less than kLeastSway pixels.
constexpr double kLeastSway = 0.1;
Bend bendOf(const Wind& wind, const lod::Hierarchy& h, const lod::Instance& instance, uint32_t node,
            const lod::View& view, const glm::dvec3& up);

/// A level direction for wind.
inline glm::dvec3 windAcross(const glm::dvec3& up) {
    const glm::dvec3 aside = std::abs(up.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    return glm::normalize(aside - up * glm::dot(aside, up));
}

/// Could wind move it? Curves and what is seen of them from afar, unless their store says that they are no plants; but
/// not the points of instance groups: those stay where they are, and are drawn only where that is within the error.
bool mayBend(const lod::Hierarchy& h, const lod::Instance& instance);

/// Sets Instance::sway of what wind could move; of the points of an instance group also Instance::inputError, as far as
/// the member that moves most goes without them.
void setSway(const Wind& wind, std::span<const lod::Hierarchy* const> hierarchies, std::span<lod::Instance> instances,
             std::span<const lod::InstanceGroup> groups);

}  // namespace stipple::render
