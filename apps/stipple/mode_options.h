// Options of `render` that only some of the modes use.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "engine/base/result.h"

namespace stipple::app {

/// Refuses what was asked for and would be ignored: an option that mode `mode` does not use.
Result<void> checkOfMode(const CLI::App& sub, const std::string& mode);

}  // namespace stipple::app
