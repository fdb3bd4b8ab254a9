// What a coordinate must be to be drawn.
#pragma once

#include <cmath>
#include <glm/glm.hpp>

namespace stipple {

/// All three are numbers and not infinite. (Not their sum: that of large ones may be.)
inline bool isFinite(const glm::dvec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

}  // namespace stipple
