// Figures of elevation patches.
#pragma once

#include "apps/study/figures.h"

namespace stipple::study {

/// Panels of one figure, with what stands below each.
struct FigureSheet {
    std::vector<render::Image> panels;
    std::vector<std::string> captions;
    void add(render::Image image, std::string caption) {
        panels.push_back(std::move(image));
        captions.push_back(std::move(caption));
    }
};
struct PatchFigure {
    Figure figure;  ///< its panels are named by what is drawn
    Result<void> (*draw)(const FigureTools& tools, FigureSheet& out);
};
std::vector<PatchFigure> patchFigures();

}  // namespace stipple::study
