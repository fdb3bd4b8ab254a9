// `stipple convert` to files of formats that can be written (lod/import/formats.h): points and triangles as they are.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "apps/stipple/common.h"

namespace stipple::app {

struct FormatConversion {
    std::string input, output;
    double voxel = 0;  ///< units; 0: not given
    bool json = false, force = false;
    BuildOptions build;
};
/// Can it be written by its name?
bool isWritten(const std::string& output);
/// ".vdb": those that can be written.
std::string writtenEndings();
void addFormatOptions(CLI::App& app, FormatConversion& o);
Result<void> convertToFormat(const FormatConversion& o);

}  // namespace stipple::app
