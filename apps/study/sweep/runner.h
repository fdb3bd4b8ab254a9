// The straight line of `stipple study SCENE...`: errors of all cells, then times of all cells in blocks, each in an
// order of its own. What is finished lies in journals in the folder; a stop loses at most one view's or one cell's
// work. Errors are the same bytes for the same scenes, settings and seed.
#pragma once

#include "apps/study/audit/originals.h"
#include "apps/study/machine.h"
#include "apps/study/study.h"
#include "apps/study/sweep/arrivals.h"
#include "apps/study/sweep/errors.h"
#include "apps/study/sweep/journal.h"

namespace stipple::study {

/// Where numbers are from.
struct Provenance {
    std::string version, compiler, flags, program;  ///< program: hash of its file
    Machine machine;
    std::string device;
};

/// Of one visit to a cell in a block.
struct Visit {
    uint32_t cell = 0, block = 0;
    std::vector<double> ms;                              ///< frames
    std::vector<std::pair<std::string, double>> passes;  ///< medians, ms
};

/// How much the traced pictures changed when twice as many rays were taken along each axis.
struct TruthCheck {
    uint32_t scene = 0, size = 0;
    double decibels = 0;  ///< foreground
};

/// Of a scene that was built from a file of points.
struct KeptOf {
    uint32_t scene = 0;
    KeptAudit audit;
};

struct StudyResult {
    StudySettings settings;
    Provenance provenance;
    std::vector<Cell> cells;
    std::vector<CellErrors> errors;  ///< of each cell
    std::vector<Visit> visits;       ///< in the order in which they were made
    std::vector<TruthCheck> truths;
    std::vector<KeptOf> kept;
    std::vector<ArrivalStep> arrivals;  ///< of all scenes, at the first size
    std::vector<std::string> notes;     ///< what was not measured, and why
};

/// Name of a cell's crop in the folder, where it has one: cells whose target is that nearest to a pixel.
std::string cropName(uint32_t cell);
double cropTarget(const StudySettings& settings);

/// Refuses a folder that cannot be written, or that holds another study. After it the folder is this study's.
Result<void> claimFolder(const std::vector<StudyScene>& scenes, const StudySettings& settings,
                         const Provenance& provenance);

Result<StudyResult> runStudy(const std::vector<StudyScene>& scenes, const StudySettings& settings,
                             const Provenance& provenance, const std::string& device, const Host& host);

}  // namespace stipple::study
