// What a frame and a drawn node tell the passes. Scalar layout on both sides; sizes are asserted in C++ and every field
// is written and read back by a GPU test.
//
// Camera space is z-forward, y-down, in world units relative to the eye.
#ifndef STIPPLE_SHARED_FRAME_H
#define STIPPLE_SHARED_FRAME_H
#include "lens.h"
#include "visibility.h"
SHARED_BEGIN

// One node of the cut. Position of record (x, y, z) in camera space: base + axisX*x + axisY*y + axisZ*z; the
// coefficients are composed in fp64 relative to the eye and rounded once.
struct DrawNode {
    vec3 axisX;
    vec3 axisY;
    vec3 axisZ;
    vec3 base;
    float edge;       // edge of the node's cell, world units: scale of the radius codes
    uint errorCode;   // records with an own error code <= this are fine enough
    uint octantMask;  // octants whose child is not drawn: their records are drawn whatever their error; kNode...
    uint count;       // where its records end in the chunk
    uint addressLow;  // device address of the first record (gpu backend)
    uint addressHigh;
    uint level;         // depth in the octree, for the debug view
    float errorPixels;  // screen-space error delivered by this node, for the debug view
    float spacing;      // of its records on their surface, world units; 0: not known
    uint weights;       // records of its chunk, where weights of surfels lie behind them; 0: there are none. Of
                        // patches (gpu backend): the first of theirs among the frame's DrawMesh
    uint material;      // of points and patches without materials of their own (material.h): packed, or kPlainPoint
    uint materials;  // behind so many records (and weights), or blocks of patches, lie materials of points, or of the
                     // blocks' samples, two a word; 0: all have `material`
};

const uint kNodeTurned = 256u;   // the store's own axes are not those of the world
const uint kNodeWide = 512u;     // points of it may be wide discs (wide_disc.h)
const uint kNodeSmooth = 2048u;  // its discs are so wide that they would show as facets (smooth.h)
const uint kNodeBent = 1024u;    // wind shears it: directions are not as long as they were, normals are no tangents

// A tangent of the store in camera space; as long as it was where nothing is bent. Instances are scaled evenly.
SHARED_FN vec3 nodeDirection(DrawNode node, vec3 n) {
    const vec3 x = node.axisX;
    const float inverse = 1.0f / sqrt(x.x * x.x + x.y * x.y + x.z * x.z);
    return vec3((x.x * n.x + node.axisY.x * n.y + node.axisZ.x * n.z) * inverse,
                (x.y * n.x + node.axisY.y * n.y + node.axisZ.y * n.z) * inverse,
                (x.z * n.x + node.axisY.z * n.y + node.axisZ.z * n.z) * inverse);
}

// The same of normals. They stand on surfaces: where wind shears those, normals follow the inverse transpose of what
// tangents follow, which is the matrix of cofactors but for its scale. Of any length where a node is bent.
struct NormalAxes {
    vec3 x;
    vec3 y;
    vec3 z;
    float scale;
};
SHARED_FN vec3 crossed(vec3 a, vec3 b, float scale) {
    return vec3((a.y * b.z - a.z * b.y) * scale, (a.z * b.x - a.x * b.z) * scale, (a.x * b.y - a.y * b.x) * scale);
}
SHARED_FN NormalAxes normalAxes(DrawNode node) {
    const vec3 x = node.axisX;
    const float inverse = 1.0f / sqrt(x.x * x.x + x.y * x.y + x.z * x.z);
    const bool isBent = (node.octantMask & kNodeBent) != 0u;
    // First to a length of about 1: products of three lengths do not fit into a float.
    const vec3 a = vec3(x.x * inverse, x.y * inverse, x.z * inverse);
    const vec3 b = vec3(node.axisY.x * inverse, node.axisY.y * inverse, node.axisY.z * inverse);
    const vec3 c = vec3(node.axisZ.x * inverse, node.axisZ.y * inverse, node.axisZ.z * inverse);
    const vec3 bc = crossed(b, c, 1.0f);
    const float side = a.x * bc.x + a.y * bc.y + a.z * bc.z < 0.0f ? -1.0f : 1.0f;  // of a mirrored placement
    const vec3 ca = crossed(c, a, side);
    const vec3 ab = crossed(a, b, side);
    NormalAxes n;
    n.x = vec3(isBent ? bc.x * side : x.x, isBent ? bc.y * side : x.y, isBent ? bc.z * side : x.z);
    n.y = vec3(isBent ? ca.x : node.axisY.x, isBent ? ca.y : node.axisY.y, isBent ? ca.z : node.axisY.z);
    n.z = vec3(isBent ? ab.x : node.axisZ.x, isBent ? ab.y : node.axisZ.y, isBent ? ab.z : node.axisZ.z);
    n.scale = isBent ? 1.0f : inverse;
    return n;
}
SHARED_FN vec3 nodeNormal(DrawNode node, vec3 n) {
    const NormalAxes m = normalAxes(node);
    return vec3((m.x.x * n.x + m.y.x * n.y + m.z.x * n.z) * m.scale,
                (m.x.y * n.x + m.y.y * n.y + m.z.y * n.z) * m.scale,
                (m.x.z * n.x + m.y.z * n.y + m.z.z * n.z) * m.scale);
}
// Unit, of a unit normal.
SHARED_FN vec3 nodeUnitNormal(DrawNode node, vec3 unit) {
    const vec3 n = nodeNormal(node, unit);
    const bool isBent = (node.octantMask & kNodeBent) != 0u;
    const float shorten = 1.0f / sqrt(max(n.x * n.x + n.y * n.y + n.z * n.z, 1.0e-37f));  // (always: no branch)
    return vec3(isBent ? n.x * shorten : n.x, isBent ? n.y * shorten : n.y, isBent ? n.z * shorten : n.z);
}

// One block of 256 draw ids.
struct DrawBlock {
    uint node;   // index of the DrawNode
    uint first;  // first record of this block within the node's chunk
};

const uint kShadeUnlit = 0u;
const uint kShadeLit = 1u;        // points
const uint kShadeTriangles = 2u;  // a bit of its own

// What elevation patches are drawn as: triangles that are rasterised; splats, one a cell, whose pixels' rays meet the
// two triangles of the cell; or splats that rays meet where they meet the plane of the cell's first sample.
const uint kPatchStrips = 0u;
const uint kPatchSplats = 1u;
const uint kPatchDirect = 2u;

const uint kDebugNone = 0u;
const uint kDebugLevel = 1u;
const uint kDebugError = 2u;
const uint kDebugHoles = 3u;
const uint kDebugNormals = 4u;

struct FrameConstants {
    vec3 viewX;  // rows of the rotation from world to camera space, for normals
    vec3 viewY;
    vec3 viewZ;
    float focal;  // pixels; orthographic: pixels per world unit
    vec2 centre;  // principal point, pixels
    uint width;
    uint height;
    float nearPlane;      // world units
    float supportScale;   // splat radius of the reconstruction / stored radius
    float minimumRadius;  // pixels: smallest splat radius in the reconstruction
    uint shade;
    uint debugView;
    vec3 sunDirection;       // camera space, towards the sun
    vec3 skyDirection;       // camera space, up
    vec3 background;         // linear
    BlockRanges firstBlock;  // of each kind
    uint lightCount;         // 0: the sun above, else these instead
    float ambient;           // share of the sky's light
    uint hasEnvironment;
    float exactCurves;  // px: half-width from which a curve keeps exact pixels instead of being reconstructed
    uint coverageSeed;  // of curves narrower than a pixel: another one for each frame of a series that is averaged
    vec3 environmentX;  // rows of the rotation from camera space to the environment's (y up)
    vec3 environmentY;
    vec3 environmentZ;
    uint orthographic;      // 1: rays are parallel (lens.h)
    float lowPass;          // mode ewa: variance, px^2
    float kernelSupport;    // mode ewa: where kernels end, in sigmas
    uint perSurfel;         // mode ewa: 1: surfels have weights (surfel_weight.h), and pixels are not divided by them
    uint hasMaterials;      // some points have materials
    uint patchAs;           // kPatch...
    uint environmentSharp;  // edge of the sharpest map of the environment (environment.h); 0: none
};
SHARED_FN Lens frameLens(FrameConstants f) { return lensOf(f.focal, f.orthographic != 0u); }

// A light in camera space. `colour`: what a white diffuse surface that faces it sends back at distance 1 (directional:
// at any).
struct LightSource {
    vec3 position;  // directional: towards the light
    uint kind;
    vec3 colour;
    float range;  // 0: no limit
    vec3 axis;    // spot: where it points
    float cosInner;
    float cosOuter;
};
const uint kLightDirectional = 0u;
const uint kLightPoint = 1u;
const uint kLightSpot = 2u;

SHARED_END
#endif
