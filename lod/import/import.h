// Readers: one file per format, each a function that opens a file and returns a PointSource.
#pragma once

#include <string>

#include "lod/primitives.h"

namespace stipple::lod {

/// By extension, then by content: .ply, .las. Errors say which formats there are.
Result<PointSource> openPointSource(const std::string& path);

/// PLY: ascii, binary little and big endian; any property order and type; elements before `vertex` and properties that
/// are not known are skipped.
Result<PointSource> openPly(const std::string& path);

/// LAS 1.0 to 1.4 uncompressed, point formats 0 to 10.
Result<PointSource> openLas(const std::string& path);

}  // namespace stipple::lod
