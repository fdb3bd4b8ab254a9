// What the passes that know triangles see beyond bindings.glsl.
#include "bindings.glsl"
#include "shared/material.h"
#include "shared/mesh.h"
#include "shared/surface.h"
#include "shared/texture.h"

// A triangle that many threads fill together: corners in 1/256 pixel, oriented so that the inside is positive.
struct LargeTriangle {
    int x0;
    int y0;
    int x1;
    int y1;
    int x2;
    int y2;
    float inverseDepth0;  // imageLinear
    float inverseDepth1;
    float inverseDepth2;
    uint id;
};

layout(set = 0, binding = kMeshesBinding, scalar) readonly buffer MeshBlock { DrawMesh meshes[]; };
layout(set = 0, binding = kClustersBinding, scalar) readonly buffer ClusterBlock { DrawCluster clusters[]; };
layout(set = 0, binding = kMaterialsBinding, scalar) readonly buffer MaterialBlock { SurfaceMaterial materials[]; };
layout(set = 0, binding = kTexturesBinding, scalar) readonly buffer TextureBlock { TextureInfo textures[]; };
layout(set = 0, binding = kTilesBinding, scalar) readonly buffer TileBlock { uvec2 tiles[]; };  // addresses; 0: not resident
layout(set = 0, binding = kTriangleWordsBinding, scalar) buffer TriangleBlock { uint triangleWords[]; };  // two a pixel: material, emission
layout(set = 0, binding = kLargeBinding, scalar) buffer LargeBlock {
    uint largeCount;
    LargeTriangle large[];
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Vertices { MeshVertex vertices[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Words { uint words[]; };

vec4 decodeTexel(uint c, bool isColour) {
    vec4 v = vec4(float(c & 255u), float(c >> 8 & 255u), float(c >> 16 & 255u), float(c >> 24)) / 255.0;
    if (isColour) v.xyz = vec3(linearFromByte(v.x), linearFromByte(v.y), linearFromByte(v.z));
    return v;
}

bool sampleLevel(TextureInfo info, uint firstTile, uint level, float u, float v, out vec4 result) {
    const TextureTap tap = textureTap(info, info.firstTile[level], level, u, v);
    const uvec2 address = tiles[firstTile + tap.tile];
    result = vec4(0.0);
    if (address == uvec2(0u)) return false;
    Words tile = Words(address);
    const uint at = tap.y * kTileEdge + tap.x;
    const bool isColour = info.isColour != 0u;
    result = mix(mix(decodeTexel(tile.words[at], isColour), decodeTexel(tile.words[at + 1u], isColour), tap.fx),
                 mix(decodeTexel(tile.words[at + kTileEdge], isColour), decodeTexel(tile.words[at + kTileEdge + 1u], isColour), tap.fx), tap.fy);
    return true;
}

// Trilinear, from the finest tiles that are there; false if none is.
bool sampleTexture(DrawCluster c, TextureSlot slot, vec2 uv, float footprint, out vec4 result) {
    result = vec4(1.0);
    if (slot.texture == 0u) return false;
    const TextureInfo info = textures[c.firstTexture + slot.texture - 1u];
    const float su = slot.rowU.x * uv.x + slot.rowU.y * uv.y + slot.rowU.z;
    const float sv = slot.rowV.x * uv.x + slot.rowV.y * uv.y + slot.rowV.z;
    const float lod = min(textureLod(footprint * float(max(info.width, info.height))), float(info.levels - 1u));
    uint level = uint(lod);
    const float between = lod - float(level);
    bool isThere = sampleLevel(info, c.firstTile, level, su, sv, result);
    if (isThere) {
        vec4 coarse;
        if (between > 0.0 && level + 1u < info.levels && sampleLevel(info, c.firstTile, level + 1u, su, sv, coarse))
            result = mix(result, coarse, between);
        return true;
    }
    while (!isThere && level + 1u < info.levels) isThere = sampleLevel(info, c.firstTile, ++level, su, sv, result);
    return isThere;
}

// Direction of the ray through a pixel's centre.
vec3 rayThrough(uvec2 pixel) { return rayDirection(pixelRayHere(pixel)); }

// Position of a cluster's vertex in camera space.
vec3 placeOf(DrawCluster c, DrawMesh m, uint i) {
    Vertices vertices = Vertices(uvec2(c.verticesLow, c.verticesHigh));
    const MeshVertex v = vertices.vertices[i];
    if (m.places == kPlacesShort) return meshPosition(v.x, v.y, v.z, m);
    if (m.places == kPlacesFar) return meshPositionWide(v.x, v.y, v.z, v.x >> 31, v.y >> 31, v.z >> 31, m);
    const MeshVertex high = vertices.vertices[i + (c.counts & 0xffffu) / 2u];
    return meshPositionWide(v.x, v.y, v.z, high.x, high.y, high.z, m);
}

// Does an alpha mask leave the triangle at this pixel?
bool isKept(DrawCluster c, uint corners, uvec2 pixel) {
    const DrawMesh m = meshes[c.mesh];
    Vertices vertices = Vertices(uvec2(c.verticesLow, c.verticesHigh));
    const MeshVertex va = vertices.vertices[corners & 255u];
    const MeshVertex vb = vertices.vertices[corners >> 8 & 255u];
    const MeshVertex vc = vertices.vertices[corners >> 16 & 255u];
    const SurfaceMaterial material = materials[m.firstMaterial + (va.surface & kSurfaceMaterialMask)];
    const PixelRay ray = pixelRayHere(pixel);
    const vec3 a = placeOf(c, m, corners & 255u);
    const vec3 e1 = placeOf(c, m, corners >> 8 & 255u) - a;
    const vec3 e2 = placeOf(c, m, corners >> 16 & 255u) - a;
    const vec2 w = triangleWeights(rayDirection(ray), fromRay(ray, a), fromRay(ray, a + e1), fromRay(ray, a + e2));
    const float wa = 1.0 - w.x - w.y;
    float alpha = material.alpha * (wa * float(va.colour >> 24) + w.x * float(vb.colour >> 24) + w.y * float(vc.colour >> 24)) / 255.0;
    const float footprint = uvFootprint(ray, 1.0 / frame.focal, a, e1, e2, vec2(vb.u - va.u, vb.v - va.v), vec2(vc.u - va.u, vc.v - va.v));
    vec4 s;
    if (sampleTexture(c, material.baseTexture, vec2(wa * va.u + w.x * vb.u + w.y * vc.u, wa * va.v + w.x * vb.v + w.y * vc.v), footprint, s))
        alpha *= s.w;
    return alpha >= material.alphaCutoff;
}

// Does it reach less than 64 pixels each way? Then 32 bits hold the products of its edge functions, within its box.
bool isNarrow(LargeTriangle t) {
    const int width = max(t.x0, max(t.x1, t.x2)) - min(t.x0, min(t.x1, t.x2));
    const int height = max(t.y0, max(t.y1, t.y2)) - min(t.y0, min(t.y1, t.y2));
    return max(width, height) < 64 * 256;
}
bool isCoveredNarrow(LargeTriangle t, int x, int y, out float inverseDepth) {
    const int px = x * 256 + 128, py = y * 256 + 128;
    const int w0 = (t.x2 - t.x1) * (py - t.y1) - (t.y2 - t.y1) * (px - t.x1);
    const int w1 = (t.x0 - t.x2) * (py - t.y2) - (t.y0 - t.y2) * (px - t.x2);
    const int w2 = (t.x1 - t.x0) * (py - t.y0) - (t.y1 - t.y0) * (px - t.x0);
    const int area = (t.x1 - t.x0) * (t.y2 - t.y0) - (t.y1 - t.y0) * (t.x2 - t.x0);
    inverseDepth = (float(w0) * t.inverseDepth0 + float(w1) * t.inverseDepth1 + float(w2) * t.inverseDepth2) / float(area);
    return w0 >= (isTopLeft(t.x2 - t.x1, t.y2 - t.y1) ? 0 : 1) && w1 >= (isTopLeft(t.x0 - t.x2, t.y0 - t.y2) ? 0 : 1) &&
           w2 >= (isTopLeft(t.x1 - t.x0, t.y1 - t.y0) ? 0 : 1);
}

// Edge functions of an oriented triangle at the centre of a pixel of its box; of a wide one in 64 bits: exact for every
// corner within the guard band.
bool isCovered(LargeTriangle t, int x, int y, out float inverseDepth) {
    if (isNarrow(t)) return isCoveredNarrow(t, x, y, inverseDepth);
    const int64_t px = int64_t(x) * 256l + 128l;
    const int64_t py = int64_t(y) * 256l + 128l;
    const int64_t x0 = int64_t(t.x0), y0 = int64_t(t.y0), x1 = int64_t(t.x1), y1 = int64_t(t.y1), x2 = int64_t(t.x2), y2 = int64_t(t.y2);
    const int64_t w0 = (x2 - x1) * (py - y1) - (y2 - y1) * (px - x1);
    const int64_t w1 = (x0 - x2) * (py - y2) - (y0 - y2) * (px - x2);
    const int64_t w2 = (x1 - x0) * (py - y0) - (y1 - y0) * (px - x0);
    const int64_t b0 = isTopLeft(t.x2 - t.x1, t.y2 - t.y1) ? 0l : 1l;
    const int64_t b1 = isTopLeft(t.x0 - t.x2, t.y0 - t.y2) ? 0l : 1l;
    const int64_t b2 = isTopLeft(t.x1 - t.x0, t.y1 - t.y0) ? 0l : 1l;
    const int64_t area = (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0);
    inverseDepth = (float(w0) * t.inverseDepth0 + float(w1) * t.inverseDepth1 + float(w2) * t.inverseDepth2) / float(area);
    return w0 >= b0 && w1 >= b1 && w2 >= b2;
}

// `linear`: imageLinear of the depth.
void offer(int x, int y, float linear, uint64_t id) {
    offerKey(uint(y) * frame.width + uint(x), visibilityKey(floatBitsToUint(depthOfLinear(frameLensHere(), linear)), id));
}
