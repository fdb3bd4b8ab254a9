// What wind moves, written down once more (engine/render/wind.h says what is meant, and is not asked): of a plant that
// reaches `height` above its foot, what stands u of that high moves along the wind by swing u^2. Of the full detail,
// place by place: neither nodes nor matrices are known here.
#pragma once

#include "apps/study/audit/full_detail.h"

namespace stipple::study {

struct Sway {
    glm::dvec3 along{1, 0, 0}, up{0, 0, 1};  ///< unit, across each other
    double foot = 0, height = 1;             ///< along `up`, world units
    double swing = 0;                        ///< of the top at this time
    double most = 0;                         ///< of the top at any time
    glm::dvec3 moved(const glm::dvec3& p) const;
};

/// Of a placed store at a time. `strength`: how far the top moves at most, share of the height.
Sway swayOf(const render::PlacedStore& placed, const glm::dvec3& up, const glm::dvec3& towards, double strength,
            double seconds);

/// All shapes where wind has them; radii stay.
FullShapes moved(const FullShapes& shapes, const Sway& sway);

/// Of places: how far they moved at most, over what the top moves at any time.
double farthestMoved(const FullShapes& shapes, const Sway& sway);

}  // namespace stipple::study
