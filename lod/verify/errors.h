// The errors of a store, measured again from what the file holds.
#pragma once

#include <limits>

#include "lod/store/store.h"

namespace stipple::lod {

/// Measures records of an inner node, all whose children are leaves, against the leaf records below it, both ways:
/// every place of a leaf's disc has to lie within the record's error of the disc above it, and every place of a
/// record's disc (33 of each are looked at, of about `most` records) within its error of a leaf. Of other inner nodes,
/// below which the leaves are many, 9 places of 16 records, those with the smallest errors for their size (none where
/// `most` is given), and so of an overview, which comes first in a chunk as it is drawn (readDrawnChunk): that is what
/// is to be given here. An error if one does not; else how many records were measured.
Result<uint64_t> measureErrors(const Store& store, uint32_t node, const Chunk& chunk,
                               uint64_t most = std::numeric_limits<uint64_t>::max());

/// Are the points of a leaf drawn where they are stored? Records are drawn to the steps of their node, and the low bits
/// of places are not: an error if many of them lie as near to each other as such steps.
Result<void> checkDrawnPlaces(const Store& store, uint32_t index, const Chunk& chunk);

/// Measures the simplification of a group against its triangles, both ways, at a few dozen corners of each: none may be
/// farther away than the group's error says. An error if one is; else how many triangles were compared (0 for a group
/// that is not simplified).
Result<uint64_t> measureGroup(const Store& store, uint32_t group, const Chunk& chunk);

/// Measures segments of an inner curve node, all whose children are leaves, against the leaves' segments, at a few
/// dozen places: the ball that each place stands for has to be within the segment's error of one of theirs. (The other
/// way is not in the file where thin curves were pruned.) An error if one is not; else how many segments were
/// measured.
Result<uint64_t> measureCurves(const Store& store, uint32_t node, const Chunk& chunk);

}  // namespace stipple::lod
