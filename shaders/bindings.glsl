// What every pass sees. Whatever a pass writes is bound by descriptor (synchronization validation does not look through
// device addresses); records are only read, by device address.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "shared/bindings.h"
#include "shared/frame.h"
#include "shared/material.h"
#include "shared/pack.h"
#include "shared/pyramid.h"
#include "shared/pyramid_tail.h"
#include "shared/record.h"
#include "shared/shade.h"
#include "shared/curve.h"
#include "shared/visibility.h"

layout(set = 0, binding = kFrameBinding, scalar) readonly buffer FrameBlock { FrameConstants frame; };
layout(set = 0, binding = kNodesBinding, scalar) readonly buffer NodeBlock { DrawNode nodes[]; };
layout(set = 0, binding = kBlocksBinding, scalar) readonly buffer BlockBlock { DrawBlock blocks[]; };
layout(set = 0, binding = kVisibilityBinding, scalar) buffer VisibilityBlock { uint64_t visibility[]; };
#ifndef TEXELS
#define TEXELS  // pull_tail says coherent: its threads read what others of them have written
#endif
layout(set = 0, binding = kTexelsBinding, scalar) TEXELS buffer TexelBlock { uint texels[]; };
layout(set = 0, binding = kStatsBinding, scalar) buffer StatsBlock { uint largestRadiusBits; GroupCounts levelGroups[]; };
layout(set = 0, binding = kImageBinding, scalar) writeonly buffer ImageBlock { uint image[]; };
layout(set = 0, binding = kExtraBinding, scalar) writeonly buffer ExtraBlock { float extra[]; };  // planes, see kExtraFloats

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Records { PointRecord records[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer RecordWords { uint words[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Segments { CurveSegment segments[]; };

layout(push_constant, scalar) uniform StepBlock { Step stepInfo; };

// May a key win against one that was read? Most lose by their depth, and need no atomic operation to: keys only fall, so
// that a depth that was read too early is larger, and hides nothing. (Its word alone: of two words one might be older
// than the other.)
bool mayWin(uint64_t key, uint64_t wasRead) { return uint(key >> 32) <= uint(wasRead >> 32); }
// Offers a key to a pixel.
void offerKey(uint at, uint64_t key) {
    if (mayWin(key, visibility[at])) atomicMin(visibility[at], key);
}

// A place of its own in a list for each of a subgroup's threads that come by together, of one atomic operation: `length`
// is the list's, `place` the answer. (In which order they come nothing may hang on.)
#define TAKE_PLACE(length, place)                                                                                \
    {                                                                                                            \
        const uvec4 asking = subgroupBallot(true);                                                               \
        uint first_ = 0u;                                                                                        \
        if (subgroupElect()) first_ = atomicAdd(length, subgroupBallotBitCount(asking));                         \
        place = subgroupBroadcastFirst(first_) + subgroupBallotExclusiveBitCount(asking);                        \
    }

Lens frameLensHere() { return lensOf(frame.focal, frame.orthographic != 0u); }
// The ray through a pixel's centre.
PixelRay pixelRayHere(uvec2 pixel) {
    return pixelRay(frameLensHere(), (float(pixel.x) + 0.5 - frame.centre.x) / frame.focal, (float(pixel.y) + 0.5 - frame.centre.y) / frame.focal);
}

// Of a point, number `record` of its chunk (material.h).
uint materialOf(DrawNode node, uint record) {
    if (node.materials == 0u || (node.material & kOnlyMaterial) != 0u) return node.material & ~kOnlyMaterial;
    const uint first = 4u * node.materials + (node.weights + 3u) / 4u;
    const uint pair = RecordWords(uvec2(node.addressLow, node.addressHigh)).words[first + record / 2u];
    return (record & 1u) != 0u ? pair >> 16 : pair & 0xffffu;
}

// Millions of pixels have one largest splat: a subgroup asks once for all of its own, and only where it would rise (what
// is read may be old, and then is smaller).
void takeLargest(float radius) {
    const uint largest = subgroupMax(floatBitsToUint(radius));
    if (subgroupElect() && largest > largestRadiusBits) atomicMax(largestRadiusBits, largest);
}

// Levels whose texels are larger than the largest splat hold nothing; the resolve pass has measured it.
uint levelCount() {
    const float largest = uintBitsToFloat(largestRadiusBits);
    return 1u + uint(ceil(log2(max(2.0, 2.0 * largest))));
}

Texel loadTexel(uint offset, uint width, uint height, int x, int y) {
    PackedTexel p;
    p.depth = -1.0;
    p.size = 0u;
    p.offset = 0x80008000u;
    p.normal = 0x80008000u;
    p.colour = 0u;
    uint surface = 0u;
    if (x >= 0 && y >= 0 && x < int(width) && y < int(height)) {
        const uint plane = width * height;
        const uint at = offset + uint(y) * width + uint(x);
        p.depth = uintBitsToFloat(texels[at]);
        if (p.depth > 0.0) {
            p.size = texels[at + plane];
            p.offset = texels[at + 2u * plane];
            p.normal = texels[at + 3u * plane];
            p.colour = texels[at + 4u * plane];
            if (frame.hasMaterials != 0u) surface = texels[at + 5u * plane];
        }
    }
    Texel t = unpackTexel(p);
    if (stepInfo.hasTubes != 0u) t = unpackAnyTexel(p);
    if (frame.hasMaterials != 0u) t.surface = unpackSurface(surface);
    return t;
}

vec3 pointColour(DrawNode node, PointRecord r) {
    if (frame.debugView == kDebugLevel) return debugLevelColour(node.level);
    if (frame.debugView == kDebugError) return debugErrorColour(node.errorPixels);
    return vec3(linearFromSrgb(float(r.colour & 255u) / 255.0), linearFromSrgb(float(r.colour >> 8 & 255u) / 255.0), linearFromSrgb(float(r.colour >> 16 & 255u) / 255.0));
}

// What a reconstructed texel shows at its pixel: tubes have normals round their axes.
Texel finished(Texel t) {
    if (t.isRound < 0.5) return t;
    const TubeSurface s = tubeSurface(t, frameLensHere());
    t.normalPerp = s.normalPerp;
    t.depth = s.depth;
    return t;
}

// Of a finished texel: the normal of the disc, as seen at its centre (a tube's: as seen at the pixel), and the depth of
// its plane at the pixel (planeDepth).
vec3 normalAt(Texel t, uvec2 pixel) {
    const vec2 at = vec2(pixel) + 0.5 - frame.centre;
    const float flat_ = 1.0 - t.isRound;
    return normalFromPerp(t.normalPerp, viewDirection(at.x + flat_ * t.offset.x, at.y + flat_ * t.offset.y, frameLensHere()));
}
float depthAt(Texel t, uvec2 pixel, float isMerged) {
    const vec2 at = vec2(pixel) + 0.5 - frame.centre;
    return planeDepth(t.depth, max(t.radius, 1.0e-3), t.normalPerp, t.offset.x, t.offset.y, t.isRound, isMerged, at.x, at.y, frameLensHere());
}

void storeTexel(uint offset, uint width, uint height, uvec2 pixel, Texel t) {
    const uint plane = width * height;
    const uint at = offset + pixel.y * width + pixel.x;
    PackedTexel p = packTexel(t);
    if (stepInfo.hasTubes != 0u) p = packAnyTexel(t);
    texels[at] = floatBitsToUint(p.depth);
    texels[at + plane] = p.size;
    texels[at + 2u * plane] = p.offset;
    texels[at + 3u * plane] = p.normal;
    texels[at + 4u * plane] = p.colour;
    if (frame.hasMaterials != 0u) texels[at + 5u * plane] = packSurface(t.surface);
}

// A level of the pyramid: where its words begin, how many texels it has each way.
struct PyramidLevel {
    uint offset, width, height;
};
// Of level `level`, from `coarse`, the next one.
Texel pushedFrom(PyramidLevel coarse, uint level, ivec2 pixel, Texel own) {
    const Lens lens = frameLensHere();
    const ivec2 parent = pixel >> 1;
    const ivec2 side = (pixel & 1) * 2 - 1;
    const float fineSize = exp2(float(level));
    const float coarseSize = 2.0 * fineSize;
    const vec2 at = (vec2(pixel) + 0.5) * fineSize - frame.centre;  // px from the principal point
    const vec2 near = (vec2(parent) + 0.5) * coarseSize - frame.centre;
    const vec2 far = near + vec2(side) * coarseSize;
    const Texel q0 = loadTexel(coarse.offset, coarse.width, coarse.height, parent.x, parent.y);
    const Texel q1 = loadTexel(coarse.offset, coarse.width, coarse.height, parent.x + side.x, parent.y);
    const Texel q2 = loadTexel(coarse.offset, coarse.width, coarse.height, parent.x, parent.y + side.y);
    const Texel q3 = loadTexel(coarse.offset, coarse.width, coarse.height, parent.x + side.x, parent.y + side.y);
    return pushTexel(own, q0, q1, q2, q3, coarseDisc(q0, near.x, near.y, lens),
                     coarseDisc(q1, far.x, near.y, lens), coarseDisc(q2, near.x, far.y, lens),
                     coarseDisc(q3, far.x, far.y, lens), float(side.x), float(side.y), at.x, at.y, fineSize,
                     lens);
}
Texel pushedTexel(ivec2 pixel, Texel own) {
    return pushedFrom(PyramidLevel(stepInfo.coarse, stepInfo.coarseWidth, stepInfo.coarseHeight), stepInfo.level, pixel, own);
}
// Of a level's texel, from the four of the next finer level, number `level`.
Texel pulledFrom(PyramidLevel fine, uint level, ivec2 pixel) {
    const ivec2 c = pixel * 2;
    return pullTexels(loadTexel(fine.offset, fine.width, fine.height, c.x, c.y),
                      loadTexel(fine.offset, fine.width, fine.height, c.x + 1, c.y),
                      loadTexel(fine.offset, fine.width, fine.height, c.x, c.y + 1),
                      loadTexel(fine.offset, fine.width, fine.height, c.x + 1, c.y + 1),
                      exp2(float(level)), frameLensHere());
}
