// Readers of ribbons and tubes: whole files to polylines, as they are (see cleanStrands).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/base/result.h"
#include "lod/strands.h"

namespace stipple::lod {

/// By extension: .swc, .trk, .hair, .txt and .csv (cylinder models).
bool isStrandFile(const std::string& path);
Result<StrandSet> readStrands(const std::string& path);

// By format; `path` names the file in messages.
/// SWC neurons: one tube per unbranched section, coloured by the kind of section.
Result<StrandSet> readSwc(std::string_view text, const std::string& path);
/// TrackVis streamlines: tubes without radii, coloured by direction.
Result<StrandSet> readTrk(const std::vector<uint8_t>& bytes, const std::string& path);
/// Hair models (cyHair): tubes, half as wide as the file's thickness.
Result<StrandSet> readHair(const std::vector<uint8_t>& bytes, const std::string& path);
/// Cylinders of a quantitative structure model, as TreeQSM writes them: tubes along the branches.
Result<StrandSet> readQsm(std::string_view text, const std::string& path);

}  // namespace stipple::lod
