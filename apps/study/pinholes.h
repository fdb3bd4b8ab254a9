// Closed surfaces from anywhere: pixels that stay open although their rays meet the surface.
#pragma once

#include <map>

#include "apps/study/measure.h"

namespace stipple::study {

struct Pinholes {
    uint64_t looked = 0;  ///< pixels whose rays pass the sphere's middle within 0.97 of its radius
    std::map<render::Mode, uint64_t> open;
};
/// Of points on the unit sphere, from so many random eyes outside it: far, and near enough that single discs fill the
/// picture and some cross the near plane.
Result<Pinholes> countPinholes(Drawer& sphere, uint32_t poses, uint32_t size);

}  // namespace stipple::study
