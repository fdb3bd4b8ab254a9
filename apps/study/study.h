// `stipple study`: the straight line of --seeds, and what it is lent by the program.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/study/figures.h"
#include "apps/study/machine.h"
#include "apps/study/measure.h"
#include "apps/study/outlines.h"
#include "apps/study/patch_rows.h"
#include "apps/study/pinholes.h"

namespace stipple::study {

struct SeedsSettings {
    std::string dataFolder, output;
    bool isQuick = false;
    int rounds = 5;  ///< frames of which times are medians
};

/// What the program lends: backends by their names as --device has them.
struct Host {
    Executor& executor;
    std::function<Result<std::unique_ptr<render::Backend>>(const std::string& device)> backend;
    std::function<Result<void>(const std::string& what, uint64_t done, uint64_t total)> say;  ///< an error stops it
};

struct ModeMeasure {
    render::Mode mode;
    FrameTime leaves, pixel;  ///< all records; the cut of one pixel
};
struct SizeMeasure {
    std::string device;
    uint32_t size;
    std::vector<ModeMeasure> modes;
};
struct ModelMeasure {
    size_t row;  ///< of modelRows()
    uint64_t points;
    std::vector<SizeMeasure> sizes;
    uint32_t errorSize;  ///< px, square, of the pictures that errors are of
    std::map<render::Mode, Errors> errors;
};
struct SeedsReport {
    SeedsSettings settings;
    Machine machine;  ///< before the first frame
    std::vector<std::string> devices;
    std::vector<ModelMeasure> models;
    std::vector<OutlineRow> outlines;
    uint32_t outlineSize = 0;
    Pinholes pinholes;
    uint32_t pinholePoses = 0;
    std::vector<PatchMeasure> patches;
    std::vector<Figure> figures;
    std::vector<std::string> missing;  ///< rows and figures that could not be made, and why
    double seconds = 0;
};

/// Everything, into the folder `settings.output`: pictures, index.md, seeds.json.
Result<SeedsReport> studySeeds(const SeedsSettings& settings, const Host& host);

/// Tables as Markdown, figures as links.
std::string describeSeeds(const SeedsReport& report);
nlohmann::json jsonOfSeeds(const SeedsReport& report);

}  // namespace stipple::study
