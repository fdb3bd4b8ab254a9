// Pixels that show patches, after resolve: attributes where the ray meets the triangle, into level 0 and the surface
// words. Where no triangles are drawn, all other pixels get surface words of 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../patch_splats.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

struct PatchSurface {
    vec3 normal;  // of the patch's directions, any length
    vec3 face;    // camera space
    vec3 colour;
    vec2 finish;  // metallic, roughness
    MapLight light;
};

// What has no material is lit by the formula of points, as those that no patch fits are beside it.
uint flagsOf(DrawNode node) {
    const bool isOne = node.materials == 0u || (node.material & kOnlyMaterial) != 0u;
    return isOne && (node.material & ~kOnlyMaterial) == kPlainPoint ? 0u : kPixelTriangle;
}

uint byteOf(float v) { return uint(clamp(v, 0.0, 1.0) * 255.0 + 0.5); }
vec3 colourOf(PatchBlocks of, uint block, uint s) { return decodeTexel(of.blocks[block].colours[s], true).xyz; }

// In the place of what samples show, where the block has a map.
void showMap(PatchBlocks of, DrawNode node, uint block, float i, float j, float cells, inout PatchSurface s) {
    const uint map = of.blocks[block].map;
    if ((map & kMapLight) != 0u && (node.material & kOnlyMaterial) == 0u) s.light = mapLight(node, map, i, j, cells);
    if ((map & kMapDensity) == 0u) return;
    const MapLook look = mapLook(node, map, i, j, cells);
    s.colour = look.colour;
    if ((map & kMapNormals) != 0u) s.normal = look.normal;
    const bool hasOwn = node.materials != 0u && (node.material & kOnlyMaterial) == 0u;
    if ((map & kMapMaterials) != 0u && hasOwn) s.finish = look.finish;
}
vec2 latticeOf(uint s) { return vec2(s % kPatchStride, s / kPatchStride); }

// Where a ray meets a triangle, from its corners.
PatchSurface onTriangle(PatchBlocks of, DrawNode node, uint block, DrawMesh m, uint lane, PixelRay ray) {
    const uint corners = patchCorners(of, block, lane);
    const uint a = corners & 255u, b = corners >> 8 & 255u, c = corners >> 16;
    const vec3 p0 = patchPlace(of, block, m, a);
    const vec3 p1 = patchPlace(of, block, m, b);
    const vec3 p2 = patchPlace(of, block, m, c);
    const vec2 w = triangleWeights(rayDirection(ray), fromRay(ray, p0), fromRay(ray, p1), fromRay(ray, p2));
    const float first = 1.0 - w.x - w.y;
    PatchSurface s;
    s.normal = first * octDecode(of.blocks[block].normals[a]) + w.x * octDecode(of.blocks[block].normals[b]) +
               w.y * octDecode(of.blocks[block].normals[c]);
    s.face = cross(p1 - p0, p2 - p0);
    s.light = MapLight(vec3(0.0), 0.0);
    s.colour = first * colourOf(of, block, a) + w.x * colourOf(of, block, b) + w.y * colourOf(of, block, c);
    s.finish = first * patchFinishOf(node, block, a) + w.x * patchFinishOf(node, block, b) +
               w.y * patchFinishOf(node, block, c);
    if (of.blocks[block].map == 0u) return s;
    const vec2 d1 = latticeOf(b) - latticeOf(a), d2 = latticeOf(c) - latticeOf(a),
               at = latticeOf(a) + w.x * d1 + w.y * d2;
    showMap(of, node, block, at.x, at.y, uvFootprint(ray, 1.0 / frame.focal, p0, p1 - p0, p2 - p0, d1, d2), s);
    return s;
}

// Direct interpolation: below the place where a ray meets a disc, from the four samples around it.
PatchSurface belowDisc(PatchBlocks of, DrawNode node, uint block, DrawMesh m, uint lane, PixelRay ray) {
    const PatchDisc disc = discOf(of, block, m, lane, cellsAround(of, block, lane));
    const vec3 hit = patchDiscHit(disc, m, ray, frame.nearPlane);
    const PatchMix mixed = patchMix(hit);
    PatchSurface s;
    s.normal = vec3(0.0);
    s.colour = vec3(0.0);
    s.finish = vec2(0.0);
    s.face = disc.normal;
    s.light = MapLight(vec3(0.0), 0.0);
    for (uint c = 0u; c < 4u; ++c) {
        const uint at = mixed.first + c % 2u + kPatchStride * (c / 2u);
        const float w = mixed.weight[c];  // all four are there: the cell is drawn
        s.normal += w * octDecode(of.blocks[block].normals[at]);
        s.colour += w * colourOf(of, block, at);
        s.finish += w * patchFinishOf(node, block, at);
    }
    if (of.blocks[block].map != 0u)
        showMap(of, node, block, hit.y, hit.z, discFootprint(ray, 1.0 / frame.focal, disc.centre, disc.normal, m), s);
    return s;
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint place = pixel.y * frame.width + pixel.x;
    const uint64_t key = visibility[place];
    if (keyKind(key, frame.firstBlock) != kKindPatches) {
        const bool hasTriangles = frame.firstBlock.of[kKindTriangles] != frame.firstBlock.of[kKindPatches];
        if (!hasTriangles) triangleWords[2u * place] = 0u;
        return;
    }
    const DrawBlock source = blocks[keyBlock(key)];
    const DrawNode node = nodes[source.node];
    PatchBlocks of = patchBlocksOf(node);
    const uint block = source.first;
    const DrawMesh m = meshes[node.weights + of.blocks[block].number];
    const PixelRay pixelsRay = pixelRayHere(pixel);
    const vec3 ray = rayDirection(pixelsRay);
    PatchSurface seen;
    if (frame.patchAs == kPatchDirect)
        seen = belowDisc(of, node, block, m, keyLane(key), pixelsRay);
    else
        seen = onTriangle(of, node, block, m, keyLane(key), pixelsRay);
    const vec3 n = seen.normal;
    const vec3 normal = surfaceNormal(m.normalX * n.x + m.normalY * n.y + m.normalZ * n.z, seen.face, ray);
    Texel t;
    t.depth = keyDepth(key);
    t.radius = kTriangleRadius;
    t.thickness = kTriangleRadius;
    t.offset = vec2(0.0);
    t.normalPerp = perpFromNormal(normal, normalize(ray));
    t.colour = seen.colour;
    t.surface = noSurface();
    if (frame.debugView == kDebugLevel) t.colour = debugLevelColour(node.level);
    if (frame.debugView == kDebugError) t.colour = debugErrorColour(node.errorPixels);
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
    const uint surface = flagsOf(node);
    const uint flags = surface != 0u && seen.light.unlit >= 0.5 ? surface | kPixelUnlit : surface;
    triangleWords[2u * place] = flags | 0x00ff0000u | byteOf(seen.finish.x) | byteOf(seen.finish.y) << 8;
    triangleWords[2u * place + 1u] = packColour(seen.light.emission.x, seen.light.emission.y, seen.light.emission.z);
}
