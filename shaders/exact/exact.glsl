// The pyramid of discs. It borrows the buffer of texels, which resolve fills afterwards: a level's plane 0 holds the
// least depth of each texel's discs, plane 1 the least id of those of that depth, and the first word of plane 2 is not
// ~0 once the level has a disc.
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
#include "../shared/disc_level.h"

struct LevelPlane {
    uint offset;  // words
    int columns;
    int rows;
};
LevelPlane levelPlane(int level) {
    LevelPlane p;
    p.offset = 0u;
    for (int l = 0; l < level; ++l) p.offset += kTexelWords * uint(levelTexels(frame.width, l) * levelTexels(frame.height, l));
    p.columns = levelTexels(frame.width, level);
    p.rows = levelTexels(frame.height, level);
    return p;
}
// As many as the buffer of texels has: down to one texel.
int levelsHere() {
    int levels = 1;
    while (levelTexels(frame.width, levels - 1) > 1 || levelTexels(frame.height, levels - 1) > 1) ++levels;
    return levels;
}
uint plane(LevelPlane p, uint which) { return p.offset + which * uint(p.columns * p.rows); }

WideDisc discOf(uint id, out DrawNode node, out PointRecord r) {
    const DrawBlock source = blocks[id / kRecordsPerBlock];
    node = nodes[source.node];
    r = Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + id % kRecordsPerBlock];
    return splatDisc(node, r, frame.supportScale, largestSplat(kFlagScattered, frame.focal, frame.height), id, frameLensHere());
}

// Is it this thread's to draw a disc, and which?
bool discHere(out WideDisc d) {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= frame.firstBlock.of[kKindCurves]) return false;
    const DrawBlock source = blocks[block];
    if (source.first + gl_LocalInvocationID.x >= nodes[source.node].count) return false;
    DrawNode node;
    PointRecord r;
    d = discOf(block * kRecordsPerBlock + gl_LocalInvocationID.x, node, r);
    return isSplatSeen(node, r, d, frame.nearPlane, frameLensHere()) * reachesPicture(d, frame) > 0.5;
}

// The place of a disc's words, where there is one.
bool texelOf(WideDisc d, out LevelPlane at, out uint texel) {
    const LevelPlace p = levelPlace(d, frame);
    if (p.level < 0 || p.level >= levelsHere()) return false;
    at = levelPlane(p.level);
    texel = uint(p.y * at.columns + p.x);
    return true;
}

// Depth of a disc at a pixel; the pixel of its centre shows a small one, and one that stands alone. kNoDisc where it is not seen.
float depthAtPixel(WideDisc d, ivec2 pixel) {
    const vec2 ray = (vec2(pixel) + 0.5 - frame.centre) / frame.focal;
    const PixelRay through = pixelRay(frameLensHere(), ray.x, ray.y);
    const float depth = discHit(d, through, frame.nearPlane).depth;
    const CentrePixel c = ownPixel(d, standsAlone(d.id), frame);
    const bool isCentre = c.x == pixel.x && c.y == pixel.y;
    return depth >= kNoDisc && isCentre ? ownDepth(d, through, frame) : depth;
}
