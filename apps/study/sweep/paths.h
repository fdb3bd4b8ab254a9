// Cameras of a scene that nobody gave any: around it, towards it, through it, and along its ground.
#pragma once

#include <vector>

#include "apps/study/sweep/plan.h"

namespace stipple::study {

/// `perPath` cameras of each of orbit, dolly (from twice as far as all is seen to an eighth of that), fly-through
/// (across, at a third of the height) and grazing (4 degrees above the ground).
std::vector<PathView> usualViews(std::span<const glm::dvec3> outline, const glm::dvec3& up, uint32_t perPath);
/// `count` cameras of a path, evenly spread over its time.
std::vector<PathView> viewsOfPath(const scene::CameraPath& path, const std::string& name, uint32_t count);

}  // namespace stipple::study
