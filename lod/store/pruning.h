// What of curves is stochastic in a store.
#pragma once

#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// Curves whose radius is at most that share of a node's cell may be pruned in it.
inline constexpr double kThinCurve = 2.0 / 64;

/// Of a node of curves: share, by area, of its thin ones that are left, as much wider as the others went. It stands
/// where other nodes have the cosine of their cone of normals; 1 in stores that do not say.
inline double keptShare(const Node& node) {
    return node.normalConeCosine > 0 ? static_cast<double>(node.normalConeCosine) : 1.0;
}

}  // namespace stipple::lod
