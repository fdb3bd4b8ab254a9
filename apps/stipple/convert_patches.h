// `stipple convert --patches`: a scan or a mesh as elevation patches, drawn as triangles, with a report.
#pragma once

#include <string>

#include "apps/stipple/common.h"
#include "lod/builder/patches/patch_build.h"

namespace stipple::app {

struct PatchConversion {
    std::string input, output;
    bool json = false, force = false, fillGaps = false, overlap = false;
    bool open = false;  ///< neither: the control of tests
    lod::PatchSettings settings;
    BuildOptions build;  ///< of which reading the input uses some
};

/// --patches and what belongs to it.
void addPatchOptions(CLI::App& app, bool& patches, PatchConversion& o);

Result<void> convertToPatches(const PatchConversion& o);

}  // namespace stipple::app
