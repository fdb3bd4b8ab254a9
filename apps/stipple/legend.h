// What the colours of a picture stand for, for a person: a bar with values or a list of categories.
#pragma once

#include "engine/render/backend.h"
#include "lod/store/colour.h"

namespace stipple::app {

struct LegendEntry {
    uint32_t rgb = 0;
    std::string label;
};

struct Legend {
    std::string title;
    std::vector<uint32_t> bar;         ///< colours from low to high; empty: a list of categories
    std::vector<LegendEntry> entries;  ///< evenly spaced along the bar; empty: the colours are the scene's own
    LegendEntry noData;                ///< below the bar; no label: all points have data
};

Legend makeLegend(const lod::ColourBy& by, const lod::StoreDescription& description);
/// Draws it into the lower left corner.
void drawLegend(const Legend& legend, render::Image& image);

}  // namespace stipple::app
