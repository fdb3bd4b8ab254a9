// The papers' figures once more, as pictures.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/study/models.h"
#include "engine/render/backend.h"

namespace stipple::study {

struct Figure {
    std::string file;    ///< below the output folder
    std::string source;  ///< paper and figure
    std::string title;
    std::vector<std::string> panels;  ///< from left to right, row by row
};

struct FigureTools {
    std::string dataFolder, folder;  ///< of models; of stores and pictures
    bool isQuick = false;
    Executor& executor;
    std::function<Result<std::unique_ptr<render::Backend>>()> backend;
    std::function<Result<void>(const std::string& what)> say;  ///< before each; an error stops it
};
/// Writes PNGs; figures whose models are not there are left out, and named in `missing`.
Result<std::vector<Figure>> drawFigures(const FigureTools& tools, std::vector<std::string>& missing);

}  // namespace stipple::study
