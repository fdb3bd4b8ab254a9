// How much of a picture is stochastic: what the stated error does not speak of.
#pragma once

#include "engine/render/frame.h"

namespace stipple::render {

/// Of what a cut draws in view, whether or not something is in front of it. Areas as they are seen, px.
struct PrunedShares {
    double curveArea = 0;    ///< of all curves
    double narrowArea = 0;   ///< of those narrower than a pixel: each of their pixels is drawn or not
    double thinnedArea = 0;  ///< of wider ones that stand, as wide as needed, for others which are pruned
    uint64_t discs = 0;      ///< of proxies of plants: their places are stochastic
    double narrowShare() const { return curveArea > 0 ? narrowArea / curveArea : 0; }
    double thinnedShare() const { return curveArea > 0 ? thinnedArea / curveArea : 0; }
};

/// Of the state's last cut. Reads the chunks of curves again. Error: one that cannot be read.
Result<PrunedShares> measurePruning(const FrameState& state, const lod::View& view);

}  // namespace stipple::render
