// Closed surfaces given by a function of space, samples of them with exact normals, and views around a store: what
// pictures of points are judged on.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "lod/cut/cut.h"
#include "lod/store/store.h"
#include "tests/support/support.h"

namespace stipple::test {

/// A sphere of radius 1 with bumps and hollows of a quarter of it, or a ring of radius 1, 0.35 thick.
enum class Shape { statue, torus };
/// < 0 inside.
double insideOf(Shape shape, const glm::dvec3& place);
/// About `count` samples, irregular by a third of their spacing.
std::vector<TestPoint> samplesOf(Shape shape, size_t count, uint64_t seed);
/// Spacing of `count` samples, world units.
double spacingOf(Shape shape, size_t count);
/// Does the ray from `eye` meet it? By steps along the ray; those that pass it by less than 1e-3 may be taken as
/// misses.
bool meetsShape(Shape shape, const glm::dvec3& eye, const glm::dvec3& direction);

/// A square picture, `distance` times the diagonal of the bounds away from their middle; degrees.
lod::View lookAt(const lod::Store& store, double azimuth, double elevation, double distance, uint32_t size);

}  // namespace stipple::test
