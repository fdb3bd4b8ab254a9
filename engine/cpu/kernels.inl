// Included once per instruction set, with STIPPLE_KERNELS naming the table. No header with functions of its own may be
// included here except shaders/shared, whose functions are static: the linker must not mix instruction sets.
#include <cmath>

#include "engine/cpu/kernels.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/pyramid.h"
#include "shaders/shared/shade.h"

namespace stipple::cpu {
namespace {

using namespace stipple::shared;

inline Texel texelAt(const TexelRow& row, uint32_t i) {
    Texel t;
    t.depth = row.depth[i];
    t.radius = row.radius[i];
    t.thickness = row.thickness[i];
    t.offset = vec2(row.x[i], row.y[i]);
    t.normalPerp = vec2(row.perpX[i], row.perpY[i]);
    t.colour = vec3(row.red[i], row.green[i], row.blue[i]);
    return t;
}
inline void setTexel(TexelRow& row, uint32_t i, const Texel& t) {
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
}

void projectBlock(const FrameConstants& f, const DrawNode& node, const PointRecord* records, uint32_t count, uint32_t* pixel,
                  uint32_t* depth) {
    const float width = float(f.width), height = float(f.height);
    for (uint32_t i = 0; i < count; ++i) {
        const PointRecord r = records[i];
        const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
        const float cx = node.base.x + node.axisX.x * qx + node.axisY.x * qy + node.axisZ.x * qz;
        const float cy = node.base.y + node.axisX.y * qx + node.axisY.y * qy + node.axisZ.y * qz;
        const float cz = node.base.z + node.axisX.z * qx + node.axisY.z * qy + node.axisZ.z * qz;
        const float scale = f.focal / cz;
        const float px = cx * scale + f.centre.x, py = cy * scale + f.centre.y;
        const bool inside = (cz > f.nearPlane) & (px >= 0.0f) & (px < width) & (py >= 0.0f) & (py < height);
        const bool fine = (recordErrorCode(r) <= node.errorCode) | ((node.octantMask >> recordOctant(r) & 1u) != 0u);
        const vec3 n = octDirection(r.normal);
        const float nx = f.viewX.x * n.x + f.viewX.y * n.y + f.viewX.z * n.z;
        const float ny = f.viewY.x * n.x + f.viewY.y * n.y + f.viewY.z * n.z;
        const float nz = f.viewZ.x * n.x + f.viewZ.y * n.y + f.viewZ.z * n.z;
        const bool seen = ((recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) != 0u) | (nx * cx + ny * cy + nz * cz < 0.0f);
        const bool keep = inside & fine & seen;
        const int ix = int(keep ? px : 0.0f), iy = int(keep ? py : 0.0f);
        pixel[i] = keep ? uint(iy) * f.width + uint(ix) : ~0u;
        depth[i] = floatBitsToUint(cz);
    }
}

struct Gathered {
    using Floats = std::array<float, kTile>;
    using Words = std::array<uint32_t, kTile>;
    alignas(64) Floats x, y, z, radius;
    alignas(64) Words normal, colour, flags;
};

bool resolveRow(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, uint64_t* visibility, uint32_t x0,
                uint32_t y, uint32_t n, TexelRow& row, float& largestRadius) {
    Gathered g;
    bool any = false;
    for (uint32_t i = 0; i < n; ++i) {
        const uint64_t key = visibility[i];
        if (key == ~uint64_t{0}) {
            g.x[i] = 0;
            g.y[i] = 0;
            g.z[i] = -1;
            g.radius[i] = 0;
            g.normal[i] = 0;
            g.colour[i] = 0;
            g.flags[i] = kFlagNoNormal;
            continue;
        }
        any = true;
        visibility[i] = ~uint64_t{0};
        const auto id = static_cast<uint32_t>(key) & 0x1fffffffu;
        const BlockSource& block = blocks[id / kRecordsPerBlock];
        const PointRecord r = block.records[id % kRecordsPerBlock];
        const DrawNode& node = *block.node;
        const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
        g.x[i] = node.base.x + node.axisX.x * qx + node.axisY.x * qy + node.axisZ.x * qz;
        g.y[i] = node.base.y + node.axisX.y * qx + node.axisY.y * qy + node.axisZ.y * qz;
        g.z[i] = node.base.z + node.axisX.z * qx + node.axisY.z * qy + node.axisZ.z * qz;
        g.radius[i] = node.edge * tables.radiusFraction[recordRadiusCode(r)];
        g.normal[i] = r.normal;
        g.flags[i] = recordFlags(r);
        uint32_t c = r.colour;
        if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
            const vec3 d = f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
            g.colour[i] = packColour(d.x, d.y, d.z);
            continue;
        }
        g.colour[i] = tables.red[c & 255u] | tables.green[c >> 8 & 255u] | tables.blue[c >> 16 & 255u];
    }
    if (!any) {
        for (uint32_t i = 0; i < n; ++i) row.depth[kPad + i] = 0;
        return false;
    }
    float largest = 0;
    for (uint32_t i = 0; i < n; ++i) {
        const bool valid = g.z[i] > 0.0f;
        const vec3 c = valid ? vec3(g.x[i], g.y[i], g.z[i]) : vec3(0.0f, 0.0f, 1.0f);
        const vec3 d = octDecode(g.normal[i]);
        const bool hasNormal = (g.flags[i] & kFlagNoNormal) == 0u;
        vec3 nc = vec3(f.viewX.x * d.x + f.viewX.y * d.y + f.viewX.z * d.z, f.viewY.x * d.x + f.viewY.y * d.y + f.viewY.z * d.z,
                       f.viewZ.x * d.x + f.viewZ.y * d.y + f.viewZ.z * d.z);
        const float inverse = 1.0f / std::sqrt(c.x * c.x + c.y * c.y + c.z * c.z);
        nc.x = hasNormal ? nc.x : -c.x * inverse;
        nc.y = hasNormal ? nc.y : -c.y * inverse;
        nc.z = hasNormal ? nc.z : -c.z * inverse;
        Texel t = texelFromSplat(c, nc, g.radius[i] * f.supportScale, f.focal, f.minimumRadius);
        const float scale = f.focal / c.z;
        t.offset = vec2(c.x * scale + f.centre.x - (float(int(x0 + i)) + 0.5f), c.y * scale + f.centre.y - (float(int(y)) + 0.5f));
        t.depth = valid ? t.depth : 0.0f;
        t.radius = valid ? t.radius : 0.0f;
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel(row, kPad + i, t);
        largest = max(largest, t.radius);
    }
    largestRadius = max(largestRadius, largest);
    return true;
}

void packRow(const TexelRow& row, uint32_t n, const Planes& to) {
    for (uint32_t i = 0; i < n; ++i) {
        const PackedTexel p = packTexel(texelAt(row, kPad + i));
        to.depth[i] = p.depth;
        to.size[i] = p.size;
        to.offset[i] = p.offset;
        to.normal[i] = p.normal;
        to.colour[i] = p.colour;
    }
}

void unpackRow(const Planes& from, uint32_t first, uint32_t n, TexelRow& row) {
    for (uint32_t i = 0; i < n; ++i) {
        PackedTexel p;
        p.depth = from.depth[i];
        p.size = from.size[i];
        p.offset = from.offset[i];
        p.normal = from.normal[i];
        p.colour = from.colour[i];
        setTexel(row, first + i, unpackTexel(p));
    }
}

void pullRow(const TexelRow& upper, const TexelRow& lower, uint32_t n, float childSize, float inverseFocal, TexelRow& out) {
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t a = kPad + 2 * i, b = a + 1;
        setTexel(out, kPad + i, pullTexels(texelAt(upper, a), texelAt(upper, b), texelAt(lower, a), texelAt(lower, b), childSize,
                                           inverseFocal));
    }
}

void expandRow(const TexelRow& coarse, uint32_t n, TexelRow& out) {
    const auto expand = [n](const TexelRow::Array& from, TexelRow::Array& to) {
        to[kPad - 1] = from[kPad - 1];
        for (uint32_t i = 0; i < (n + 1) / 2 + 1; ++i) {
            to[kPad + 2 * i] = from[kPad + i];
            to[kPad + 2 * i + 1] = from[kPad + i];
        }
    };
    expand(coarse.depth, out.depth);
    expand(coarse.radius, out.radius);
    expand(coarse.thickness, out.thickness);
    expand(coarse.x, out.x);
    expand(coarse.y, out.y);
    expand(coarse.perpX, out.perpX);
    expand(coarse.perpY, out.perpY);
    expand(coarse.red, out.red);
    expand(coarse.green, out.green);
    expand(coarse.blue, out.blue);
}

inline float pick(const TexelRow::Array& a, uint32_t i, bool left) {
    const float before = a[i - 1], after = a[i + 1];
    return left ? before : after;
}
inline Texel neighbourAt(const TexelRow& row, uint32_t i, bool left) {
    Texel t;
    t.depth = pick(row.depth, i, left);
    t.radius = pick(row.radius, i, left);
    t.thickness = pick(row.thickness, i, left);
    t.offset = vec2(pick(row.x, i, left), pick(row.y, i, left));
    t.normalPerp = vec2(pick(row.perpX, i, left), pick(row.perpY, i, left));
    t.colour = vec3(pick(row.red, i, left), pick(row.green, i, left), pick(row.blue, i, left));
    return t;
}

void pushRow(const TexelRow& fine, const TexelRow& nearRow, const TexelRow& farRow, float sy, uint32_t n, float fineSize,
             float inverseFocal, TexelRow& out) {
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t at = kPad + i;
        const bool left = (i & 1u) == 0u;
        const float sx = left ? -1.0f : 1.0f;
        setTexel(out, at, pushTexel(texelAt(fine, at), texelAt(nearRow, at), neighbourAt(nearRow, at, left), texelAt(farRow, at),
                                    neighbourAt(farRow, at, left), sx, sy, fineSize, inverseFocal));
    }
}

void shadeRow(const FrameConstants& f, const Tables& tables, const TexelRow& own, const TexelRow& row, uint32_t x0, uint32_t y,
              uint32_t n, const ShadeOutput& out) {
    const bool lit = f.shade == kShadeLit && f.debugView == kDebugNone;
    const float inverseFocal = 1.0f / f.focal;
    const float vy = (float(int(y)) + 0.5f - f.centre.y) * inverseFocal;
    std::array<float, kTile> red, green, blue;
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t at = kPad + i;
        red[i] = row.red[at];
        green[i] = row.green[at];
        blue[i] = row.blue[at];
    }
    if (lit) {
        for (uint32_t i = 0; i < n; ++i) {
            const uint32_t at = kPad + i;
            const float vx = (float(int(x0 + i)) + 0.5f - f.centre.x) * inverseFocal;
            const float inverse = 1.0f / std::sqrt(vx * vx + vy * vy + 1.0f);
            const vec3 normal = normalFromPerp(vec2(row.perpX[at], row.perpY[at]), vec3(vx * inverse, vy * inverse, inverse));
            const float light = irradiance(normal, f.sunDirection, f.skyDirection);
            red[i] *= light;
            green[i] *= light;
            blue[i] *= light;
        }
    }
    if (f.debugView == kDebugHoles || f.debugView == kDebugNormals || out.normal != nullptr) {
        for (uint32_t i = 0; i < n; ++i) {
            const uint32_t at = kPad + i;
            const float vx = (float(int(x0 + i)) + 0.5f - f.centre.x) * inverseFocal;
            const float inverse = 1.0f / std::sqrt(vx * vx + vy * vy + 1.0f);
            const vec3 c = normalFromPerp(vec2(row.perpX[at], row.perpY[at]), vec3(vx * inverse, vy * inverse, inverse));
            if (f.debugView == kDebugHoles) {
                const vec3 colour = debugHoleColour(own.depth[at], row.depth[at]);
                red[i] = colour.x;
                green[i] = colour.y;
                blue[i] = colour.z;
            } else if (f.debugView == kDebugNormals) {
                red[i] = 0.5f + 0.5f * c.x;
                green[i] = 0.5f - 0.5f * c.y;
                blue[i] = 0.5f - 0.5f * c.z;
            }
            if (out.normal == nullptr) continue;
            const bool valid = row.depth[at] > 0.0f;
            out.normal[3 * i] = valid ? f.viewX.x * c.x + f.viewY.x * c.y + f.viewZ.x * c.z : 0.0f;
            out.normal[3 * i + 1] = valid ? f.viewX.y * c.x + f.viewY.y * c.y + f.viewZ.y * c.z : 0.0f;
            out.normal[3 * i + 2] = valid ? f.viewX.z * c.x + f.viewY.z * c.y + f.viewZ.z * c.z : 0.0f;
        }
    }
    alignas(64) std::array<uint32_t, kTile> ir, ig, ib;
    for (uint32_t i = 0; i < n; ++i) {
        const bool valid = row.depth[kPad + i] > 0.0f;
        red[i] = valid ? red[i] : f.background.x;
        green[i] = valid ? green[i] : f.background.y;
        blue[i] = valid ? blue[i] : f.background.z;
        ir[i] = uint(int(std::sqrt(min(max(red[i], 0.0f), 1.0f)) * 2047.0f + 0.5f));
        ig[i] = uint(int(std::sqrt(min(max(green[i], 0.0f), 1.0f)) * 2047.0f + 0.5f));
        ib[i] = uint(int(std::sqrt(min(max(blue[i], 0.0f), 1.0f)) * 2047.0f + 0.5f));
    }
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t alpha = row.depth[kPad + i] > 0.0f ? 0xff000000u : 0u;
        out.rgba[i] = tables.srgbByte[ir[i]] | tables.srgbByte[ig[i]] << 8 | tables.srgbByte[ib[i]] << 16 | alpha;
    }
    if (out.depth != nullptr)
        for (uint32_t i = 0; i < n; ++i) out.depth[i] = row.depth[kPad + i];
    if (out.linear != nullptr)
        for (uint32_t i = 0; i < n; ++i) {
            out.linear[3 * i] = red[i];
            out.linear[3 * i + 1] = green[i];
            out.linear[3 * i + 2] = blue[i];
        }
}

}  // namespace

extern const Kernels STIPPLE_KERNELS;
const Kernels STIPPLE_KERNELS{STIPPLE_KERNELS_NAME, projectBlock, resolveRow, packRow, unpackRow,
                              pullRow,              pushRow,      expandRow,  shadeRow};

}  // namespace stipple::cpu
