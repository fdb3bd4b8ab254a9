// The tables of a store as bytes: of nodes, payloads and their streams, and of meshes.
#pragma once

#include <string>
#include <vector>

#include "engine/base/file.h"
#include "lod/store/hierarchy.h"
#include "lod/store/layout.h"

namespace stipple::lod {

/// Streams of one payload, at most.
inline constexpr uint32_t kMostStreams = 16;

/// `most`: bytes that what was read before allows it to have; checked before any memory is taken.
Result<std::vector<uint8_t>> readSection(const ByteSource& file, const layout::Section& s, uint64_t most,
                                         const char* name);

/// Nodes, payloads, streams and counts per code.
Result<void> readNodes(const ByteSource& file, const layout::Head& head, Hierarchy& h);
/// The same of versions 6 and 7, but for the kinds; were there counts per code?
Result<bool> readOldNodes(const ByteSource& file, const layout::Head& head, Hierarchy& h);
/// Every node has one payload, of this kind.
void setKindOfAll(Hierarchy& h, Kind kind);
Result<void> readMesh(const std::vector<uint8_t>& bytes, const std::string& path, Hierarchy& h);

/// Sections, uncompressed.
struct TableBytes {
    std::vector<uint8_t> nodes, counts, payloads;
};
TableBytes tablesOf(const Hierarchy& h);
std::vector<uint8_t> meshBytes(const Hierarchy& h);

}  // namespace stipple::lod
