// Readers: one file or folder per format, each a function that reads a header and returns a PointSource.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lod/import/formats.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// By content, then by extension, of the formats in the table (formats.h). Errors say which there are.
Result<PointSource> openPointSource(const OpenBytes& open, const ReadOptions& options = {});
/// Formats that are read from a file only, too.
Result<PointSource> openPointSource(const std::string& path, const ReadOptions& options = {},
                                    const FormatOptions& more = {});

/// PLY: ascii, binary little and big endian; any property order and type; elements before `vertex` and lists are
/// skipped.
Result<PointSource> openPly(const OpenBytes& open, const ReadOptions& options = {});
Result<PointSource> openPly(const std::string& path, const ReadOptions& options = {});

/// LAS 1.0 to 1.5 and LAZ (pointwise, chunked, layered), point formats 0 to 10.
Result<PointSource> openLas(const OpenBytes& open, const ReadOptions& options = {});
Result<PointSource> openLas(const std::string& path, const ReadOptions& options = {});

/// Every point of a source in file order, on this thread; `take` is called with each block. Returns their number.
Result<uint64_t> readPoints(const PointSource& source, const std::function<Result<void>(const PointBlock&)>& take = {});

/// What a person names as input, as files: a file is itself; a folder is every file of a format in the table below it;
/// a pattern
/// (*, ?, [) is what it matches; the ept.json or cloud.js of a LAZ octree is its node files, whose points together are
/// the scan. Sorted by name, so that the order does not depend on the file system. A file that is named twice (by
/// links, or itself and with its folder) is taken once, which `notes` says.
Result<std::vector<std::string>> expandInputs(const std::vector<std::string>& inputs,
                                              std::vector<std::string>* notes = nullptr);

/// The number of points that the description of an octree (ept.json, cloud.js, or their folder) declares; nothing if
/// `input` is no octree or declares none.
std::optional<uint64_t> declaredByOctree(const std::string& input);

}  // namespace stipple::lod
