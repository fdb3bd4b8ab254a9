// Shadows once more, in fp64 and in world space, from the maps of the frame.
#pragma once

#include <functional>
#include <glm/glm.hpp>

#include "engine/render/draw_list.h"

namespace stipple::reference {

/// What of a light of DrawList::lights comes to a place. `point`, `n`: camera space.
using LightPast = std::function<glm::dvec3(size_t light, const glm::dvec3& point, const glm::dvec3& n)>;

/// By the maps of the frame; where it has none of that light: all.
glm::dvec3 pastMaps(const render::DrawList& draws, size_t light, const glm::dvec3& point, const glm::dvec3& n);

}  // namespace stipple::reference
