// `stipple info` for input files: what they are, and whether their headers tell the truth.
#pragma once

#include "engine/base/executor.h"
#include "engine/base/result.h"
#include "engine/scene/read_settings.h"
#include "lod/import/formats.h"

namespace stipple::app {

struct InputInfoOptions {
    std::string input;
    bool verify = false;  ///< read every point, however many there are
    bool json = false;
    bool skipBad = false;
    scene::ReadSettings reading;
    lod::FormatOptions more = {};
};

Result<void> showInputInfo(const InputInfoOptions& options, Executor& executor);

}  // namespace stipple::app
