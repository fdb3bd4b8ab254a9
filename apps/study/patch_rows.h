// The tables of Ochotta & Hiller 2006 and of Ochotta, Hiller & Saupe 2006: elevation patches beside the mesh that they
// were made of.
#pragma once

#include <nlohmann/json.hpp>

#include "apps/study/measure.h"

namespace stipple::study {

struct PatchRow {
    const char* model;   ///< theirs
    const char* theirs;  ///< samples / patches; MB and fps as mesh, splats blended, splats interpolated
    const char* file;    ///< ours, below the data folder
    const char* ours;
};
std::span<const PatchRow> patchRows();

struct PatchDrawn {
    std::string as;
    double medianMs = 0;
    double overlap = 0;      ///< of the silhouette and that of the mesh's clusters (IoU)
    uint64_t uncovered = 0;  ///< pixels that the mesh covers with all their neighbours, and this does not
};
struct PatchMeasure {
    size_t row = 0;  ///< of patchRows()
    uint64_t triangles = 0, samples = 0, patches = 0, left = 0;
    uint64_t bytes = 0, meshBytes = 0;
    double error = 0;        ///< bound of the leaves' distance from the source, in diagonals of the model
    double errorPixels = 0;  ///< of the view
    double meshMs = 0;
    std::vector<PatchDrawn> drawn;
};

struct PatchTools {
    std::string dataFolder, folder;
    bool isQuick = false;
    int rounds = 5;
    Executor& executor;
    std::function<Result<std::unique_ptr<render::Backend>>()> backend;
    std::function<Result<void>(const std::string& what)> say;
};
constexpr uint32_t kPatchPicture = 1024;  ///< px, square, as theirs are
/// Rows whose model is not there go to `missing`. Quick: the smallest alone.
Result<std::vector<PatchMeasure>> measurePatches(const PatchTools& tools, std::vector<std::string>& missing);

std::string describePatches(const std::vector<PatchMeasure>& measured);
nlohmann::json jsonOfPatches(const std::vector<PatchMeasure>& measured);

}  // namespace stipple::study
