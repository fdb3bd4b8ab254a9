// Included once per instruction set and kind of view, with STIPPLE_KERNELS naming the table and STIPPLE_ORTHOGRAPHIC
// saying whether its views are orthographic (lens.h): what asks for that costs nothing. No header with functions of its
// own may be included here except shaders/shared, whose functions are static: the linker must not mix instruction sets.
#include <cmath>

#include "engine/cpu/kernels.h"
#include "shaders/shared/environment.h"
#include "shaders/shared/lens.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/pyramid.h"
#include "shaders/shared/shade.h"
#include "shaders/shared/splat_disc.h"
#include "shaders/shared/splat_size.h"
#include "shaders/shared/strand.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::cpu {
namespace {

using namespace stipple::shared;

constexpr bool kOrthographic = STIPPLE_ORTHOGRAPHIC;
[[gnu::always_inline]] inline Lens lensHere(float focal) { return lensOf(focal, kOrthographic); }

/// `hasTubes`: of frames that may hold tubes; others do not pay for them.
template <bool hasTubes>
[[gnu::always_inline]] inline Texel texelAt(const TexelRow& row, size_t i) {
    Texel t;
    t.depth = row.depth[i];
    t.radius = row.radius[i];
    t.thickness = row.thickness[i];
    t.offset = vec2(row.x[i], row.y[i]);
    t.normalPerp = vec2(row.perpX[i], row.perpY[i]);
    t.colour = vec3(row.red[i], row.green[i], row.blue[i]);
    t.isRound = hasTubes ? row.isRound[i] : 0.0f;
    t.axis = hasTubes ? vec2(row.axisX[i], row.axisY[i]) : vec2(0.0f, 0.0f);
    return t;
}
template <bool hasTubes>
[[gnu::always_inline]] inline void setTexel(TexelRow& row, size_t i, const Texel& t) {
    row.depth[i] = t.depth;
    row.radius[i] = t.radius;
    row.thickness[i] = t.thickness;
    row.x[i] = t.offset.x;
    row.y[i] = t.offset.y;
    row.perpX[i] = t.normalPerp.x;
    row.perpY[i] = t.normalPerp.y;
    row.red[i] = t.colour.x;
    row.green[i] = t.colour.y;
    row.blue[i] = t.colour.z;
    if (!hasTubes) return;
    row.isRound[i] = t.isRound;
    row.axisX[i] = t.axis.x;
    row.axisY[i] = t.axis.y;
}

/// `besideToo`: also those beside the picture; `wideToo`: wide discs are told apart.
template <bool besideToo, bool wideToo>
[[gnu::always_inline]] inline void projectRecords(const FrameConstants& frame, const DrawNode& drawNode,
                                                  const PointRecord* __restrict records, uint32_t count,
                                                  uint32_t* __restrict pixel, uint32_t* __restrict depth) {
    const FrameConstants f = frame;
    const DrawNode node = drawNode;
    const float width = float(f.width), height = float(f.height);
    const float focal = f.focal, nearPlane = f.nearPlane, x0 = f.centre.x, y0 = f.centre.y;
    const Lens lens = lensHere(focal);
    const float bx = node.base.x, by = node.base.y, bz = node.base.z, ax = node.axisX.x, ay = node.axisX.y,
                az = node.axisX.z, bbx = node.axisY.x, bby = node.axisY.y, bbz = node.axisY.z, ccx = node.axisZ.x,
                ccy = node.axisZ.y, ccz = node.axisZ.z;
    const uint* __restrict const words = &records->positionXY;  // four words a record
    const float edge = node.edge * f.supportScale, minimum = f.minimumRadius;
    const float mostScattered = largestSplat(kFlagScattered, focal, f.height), most = largestSplat(0u, focal, f.height);
    const float wideShare = wideRadius(f.width, f.height) / focal;
    const uint stride = f.width, errorCode = node.errorCode, octantMask = node.octantMask;
    const NormalAxes m = normalAxes(node);
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const PointRecord r{words[4 * i], words[4 * i + 1], words[4 * i + 2], words[4 * i + 3]};
        const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
        const float cx = bx + ax * qx + bbx * qy + ccx * qz;
        const float cy = by + ay * qx + bby * qy + ccy * qz;
        const float cz = bz + az * qx + bbz * qy + ccz * qz;
        const float scale = focal / lensDepth(lens, cz);
        const float px = cx * scale + x0, py = cy * scale + y0;
        bool inside = (cz > nearPlane) & (px >= 0.0f) & (px < width) & (py >= 0.0f) & (py < height);
        float atX = px, atY = py, key = cz;
        if (besideToo) {
            const float cap = (recordFlags(r) & kFlagScattered) != 0u ? mostScattered : most;
            const float radius =
                max(min(edge * radiusFractionFast(recordRadiusCode(r)), lensDepth(lens, cz) * cap) * scale, minimum);
            const vec3 sight = sightTo(lens, vec3(cx, cy, cz));
            const SplatPixel s = splatPixel(px, py, sight.x, sight.y, sight.z, radius, width, height);
            inside = (cz > nearPlane) & (s.x >= 0);
            atX = float(s.x);
            atY = float(s.y);
            key = cz + s.farther * radius / scale;
        }
        const float drawnHere = float(int(octantMask >> recordOctant(r) & 1u));  // a bool would keep GCC from SIMD
        const bool fine = (recordErrorCode(r) <= errorCode) | (drawnHere > 0.5f);
        const vec3 n = octDirection(r.normal);
        const float nx = m.x.x * n.x + m.y.x * n.y + m.z.x * n.z;  // any length will do
        const float ny = m.x.y * n.x + m.y.y * n.y + m.z.y * n.z;
        const float nz = m.x.z * n.x + m.y.z * n.y + m.z.z * n.z;
        const float facing = kOrthographic ? nz : nx * cx + ny * cy + nz * cz;
        const bool seen = ((recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) != 0u) | (facing < 0.0f);
        const bool keep = inside & fine & seen;
        const int ix = int(keep ? atX : 0.0f), iy = int(keep ? atY : 0.0f);
        pixel[i] = keep ? uint(iy) * stride + uint(ix) : ~0u;
        if (wideToo) {
            const float wide = isWideDisc(recordFlags(r), cz, edge * radiusFractionFast(recordRadiusCode(r)), wideShare,
                                          nearPlane, lens);
            pixel[i] = wide > 0.5f ? (fine & seen ? kWidePixel : ~0u) : pixel[i];
        }
        depth[i] = floatBitsToUint(key);
    }
}

void projectBlock(const FrameConstants& f, const DrawNode& node, const PointRecord* records, uint32_t count,
                  bool besideToo, uint32_t* pixel, uint32_t* depth) {
    if ((node.octantMask & kNodeWide) != 0u && besideToo)
        projectRecords<true, true>(f, node, records, count, pixel, depth);
    else if (besideToo)
        projectRecords<true, false>(f, node, records, count, pixel, depth);
    else
        projectRecords<false, false>(f, node, records, count, pixel, depth);
}

#include "engine/cpu/sample.inl"

#include "engine/cpu/raster.inl"

struct Gathered {
    alignas(64) float x[kTile], y[kTile], z[kTile], radius[kTile];
    alignas(64) uint32_t normal[kTile], colour[kTile], flags[kTile];
    // Of turned instances: normals in camera space.
    alignas(64) float turned[kTile], nx[kTile], ny[kTile], nz[kTile];
    alignas(64) float front[kTile];  // depth by which each was the nearest
};

/// Camera-space normals of the points that were gathered, any side. `anyTurned`: of instances that are not turned the
/// frame's own rotation is all that normals need.
template <bool anyTurned>
[[gnu::always_inline]] inline vec3 gatheredNormal(const FrameConstants& f, const Gathered& g, size_t i, vec3 c) {
    const vec3 d = octDecode(g.normal[i]);
    const bool hasNormal = (g.flags[i] & kFlagNoNormal) == 0u;
    vec3 n =
        vec3(f.viewX.x * d.x + f.viewX.y * d.y + f.viewX.z * d.z, f.viewY.x * d.x + f.viewY.y * d.y + f.viewY.z * d.z,
             f.viewZ.x * d.x + f.viewZ.y * d.y + f.viewZ.z * d.z);
    if (anyTurned) {
        const bool isTurned = g.turned[i] > 0.5f;
        n.x = isTurned ? g.nx[i] : n.x;
        n.y = isTurned ? g.ny[i] : n.y;
        n.z = isTurned ? g.nz[i] : n.z;
    }
    const vec3 sight = sightTo(lensHere(f.focal), c);
    const float inverse = 1.0f / std::sqrt(sight.x * sight.x + sight.y * sight.y + sight.z * sight.z);
    n.x = hasNormal ? n.x : -sight.x * inverse;
    n.y = hasNormal ? n.y : -sight.y * inverse;
    n.z = hasNormal ? n.z : -sight.z * inverse;
    return n;
}

#include "engine/cpu/resolve_triangles.inl"

#include "engine/cpu/discs.inl"

#include "engine/cpu/strands.inl"

#include "engine/cpu/splat.inl"

/// Texels of the points that were gathered.
template <bool anyTurned>
[[gnu::always_inline]] inline void resolveSplats(const FrameConstants& f, const Gathered& g, uint32_t x0, uint32_t y,
                                                 uint32_t n, TexelRow& __restrict row) {
    const float focal = f.focal, support = f.supportScale, minimum = f.minimumRadius;
    const Lens lens = lensHere(focal);
    const float mostScattered = largestSplat(kFlagScattered, focal, f.height), most = largestSplat(0u, focal, f.height);
    const float centreX = f.centre.x - float(int(x0)) - 0.5f, centreY = f.centre.y - float(int(y)) - 0.5f;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const bool valid = g.z[i] > 0.0f;
        const vec3 c = vec3(valid ? g.x[i] : 0.0f, valid ? g.y[i] : 0.0f, valid ? g.z[i] : 1.0f);
        const vec3 nc = gatheredNormal<anyTurned>(f, g, i, c);
        const float cap = (g.flags[i] & kFlagScattered) != 0u ? mostScattered : most;
        Texel t = texelFromSplat(c, nc, min(g.radius[i] * support, lensDepth(lens, c.z) * cap), lens, minimum);
        const float scale = focal / lensDepth(lens, c.z);
        // Nearly the pixel's own coordinate is taken off before adding, so that the offset keeps its low bits.
        t.offset = vec2(c.x * scale + centreX - float(int(i)), c.y * scale + centreY);
        t.depth = valid ? t.depth : 0.0f;
        t.radius = valid ? t.radius : 0.0f;
        t.thickness = (g.flags[i] & kFlagLoose) != 0u ? kLeafThickness * t.radius : t.thickness;
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel<false>(row, kPad + i, t);
    }
}

/// The same where every pixel that a disc covers is its own: no splats, but what the pixels show.
template <bool anyTurned>
[[gnu::always_inline]] inline void resolveExact(const FrameConstants& f, const Gathered& g, uint32_t x0, uint32_t y,
                                                uint32_t n, TexelRow& __restrict row) {
    const float focal = f.focal, x = float(int(x0)) + 0.5f - f.centre.x, py = float(int(y)) + 0.5f - f.centre.y;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const bool valid = g.front[i] > 0.0f;
        const vec3 c = vec3(valid ? g.x[i] : 0.0f, valid ? g.y[i] : 0.0f, valid ? g.z[i] : 1.0f);
        const vec3 nc = gatheredNormal<anyTurned>(f, g, i, c);
        const vec3 v = viewDirection(x + float(int(i)), py, lensHere(focal));
        const float flip = dot(nc, v) > 0.0f ? -1.0f : 1.0f;
        const vec2 perp = perpFromNormal(nc, v);
        Texel t;
        t.depth = valid ? g.front[i] : 0.0f;
        t.radius = valid ? kExactRadius : 0.0f;
        t.thickness = (g.flags[i] & kFlagLoose) != 0u ? kLeafThickness * t.radius : t.radius;
        t.offset = vec2(0.0f, 0.0f);
        t.normalPerp = vec2(perp.x * flip, perp.y * flip);
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel<false>(row, kPad + i, t);
    }
}

template <bool anyTurned>
void resolvePoints(const FrameConstants& f, const ResolveInput& in, const Gathered& g, uint32_t x0, uint32_t y,
                   uint32_t n, TexelRow& row) {
    if (in.exactPoints)
        resolveExact<anyTurned>(f, g, x0, y, n, row);
    else
        resolveSplats<anyTurned>(f, g, x0, y, n, row);
}

bool resolveRow(const FrameConstants& frame, const Tables& tables, const ResolveInput& in, uint64_t* visibility,
                uint32_t x0, uint32_t y, uint32_t n, TexelRow& __restrict row, float& largestRadius,
                const SurfacePlanes& planes) {
    const BlockSource* const blocks = in.blocks;
    uint32_t* const surface = planes.surface;
    const FrameConstants f = frame;
    const BlockRanges firstBlock = f.firstBlock;
    constexpr size_t kPrefetch = 12;  // pixels ahead: records lie anywhere in memory
    Gathered g;
    WinningPixels triangles, strands, discs;
    triangles.count = strands.count = discs.count = 0;
    bool any = false, anyTurned = false;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        if (i + kPrefetch < n && isPointKey(visibility[i + kPrefetch], firstBlock)) {
            const uint64_t ahead = visibility[i + kPrefetch];
            __builtin_prefetch(blocks[keyBlock(ahead)].records + keyLane(ahead));
        }
        const uint64_t key = visibility[i];
        if (!isPointKey(key, firstBlock)) {
            if (key != kNoKey) {
                const uint32_t kind = keyKind(key, firstBlock);
                const bool isTriangle = kind == kKindTriangles, isCurve = kind == kKindCurves;
                WinningPixels& to = isTriangle ? triangles : isCurve ? strands : discs;
                to.pixel[to.count] = static_cast<uint32_t>(i);
                to.id[to.count] = keyPlace(key, isTriangle ? firstBlock.triangles
                                                : isCurve  ? firstBlock.curves
                                                           : firstBlock.discs);
                to.depth[to.count++] = keyDepth(key);
                visibility[i] = kNoKey;
            }
            g.x[i] = 0;
            g.y[i] = 0;
            g.z[i] = -1;
            g.front[i] = 0;
            g.radius[i] = 0;
            g.normal[i] = 0;
            g.colour[i] = 0;
            g.flags[i] = kFlagNoNormal;
            g.turned[i] = 0;
            continue;
        }
        any = true;
        visibility[i] = kNoKey;
        const BlockSource& block = blocks[keyBlock(key)];
        const PointRecord r = block.records[keyLane(key)];
        const DrawNode& node = *block.node;
        const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
        g.x[i] = node.base.x + node.axisX.x * qx + node.axisY.x * qy + node.axisZ.x * qz;
        g.y[i] = node.base.y + node.axisX.y * qx + node.axisY.y * qy + node.axisZ.y * qz;
        g.z[i] = node.base.z + node.axisX.z * qx + node.axisY.z * qy + node.axisZ.z * qz;
        g.radius[i] = node.edge * tables.radiusFraction[recordRadiusCode(r)];
        g.normal[i] = r.normal;
        g.flags[i] = recordFlags(r);
        g.front[i] = keyDepth(key);
        g.turned[i] = 0;
        if ((node.octantMask & kNodeTurned) != 0) {
            anyTurned = true;
            const vec3 d = nodeUnitNormal(node, octDecode(r.normal));
            g.turned[i] = 1;
            g.nx[i] = d.x;
            g.ny[i] = d.y;
            g.nz[i] = d.z;
        }
        uint32_t c = r.colour;
        if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
            const vec3 d =
                f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
            g.colour[i] = packColour(d.x, d.y, d.z);
            continue;
        }
        g.colour[i] = tables.red[c & 255u] | tables.green[c >> 8 & 255u] | tables.blue[c >> 16 & 255u];
    }
    if (surface != nullptr)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) surface[i] = 0;
    if (!any) {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) row.depth[kPad + i] = 0;
        if (row.hasTubes)
#pragma GCC ivdep
            for (size_t i = 0; i < n; ++i) row.isRound[kPad + i] = row.axisX[kPad + i] = 0;
        if (discs.count > 0) resolveDiscs(f, tables, in, discs, x0, y, row);
        if (triangles.count > 0) resolveTriangles(f, in, triangles, x0, y, row, planes);
        row.hasTubes = strands.count > 0 && resolveStrands(f, in, strands, x0, y, row, largestRadius);
        return triangles.count + strands.count + discs.count > 0;
    }
    if (anyTurned)
        resolvePoints<true>(f, in, g, x0, y, n, row);
    else
        resolvePoints<false>(f, in, g, x0, y, n, row);
    uint largest = 0;  // as bits: positive floats sort like integers
    for (size_t i = 0; i < n; ++i) {
        const uint bits = floatBitsToUint(row.radius[kPad + i]);
        largest = bits > largest ? bits : largest;
    }
    largestRadius = max(largestRadius, uintBitsToFloat(largest));
    if (row.hasTubes)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) row.isRound[kPad + i] = row.axisX[kPad + i] = 0;
    if (discs.count > 0) resolveDiscs(f, tables, in, discs, x0, y, row);
    if (triangles.count > 0) resolveTriangles(f, in, triangles, x0, y, row, planes);
    row.hasTubes = strands.count > 0 && resolveStrands(f, in, strands, x0, y, row, largestRadius);
    return true;
}

template <bool hasTubes>
[[gnu::always_inline]] inline void packTexels(const TexelRow& __restrict row, uint32_t n, const Planes& planes) {
    float* __restrict const depth = planes.depth;
    uint32_t *__restrict const size = planes.size, *__restrict const offset = planes.offset, *__restrict const normal = planes.normal,
             *__restrict const colour = planes.colour;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const Texel t = texelAt<hasTubes>(row, kPad + i);
        const PackedTexel p = hasTubes ? packAnyTexel(t) : packTexel(t);
        depth[i] = p.depth;
        size[i] = p.size;
        offset[i] = p.offset;
        normal[i] = p.normal;
        colour[i] = p.colour;
    }
}
void packRow(const TexelRow& row, uint32_t n, const Planes& planes) {
    if (row.hasTubes)
        packTexels<true>(row, n, planes);
    else
        packTexels<false>(row, n, planes);
}

template <bool hasTubes>
[[gnu::always_inline]] inline void unpackTexels(const Planes& planes, uint32_t first, uint32_t n,
                                                TexelRow& __restrict row) {
    const float* __restrict const depth = planes.depth;
    const uint32_t *__restrict const size = planes.size, *__restrict const offset = planes.offset,
                   *__restrict const normal = planes.normal, *__restrict const colour = planes.colour;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        PackedTexel p;
        p.depth = depth[i];
        p.size = size[i];
        p.offset = offset[i];
        p.normal = normal[i];
        p.colour = colour[i];
        setTexel<hasTubes>(row, first + i, hasTubes ? unpackAnyTexel(p) : unpackTexel(p));
    }
}
void unpackRow(const Planes& planes, uint32_t first, uint32_t n, TexelRow& row) {
    if (row.hasTubes)
        unpackTexels<true>(planes, first, n, row);
    else
        unpackTexels<false>(planes, first, n, row);
}

template <bool hasTubes>
[[gnu::always_inline]] inline void pullTexelRow(const TexelRow& __restrict upper, const TexelRow& __restrict lower,
                                                uint32_t n, float childSize, float focal, TexelRow& __restrict out) {
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const size_t a = kPad + 2 * i, b = a + 1;
        setTexel<hasTubes>(out, kPad + i,
                           pullTexels(texelAt<hasTubes>(upper, a), texelAt<hasTubes>(upper, b),
                                      texelAt<hasTubes>(lower, a), texelAt<hasTubes>(lower, b), childSize, lens));
    }
}
void pullRow(const TexelRow& upper, const TexelRow& lower, uint32_t n, float childSize, float focal, TexelRow& out) {
    if (out.hasTubes)
        pullTexelRow<true>(upper, lower, n, childSize, focal, out);
    else
        pullTexelRow<false>(upper, lower, n, childSize, focal, out);
}

void expandRow(TexelRow& __restrict coarse, uint32_t n, float x, float y, float size, float focal, TexelRow& nearest,
               TexelRow& beside) {
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t i = 0; i < (n + 1) / 2 + 2; ++i) {
        const size_t at = kPad - 1 + i;
        Texel t;
        t.depth = coarse.depth[at];
        t.radius = coarse.radius[at];
        t.offset = vec2(coarse.x[at], coarse.y[at]);
        t.normalPerp = vec2(coarse.perpX[at], coarse.perpY[at]);
        t.isRound = coarse.hasTubes ? coarse.isRound[at] : 0.0f;
        const CoarseDisc d = coarseDisc(t, x + (float(int(i)) - 1.0f) * size, y, lens);
        coarse.slopeX[at] = d.slope.x;
        coarse.slopeY[at] = d.slope.y;
        coarse.inverseDepth[at] = d.inverseDepth;
    }
    const auto expand = [n](const float* __restrict from, float* __restrict to, float* __restrict side) {
        from += kPad;
        to += kPad;
        side += kPad;
#pragma GCC ivdep
        for (size_t i = 0; i < (n + 1) / 2; ++i) {
            to[2 * i] = from[i];
            to[2 * i + 1] = from[i];
        }
#pragma GCC ivdep
        for (size_t i = 0; i < (n + 1) / 2; ++i) {
            side[2 * i] = (from - 1)[i];
            side[2 * i + 1] = (from + 1)[i];
        }
    };
    expand(coarse.depth, nearest.depth, beside.depth);
    expand(coarse.radius, nearest.radius, beside.radius);
    expand(coarse.thickness, nearest.thickness, beside.thickness);
    expand(coarse.x, nearest.x, beside.x);
    expand(coarse.y, nearest.y, beside.y);
    expand(coarse.perpX, nearest.perpX, beside.perpX);
    expand(coarse.perpY, nearest.perpY, beside.perpY);
    expand(coarse.red, nearest.red, beside.red);
    expand(coarse.green, nearest.green, beside.green);
    expand(coarse.blue, nearest.blue, beside.blue);
    expand(coarse.slopeX, nearest.slopeX, beside.slopeX);
    expand(coarse.slopeY, nearest.slopeY, beside.slopeY);
    expand(coarse.inverseDepth, nearest.inverseDepth, beside.inverseDepth);
    if (!coarse.hasTubes) return;
    expand(coarse.isRound, nearest.isRound, beside.isRound);
    expand(coarse.axisX, nearest.axisX, beside.axisX);
    expand(coarse.axisY, nearest.axisY, beside.axisY);
}

[[gnu::always_inline]] inline CoarseDisc discAt(const TexelRow& row, size_t i) {
    CoarseDisc d;
    d.slope = vec2(row.slopeX[i], row.slopeY[i]);
    d.inverseDepth = row.inverseDepth[i];
    return d;
}

template <bool hasTubes>
[[gnu::always_inline]] inline void pushTexelRow(const TexelRow& __restrict fine, const ExpandedRow& __restrict nearRow,
                                                const ExpandedRow& __restrict farRow, float sy, float x, float y,
                                                uint32_t n, float fineSize, float focal, TexelRow& __restrict out) {
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + i;
        const float sx = float(int(i & 1u) * 2 - 1);
        setTexel<hasTubes>(out, at,
                           pushTexel(texelAt<hasTubes>(fine, at), texelAt<hasTubes>(nearRow.nearest, at),
                                     texelAt<hasTubes>(nearRow.beside, at), texelAt<hasTubes>(farRow.nearest, at),
                                     texelAt<hasTubes>(farRow.beside, at), discAt(nearRow.nearest, at),
                                     discAt(nearRow.beside, at), discAt(farRow.nearest, at), discAt(farRow.beside, at),
                                     sx, sy, x + float(int(i)) * fineSize, y, fineSize, lens));
    }
}
void pushRow(const TexelRow& fine, const ExpandedRow& nearRow, const ExpandedRow& farRow, float sy, float x, float y,
             uint32_t n, float fineSize, float focal, TexelRow& out) {
    if (out.hasTubes)
        pushTexelRow<true>(fine, nearRow, farRow, sy, x, y, n, fineSize, focal, out);
    else
        pushTexelRow<false>(fine, nearRow, farRow, sy, x, y, n, fineSize, focal, out);
}

/// What tubes look like at each pixel: normals round their axes.
void finishRow(float focal, uint32_t n, TexelRow& __restrict row) {
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + i;
        const Texel t = texelAt<true>(row, at);
        const TubeSurface s = tubeSurface(t, lens);
        const bool isTubeHere = t.isRound > 0.5f;
        row.perpX[at] = isTubeHere ? s.normalPerp.x : t.normalPerp.x;
        row.perpY[at] = isTubeHere ? s.normalPerp.y : t.normalPerp.y;
        row.depth[at] = isTubeHere ? s.depth : t.depth;
    }
}

#include "engine/cpu/light.inl"

#include "engine/cpu/surface.inl"

}  // namespace

extern const Kernels STIPPLE_KERNELS, STIPPLE_KERNELS_ORTHOGRAPHIC;
const Kernels STIPPLE_KERNELS{STIPPLE_KERNELS_NAME,
                              &STIPPLE_KERNELS_ORTHOGRAPHIC,
                              projectBlock,
                              resolveRow,
                              packRow,
                              unpackRow,
                              pullRow,
                              pushRow,
                              expandRow,
                              finishRow,
                              surfaceRow,
                              lightRow,
                              outputRow,
                              rasterCluster,
                              rasterLarge,
                              drawSegments,
                              fillWide,
                              fillDiscs,
                              placeSplats,
                              splatTile};

}  // namespace stipple::cpu
