// Counts what is taken from the heap by `new`, in programs that allocations.cpp is compiled into.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/scene/camera.h"

namespace stipple::test {

/// Since the program began, of all threads, and of the one that asks.
uint64_t allocations();
uint64_t ownAllocations();

/// Round a place, near and far.
inline std::vector<lod::View> viewsRound(const glm::dvec3& centre, double size) {
    std::vector<lod::View> views;
    for (int k = 0; k < 40; ++k) {
        scene::Camera camera;
        const double a = 0.5 * k, distance = size * std::exp2(0.2 * (k % 20) - 1);
        camera.eye = centre + distance * glm::dvec3(std::cos(a), 0.4, std::sin(a));
        camera.target = centre;
        camera.up = {0, 1, 0};
        views.push_back(scene::makeView(camera, 1280, 720, 1e-3));
    }
    return views;
}

}  // namespace stipple::test
