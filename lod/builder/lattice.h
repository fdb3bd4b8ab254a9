// One lattice for all inputs, found before a point is read.
#pragma once

#include <string>
#include <vector>

#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// How the whole steps of one source become steps of the common lattice: step = X * ratio + shift, per axis.
struct ToLattice {
    glm::dvec3 ratio{1}, shift{0};
    bool exact = true;
};

struct CommonLattice {
    double unit = 1;
    glm::dvec3 base{0};  ///< world position of step 0
    std::vector<ToLattice> of;
};

/// The coarsest lattice on which the steps of every source lie exactly: the finest scale there is, or a whole fraction
/// of it (to 1/1000). Where there is none, the finest scale, and the sources that do not fit are marked.
CommonLattice findLattice(const std::vector<SourceInfo>& sources);

}  // namespace stipple::lod
