// Which buffer is bound where, what a dispatch is told, and how large what passes share is: for GLSL and for C++.
#ifndef STIPPLE_SHARED_BINDINGS_H
#define STIPPLE_SHARED_BINDINGS_H
#include "types.h"
SHARED_BEGIN

const uint kFrameBinding = 0u;
const uint kNodesBinding = 1u;
const uint kBlocksBinding = 2u;
const uint kVisibilityBinding = 3u;
const uint kTexelsBinding = 4u;
const uint kStatsBinding = 5u;
const uint kImageBinding = 6u;
const uint kExtraBinding = 7u;
const uint kMeshesBinding = 8u;
const uint kClustersBinding = 9u;
const uint kMaterialsBinding = 10u;
const uint kTexturesBinding = 11u;
const uint kTilesBinding = 12u;
const uint kLightsBinding = 13u;
const uint kTriangleWordsBinding = 14u;
const uint kLargeBinding = 15u;
const uint kEnvironmentBinding = 16u;
const uint kWideBinding = 17u;
const uint kDiscsBinding = 18u;
const uint kSurfaceBinding = 19u;
const uint kFrontsBinding = 20u;
const uint kSumsBinding = 21u;
const uint kFilteredBinding = 22u;
const uint kCoverageBinding = 23u;
const uint kMaterialSumsBinding = 24u;
const uint kSecondGroupsBinding = 25u;
const uint kLayerBinding = 26u;
const uint kOpticsBinding = 27u;
const uint kBehindBinding = 28u;
const uint kBackBinding = 29u;
const uint kEdlBinding = 30u;
const uint kFogBinding = 31u;
const uint kToneBinding = 32u;
const uint kOcclusionBinding = 33u;
const uint kOpenBinding = 34u;
const uint kShadowBinding = 35u;
const uint kBackgroundBinding = 36u;
const uint kBackdropBinding = 37u;
const uint kReflectionBinding = 38u;
const uint kBindings = 39u;

// Per pixel:
const uint kTexelWords = 5u;     // planes of a packed texel; in frames with materials of points one more
const uint kTriangleWords = 2u;  // material, emission
const uint kExtraFloats = 7u;    // in planes: depths, normals xyz, linear rgb (of casters only the first)

// Lists of what covers so many pixels that all threads fill it, and how: each workgroup a band of rows.
const uint kLargeCapacity = 65536u;  // triangles
const uint kWideCapacity = 65536u;   // curves
const uint kBandRows = 16u;
const uint kBandGroups = 64u;             // beside each other, one after another through the list
const uint kGroupsPerDimension = 65535u;  // of blocks: the others are in the next row

const uint kPixelTile = 8u;  // pixels along an edge of a workgroup's

// How many groups there are over blocks, bands and pixels, where the device itself finds out whether there is anything
// to do: z is 0 until there is.
struct GroupCounts {
    uint x;
    uint y;
    uint z;
};
const uint kOverBlocks = 0u;
const uint kOverBands = 1u;
const uint kOverPixels = 2u;
const uint kGroupShapes = 3u;

// `fine` and `coarse` are word offsets of the planes of two levels of the pyramid.
struct Step {
    uint fine;
    uint fineWidth;
    uint fineHeight;
    uint coarse;
    uint coarseWidth;
    uint coarseHeight;
    uint level;          // of the fine side
    uint wantExtra;      // write depth, normals and linear colour
    uint hasPyramid;     // levels above the first are of this frame
    uint hasTubes;       // texels may be of tubes
    uint hasTriangles;   // pixels may be of triangles or patches
    uint hasWideDiscs;   // there is a list of them
    uint exactPoints;    // points are what their pixels show, at the depth of the visibility buffer
    uint hasFiltered;    // ... of what discs were blended to
    uint onlySmooth;     // of the nodes of points, those that are kNodeSmooth
    uint hasBackground;  // what is not covered shows what pass background has left, else frame.background
    uint hasMirrored;    // light adds what pass reflection has left
    uint hasSmooth;      // pixels of wide discs take colours and normals from a pyramid of their own ...
    uint smoothTexels;   // ... whose level 0 has its planes here
    uint count;          // of clusters or blocks
    uint firstBlock;     // of the ids that are drawn
};

SHARED_END
#endif
