// A floor with a ball over it, and lights that cast its shadow.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/render/frame.h"
#include "lod/store/store.h"
#include "tests/support/support.h"

namespace stipple::test::shadows {

inline constexpr double kRadius = 0.5;
inline const glm::dvec3 kBall(0.1, -0.1, 0.9);
inline const glm::dvec3 kTowardsSun = glm::normalize(glm::dvec3(0.5, 0.3, 1));

/// A floor of 4 x 4 at z = 0 and a ball above it, as points.
std::vector<TestPoint> floorAndBall(bool hasBall = true, double lower = 0);
/// The same as triangles.
std::shared_ptr<const lod::Store> triangles(const std::string& path, Executor& executor);

lod::View viewOf(bool isOrthographic = false, const glm::dvec3& eye = {2.2, -3.2, 2.6});
/// `size`: the angle at which it is seen, radians.
render::WorldLight sun(float size = 0);
render::WorldLight spot();
render::FrameSettings under(const render::WorldLight& light, render::Mode mode = render::Mode::splat);
std::unique_ptr<render::FrameState> drawn(const std::shared_ptr<const lod::Store>& store, render::Backend& backend,
                                          Executor& executor, const lod::View& view,
                                          const render::FrameSettings& settings);

/// What of the light comes to each pixel, from three pictures: with shadows, without, and without the light.
struct Mask {
    std::vector<double> share;  ///< -1: the light does not fall there at all
    std::unique_ptr<render::FrameState> state;
};
Mask maskOf(const std::shared_ptr<const lod::Store>& store, render::Backend& backend, Executor& executor,
            const lod::View& view, render::FrameSettings settings);

/// What pixel `i` shows.
glm::dvec3 placeOf(const lod::View& view, size_t i, double depth);

}  // namespace stipple::test::shadows
