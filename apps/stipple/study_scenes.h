// `stipple study SCENE...`: from options to what apps/study/sweep is told.
#pragma once

#include <string>
#include <vector>

#include "apps/stipple/common.h"

namespace stipple::app {

struct StudyOptions {
    std::vector<std::string> scenes;
    std::string output, device = "cpu", resident = "1G", path, against;
    std::vector<std::string> modes, sizes;
    std::vector<double> errors;
    std::vector<std::string> budgets;  ///< empty: as many as --quick and --full say
    std::vector<std::string> builds;   ///< names of ways to build scenes; empty: the usual one
    bool quick = false, full = false, calibrate = false, json = false, quiet = false;
    uint32_t blocks = 0, frames = 0, views = 0;  ///< 0: as many as --quick and --full say
    uint64_t seed = 1;
    BuildOptions build;
    /// Those that only studies of scenes have.
    void addTo(CLI::App& sub);
};

/// Draws, measures, writes the folder, and says what is in it.
Result<void> runSceneStudy(const StudyOptions& options);

/// What frames of the scenes cost on this device, kept for `--target-ms` and `--target-error`.
Result<void> runCalibration(const StudyOptions& options);

}  // namespace stipple::app
