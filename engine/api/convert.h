// Between the public headers and the engine's own types.
#pragma once

#define STIPPLE_WITHIN
#include <stipple/progress.h>
#include <stipple/result.h>
#include <stipple/view.h>

#include <glm/glm.hpp>
#include <string>

#include "engine/base/progress.h"
#include "engine/base/result.h"
#include "engine/scene/camera.h"
#include "engine/scene/open/open_settings.h"

namespace stipple::v1 {

inline Error given(const ::stipple::Error& e) { return {static_cast<ErrorKind>(e.kind), e.what, e.where, e.hint}; }
inline ::stipple::Error taken(const Error& e) {
    return {static_cast<::stipple::ErrorKind>(e.kind), e.what, e.where, e.hint};
}
inline Vec3 given(const glm::dvec3& v) { return {v.x, v.y, v.z}; }
inline glm::dvec3 taken(const Vec3& v) { return {v[0], v[1], v[2]}; }

Camera given(const scene::Camera& camera);
/// Error (usage): what is no camera.
::stipple::Result<scene::Camera> taken(const Camera& camera);

/// Sizes in bytes, threads, and who is told: one call at a time, whatever threads it comes from; a stop that was asked
/// for once is one for good.
scene::OpenSettings openSettings(uint64_t memoryBytes, unsigned threads, uint64_t surfels, const Listener& listener);

}  // namespace stipple::v1
