// The environment's picture behind everything (engine/render/backdrop.h), in fp64: azimuth and elevation by arc
// functions, texels by their bits.
#pragma once

#include <glm/glm.hpp>

#include "engine/render/backdrop.h"

namespace stipple::reference {

/// What comes from a direction of the picture (any length), as a pixel sees it that is so many radians wide (0: the
/// finest level).
glm::dvec3 lightFrom(const render::Backdrop& backdrop, const glm::dvec3& direction, double angle);

/// A direction of the world as one of the picture.
glm::dvec3 toMap(const glm::dvec3& world, const glm::dvec3& up);

}  // namespace stipple::reference
