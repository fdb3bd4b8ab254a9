// Included once per instruction set and kind of view, with STIPPLE_KERNELS naming the table and STIPPLE_ORTHOGRAPHIC
// saying whether its views are orthographic (lens.h): what asks for that costs nothing. No header with functions of its
// own may be included here except shaders/shared, whose functions are static, and intrinsics, which are always inlined:
// the linker must not mix instruction sets.
#include <cmath>
#if defined(__SSE4_1__)
#include <immintrin.h>
#endif

#include "engine/cpu/kernels.h"
#include "shaders/shared/curve.h"
#include "shaders/shared/environment.h"
#include "shaders/shared/lens.h"
#include "shaders/shared/occlusion.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/patch_map.h"
#include "shaders/shared/pyramid.h"
#include "shaders/shared/reflection.h"
#include "shaders/shared/shade.h"
#define SHARED_SHADOW [[maybe_unused]] const float *shadowDepths, [[maybe_unused]] const uint *shadowThrough,
#define SHARED_SHADOW_USE shadowDepths, shadowThrough,
#include "shaders/shared/shadow_taps.h"
#include "shaders/shared/splat_disc.h"
#include "shaders/shared/splat_size.h"
#include "shaders/shared/surface.h"
#include "shaders/shared/surfel_weight.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::cpu {
namespace {

using namespace stipple::shared;

constexpr bool kOrthographic = STIPPLE_ORTHOGRAPHIC;
[[gnu::always_inline]] inline Lens lensHere(float focal) { return lensOf(focal, kOrthographic); }

/// `hasTubes`: of frames that may hold tubes, `hasMaterials`: of those with materials of points; others do not pay for
/// them.
template <bool hasTubes, bool hasMaterials>
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
    t.surface = noSurface();
    if (hasMaterials) {
        t.surface.share = row.share[i];
        t.surface.metallic = row.metallic[i];
        t.surface.roughness = row.roughness[i];
    }
    return t;
}
template <bool hasTubes, bool hasMaterials>
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
    if (hasMaterials) {
        row.share[i] = t.surface.share;
        row.metallic[i] = t.surface.metallic;
        row.roughness[i] = t.surface.roughness;
    }
    if (!hasTubes) return;
    row.isRound[i] = t.isRound;
    row.axisX[i] = t.axis.x;
    row.axisY[i] = t.axis.y;
}

/// `besideToo`: also those beside the picture; `wideToo`: wide discs are told apart.
template <bool besideToo, bool wideToo>
[[gnu::always_inline]] inline void projectRecords(const FrameConstants& frame, const DrawNode& drawNode,
                                                  const PointRecord* __restrict records, uint32_t count,
                                                  ProjectedBlock& __restrict to) {
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
    uint32_t *__restrict const pixels = to.pixel, *__restrict const depths = to.depth;
    alignas(64) int places[kRecordsPerBlock];
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
            inside = (cz > nearPlane) & (s.share < 1.0f);  // (as s.x >= 0, of which GCC makes a choice between bools)
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
        places[i] = keep ? iy << 16 | ix : -1;  // (pictures have at most 16384 px each way)
        uint32_t pixel = keep ? uint(iy) * stride + uint(ix) : ~0u;
        if (wideToo) {
            const float wide = isWideDisc(recordFlags(r), cz, edge * radiusFractionFast(recordRadiusCode(r)), wideShare,
                                          nearPlane, lens);
            pixel = wide > 0.5f ? (fine & seen ? kWidePixel : ~0u) : pixel;
        }
        pixels[i] = pixel;
        depths[i] = floatBitsToUint(key);
    }
    int firstX = 0xffff, lastX = -1, firstY = 0xffff, lastY = -1;
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const int x = places[i] & 0xffff, y = (places[i] >> 16) & 0xffff;
        const int mostX = places[i] < 0 ? -1 : x, mostY = places[i] < 0 ? -1 : y;
        firstX = x < firstX ? x : firstX;
        lastX = mostX > lastX ? mostX : lastX;
        firstY = y < firstY ? y : firstY;
        lastY = mostY > lastY ? mostY : lastY;
    }
    to.firstX = firstX;
    to.lastX = lastX;
    to.firstY = firstY;
    to.lastY = lastY;
}

void projectBlock(const FrameConstants& f, const DrawNode& node, const PointRecord* records, uint32_t count,
                  bool besideToo, ProjectedBlock& to) {
    if ((node.octantMask & kNodeWide) != 0u && besideToo)
        projectRecords<true, true>(f, node, records, count, to);
    else if (besideToo)
        projectRecords<true, false>(f, node, records, count, to);
    else
        projectRecords<false, false>(f, node, records, count, to);
}

#include "engine/cpu/masks.inl"
#include "engine/cpu/sample.inl"

#include "engine/cpu/raster.inl"

#include "engine/cpu/small_triangles.inl"

#include "engine/cpu/runs.inl"
#include "engine/cpu/resolve_triangles.inl"

#include "engine/cpu/patches.inl"

#include "engine/cpu/patch_splats.inl"

#include "engine/cpu/patch_maps.inl"
#include "engine/cpu/resolve_patches.inl"

#include "engine/cpu/discs.inl"

#include "engine/cpu/curves.inl"
#include "engine/cpu/resolve_curves.inl"

#include "engine/cpu/place_discs.inl"

#include "engine/cpu/disc_batch.inl"

#include "engine/cpu/splat.inl"

#include "engine/cpu/ewa.inl"

#include "engine/cpu/resolve_points.inl"

/// Calls use<hasTubes, hasMaterials>().
template <typename Use>
[[gnu::always_inline]] inline void forRow(bool hasTubes, bool hasMaterials, const Use& use) {
    if (hasTubes && hasMaterials)
        use.template operator()<true, true>();
    else if (hasMaterials)
        use.template operator()<false, true>();
    else if (hasTubes)
        use.template operator()<true, false>();
    else
        use.template operator()<false, false>();
}

template <bool hasTubes, bool hasMaterials>
[[gnu::always_inline]] inline void packTexels(const TexelRow& __restrict row, size_t first, size_t last,
                                              const Planes& planes) {
    float* __restrict const depth = planes.depth;
    uint32_t *__restrict const size = planes.size, *__restrict const offset = planes.offset,
             *__restrict const normal = planes.normal, *__restrict const colour = planes.colour,
             *__restrict const surface = planes.surface;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const Texel t = texelAt<hasTubes, hasMaterials>(row, kPad + i);
        if (hasMaterials) surface[i] = packSurface(t.surface);
        const PackedTexel p = hasTubes ? packAnyTexel(t) : packTexel(t);
        depth[i] = p.depth;
        size[i] = p.size;
        offset[i] = p.offset;
        normal[i] = p.normal;
        colour[i] = p.colour;
    }
}
uint32_t packRow(const TexelRow& row, uint32_t n, const Planes& planes) {
    const uint32_t held = groupsHeld(n, row.depth + kPad);
    forRow(row.hasTubes, row.hasMaterials, [&]<bool hasTubes, bool hasMaterials>() {
        forGroups(held, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
            packTexels<hasTubes, hasMaterials>(row, first, last, planes);
        });
    });
    return held;
}

template <bool hasTubes, bool hasMaterials, bool hasNormals>
[[gnu::always_inline]] inline void unpackTexels(const Planes& planes, uint32_t to, size_t first, size_t last,
                                                TexelRow& __restrict row) {
    const float* __restrict const depth = planes.depth;
    const uint32_t *__restrict const size = planes.size, *__restrict const offset = planes.offset,
                   *__restrict const normal = planes.normal, *__restrict const colour = planes.colour,
                   *__restrict const surface = planes.surface;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        PackedTexel p;
        p.depth = depth[i];
        p.size = size[i];
        p.offset = offset[i];
        p.normal = hasNormals ? normal[i] : 0u;
        p.colour = colour[i];
        Texel t = hasTubes ? unpackAnyTexel(p) : unpackTexel(p);
        if (hasMaterials) t.surface = unpackSurface(surface[i]);
        setTexel<hasTubes, hasMaterials>(row, to + i, t);
    }
}
void unpackRow(const Planes& planes, uint32_t to, uint32_t n, uint32_t held, bool hasNormals, TexelRow& row) {
    const uint32_t all = ~0u >> (32u - (n + kTexelGroup - 1u) / kTexelGroup);
    if ((held & all) != all)
        for (size_t i = 0; i < n; ++i) row.depth[to + i] = 0.0f;
    const bool isPlain = !hasNormals && !row.hasTubes && !row.hasMaterials;
    if (isPlain)
        forGroups(held & all, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
            unpackTexels<false, false, false>(planes, to, first, last, row);
        });
    else
        forRow(row.hasTubes, row.hasMaterials, [&]<bool hasTubes, bool hasMaterials>() {
            forGroups(held & all, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
                unpackTexels<hasTubes, hasMaterials, true>(planes, to, first, last, row);
            });
        });
}

void openUpPacked(const Planes& from, const RowBits& of, bool hasNormals, const Planes& to) {
    const auto words = [](float* depth) { return reinterpret_cast<uint32_t*>(depth); };
    size_t before = 0;
    for (uint32_t group = 0; group < kTile / kTexelGroup; ++group) {
        const uint32_t bits = of.group(group);
        if (bits == 0u) continue;
        const OpenGroup open = openGroup(bits);
        const size_t at = size_t{group} * kTexelGroup;
        openUp(open, words(from.depth) + before, words(to.depth) + at);
        openUp(open, from.size + before, to.size + at);
        openUp(open, from.offset + before, to.offset + at);
        if (hasNormals) openUp(open, from.normal + before, to.normal + at);
        openUp(open, from.colour + before, to.colour + at);
        if (from.surface != nullptr) openUp(open, from.surface + before, to.surface + at);
        before += size_t(__builtin_popcount(bits));
    }
}

template <bool hasTubes, bool hasMaterials>
[[gnu::always_inline]] inline void pullTexelRow(const TexelRow& __restrict upper, const TexelRow& __restrict lower,
                                                size_t first, size_t last, float childSize, float focal,
                                                TexelRow& __restrict out) {
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const size_t a = kPad + 2 * i, b = a + 1;
        const auto at = [](const TexelRow& row, size_t k) { return texelAt<hasTubes, hasMaterials>(row, k); };
        setTexel<hasTubes, hasMaterials>(
            out, kPad + i, pullTexels(at(upper, a), at(upper, b), at(lower, a), at(lower, b), childSize, lens));
    }
}
void pullRow(const TexelRow& upper, const TexelRow& lower, uint32_t n, float childSize, float focal, TexelRow& out) {
    static_assert(2 * kTile / kTexelGroup < 32);
    uint32_t held = groupsHeld(2 * n, upper.depth + kPad, lower.depth + kPad);
    held |= held >> 1;  // two groups become one
    uint32_t made = 0;
    for (uint32_t group = 0; group * kTexelGroup < n; ++group) made |= (held >> 2 * group & 1u) << group;
    for (size_t i = 0; i < n; ++i) out.depth[kPad + i] = 0.0f;
    forRow(out.hasTubes, out.hasMaterials, [&]<bool hasTubes, bool hasMaterials>() {
        forGroups(made, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
            pullTexelRow<hasTubes, hasMaterials>(upper, lower, first, last, childSize, focal, out);
        });
    });
}

#include "engine/cpu/push.inl"

/// What tubes look like at each pixel: normals round their axes.
void finishRow(float focal, uint32_t n, TexelRow& __restrict row) {
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + i;
        const Texel t = texelAt<true, false>(row, at);
        const TubeSurface s = tubeSurface(t, lens);
        const bool isTubeHere = (t.isRound > 0.5f) & (t.depth > 0.0f);  // nobody wrote the rest of an empty one
        row.perpX[at] = isTubeHere ? s.normalPerp.x : t.normalPerp.x;
        row.perpY[at] = isTubeHere ? s.normalPerp.y : t.normalPerp.y;
        row.depth[at] = isTubeHere ? s.depth : t.depth;
    }
}

#include "engine/cpu/shadow.inl"

#include "engine/cpu/light.inl"

#include "engine/cpu/surface.inl"

#include "engine/cpu/effects.inl"

#include "engine/cpu/occlusion.inl"

#include "engine/cpu/reflection.inl"

#include "engine/cpu/farthest.inl"

}  // namespace

extern const Kernels STIPPLE_KERNELS, STIPPLE_KERNELS_ORTHOGRAPHIC;
const Kernels STIPPLE_KERNELS{STIPPLE_KERNELS_NAME,
                              &STIPPLE_KERNELS_ORTHOGRAPHIC,
                              projectBlock,
                              findClaims,
                              resolveRow,
                              showPoints,
                              packRow,
                              unpackRow,
                              openUpPacked,
                              pullRow,
                              pushRow,
                              coarseDiscs,
                              finishRow,
                              surfaceRow,
                              smoothRow,
                              shadowRow,
                              lightRow,
                              outputRow,
                              keepRow,
                              takeRow,
                              edlLogs,
                              edlRow,
                              fogRow,
                              toneRow,
                              backgroundRow,
                              rasterCluster,
                              rasterLarge,
                              rasterPatch,
                              splatPatch,
                              splatLarge,
                              drawSegments,
                              fillWide,
                              fillDiscs,
                              placeSplats,
                              splatTile,
                              filterTile,
                              isAtJump,
                              openRow,
                              occludeRow,
                              aoMeanRow,
                              aoSpreadRow,
                              reflectRow,
                              farthestOf};

}  // namespace stipple::cpu
