// The visibility key: what is in front at a pixel. 64 bits, of which the smallest wins:
//
//   depth 31 | draw id 33 = 256 * block + lane
//
// depth: the bits of a linear depth in fp32, whose sign is always 0 (so that they sort like integers). Blocks are those
// of the frame, sorted by kind (lod/primitives/kinds.inl): all of points, of curves, of triangles, of patches, then the
// points' once more, for those that are wide discs (wide_disc.h). What is equally deep goes to the kinds in that order.
// This file alone knows bits.
#ifndef STIPPLE_SHARED_VISIBILITY_H
#define STIPPLE_SHARED_VISIBILITY_H
#include "types.h"
SHARED_BEGIN

const uint kKindPoints = 0u;
const uint kKindCurves = 1u;
const uint kKindTriangles = 2u;
const uint kKindPatches = 3u;
const uint kKindDiscs = 4u;
const uint kKindNothing = 5u;

// The first block of each kind of a frame.
struct BlockRanges {
    uint of[kKindNothing];
};

const uint kBlockLanes = 256u;  // draw ids of a block
const uint kLaneBits = 8u;
const uint kMostBlocks = 1u << 25;        // of a frame, all kinds
const uint kMostBlocksOfKind = 1u << 24;  // so that a place within a kind has 32 bits

const uint kDrawIdBits = 33u;          // of a key, below its depth
const uint64_t kNoKey = ~uint64_t(0);  // nothing is seen
const uint64_t kDrawIdMask = (uint64_t(1) << kDrawIdBits) - uint64_t(1);

// `place`: 256 * block + lane, counted from the first block of the kind on.
SHARED_FN uint64_t drawId(uint firstBlock, uint place) { return (uint64_t(firstBlock) << kLaneBits) + uint64_t(place); }
SHARED_FN uint64_t visibilityKey(uint depthBits, uint64_t id) { return uint64_t(depthBits) << kDrawIdBits | id; }
SHARED_FN uint keyDepthBits(uint64_t key) { return uint(key >> kDrawIdBits); }
SHARED_FN float keyDepth(uint64_t key) { return uintBitsToFloat(keyDepthBits(key)); }
SHARED_FN uint keyBlock(uint64_t key) { return uint((key & kDrawIdMask) >> kLaneBits); }
SHARED_FN uint keyLane(uint64_t key) { return uint(key) % kBlockLanes; }
SHARED_FN uint keyPlace(uint64_t key, uint firstBlock) { return uint((key & kDrawIdMask) - drawId(firstBlock, 0u)); }
SHARED_FN bool isPointKey(uint64_t key, BlockRanges first) { return keyBlock(key) < first.of[kKindPoints + 1u]; }
SHARED_FN uint keyKind(uint64_t key, BlockRanges first) {
    const uint block = keyBlock(key);
    uint kind = kKindPoints;
    for (uint k = kKindPoints + 1u; k < kKindNothing; ++k) kind += block < first.of[k] ? 0u : 1u;
    return key == kNoKey ? kKindNothing : kind;
}

SHARED_END
#endif
