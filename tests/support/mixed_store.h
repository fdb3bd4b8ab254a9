// A store of five nodes, written by hand, whose nodes have payloads of several kinds: a floor of points from afar that
// ends in points in one quarter and in triangles in the others, with points and tubes above some of those; and a roof
// of triangles that is there from afar only.
#pragma once

#include <string>
#include <vector>

#include "lod/store/store.h"

namespace stipple::test {

enum MixedParts : uint32_t { kMixedPoints = 1, kMixedTriangles = 2, kMixedCurves = 4, kMixedAll = 7 };

/// With the payloads of those kinds alone, and the nodes that have any. Throws if it cannot be written.
void writeMixedStore(const std::string& path, uint32_t parts = kMixedAll);

/// The kinds of its nodes' payloads in their order, the root's first.
std::vector<std::vector<lod::Kind>> mixedKinds(uint32_t parts = kMixedAll);

/// Bytes of a stream of a reserved id that the root's first payload has, beside its records.
std::vector<uint8_t> mixedStream();

}  // namespace stipple::test
