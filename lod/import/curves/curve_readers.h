// Readers of ribbons and tubes: files to polylines, as they are (see cleanCurves).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/base/cursor.h"
#include "engine/base/result.h"
#include "lod/primitives/curve_source.h"
#include "lod/store/file_kind.h"

namespace stipple::lod {

/// By what the file begins with, then by extension: .swc, .trk, .hair, .txt and .csv (cylinder models).
bool isCurveFile(const std::string& path);
bool isCurveFile(const std::string& path, FileKind kind);
/// TrackVis and hair files are read block by block; the others, small by nature, as a whole.
Result<CurveSource> openCurves(const std::string& path);
Result<CurveSource> openCurves(const std::shared_ptr<const ByteSource>& file);

// By format; `path` names the file in messages.
/// SWC neurons: one tube per unbranched section, coloured by the kind of section.
Result<CurveSet> readSwc(std::string_view text, const std::string& path);
/// TrackVis streamlines: tubes without radii, coloured by direction.
Result<void> readTrk(Cursor from, const std::string& path, const CurveSource::Take& take);
/// Hair models (cyHair): tubes, half as wide as the file's thickness.
/// `open`: a cursor from any place in the file.
Result<void> readHair(const std::function<Cursor(uint64_t offset)>& open, const std::string& path,
                      const CurveSource::Take& take);
/// Cylinders of a quantitative structure model, as TreeQSM writes them: tubes along the branches.
Result<CurveSet> readQsm(std::string_view text, const std::string& path);

}  // namespace stipple::lod
