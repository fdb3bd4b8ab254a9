// What a store's tables say must be possible before anyone walks them: right hashes only mean that nobody damaged the
// file, not that somebody did not write it on purpose.
#pragma once

#include "lod/store/layout.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// An input error with the advice that fits all of them.
Error damagedStore(const std::string& where, const std::string& what);

/// Fewest bytes that a chunk with that many records of `stride` bytes takes once zstd is undone: meshoptimizer's codec
/// spends four bytes on each byte plane of 256 records.
inline uint64_t fewestEncodedBytes(uint64_t records, uint64_t stride) { return records / 256 * 4 * stride; }
/// No zstd frame holds more than that many times its own bytes: blocks of 128 KiB take four bytes at least.
inline constexpr uint64_t kMostZstdGain = 32768;
/// The smallest chunk that holds anything.
inline constexpr uint64_t kFewestChunkBytes = 12;

/// Could so few bytes of the file be so many bytes of a table?
inline bool isPossibleGain(uint64_t bytes, uint64_t rawBytes) { return rawBytes / kMostZstdGain <= bytes; }

/// Everything that selectCut, the streamer and the renderers index by or walk along, and that their numbers stay
/// finite. Chunks end before `chunksEnd`.
/// Of a table that is read page by page: what is known without them.
Result<void> checkTables(const Store& store, uint64_t chunksEnd);
/// The same of a page of the table of a tree, whose parents' pages were checked; `flags`: layout::kTable... (That
/// streams of different pages share no bytes is checked where all pages are.)
Result<void> checkPage(const Hierarchy& h, const layout::Places& first, const layout::Places& end, uint32_t flags,
                       uint64_t chunksEnd, const std::string& path);

/// Of nodes [begin, end), which are there: light of their own in maps of patches came with kLightVersion.
Result<void> checkLight(const Hierarchy& h, uint64_t begin, uint64_t end, uint32_t version, const std::string& path);

/// Of a payload of triangles of an octree: is its group? A run is what lies in an octant of the node's cell; textures
/// and coordinates of more than 30 bits there are none.
bool isPossibleGroup(const Hierarchy& h, uint32_t chunk);

/// Of a store that is built: can what its coordinates say be computed with? An input error that names its source.
Result<void> checkSpace(const Hierarchy& h, const StoreDescription& d);

/// Of a decoded chunk: renderers index materials by what vertices say.
Result<void> checkMaterials(const Store& store, const Chunk& chunk, const std::string& where);

}  // namespace stipple::lod
