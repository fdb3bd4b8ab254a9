// Pixels that show patches, after resolve: attributes where the ray meets the triangle, into level 0 and the surface
// words. Where no triangles are drawn, all other pixels get surface words of 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../patch.glsl"
layout(local_size_x = 64) in;

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
    const uint corners = patchCorners(of, block, keyLane(key));
    const uint a = corners & 255u, b = corners >> 8 & 255u, c = corners >> 16;
    const PixelRay pixelsRay = pixelRayHere(pixel);
    const vec3 ray = rayDirection(pixelsRay);
    const vec3 p0 = patchPlace(of, block, m, a);
    const vec3 p1 = patchPlace(of, block, m, b);
    const vec3 p2 = patchPlace(of, block, m, c);
    const vec2 w = triangleWeights(ray, fromRay(pixelsRay, p0), fromRay(pixelsRay, p1), fromRay(pixelsRay, p2));
    const float first = 1.0 - w.x - w.y;
    const vec3 n = first * octDecode(of.blocks[block].normals[a]) + w.x * octDecode(of.blocks[block].normals[b]) + w.y * octDecode(of.blocks[block].normals[c]);
    const vec3 normal = surfaceNormal(m.normalX * n.x + m.normalY * n.y + m.normalZ * n.z, cross(p1 - p0, p2 - p0), ray);
    Texel t;
    t.depth = keyDepth(key);
    t.radius = kTriangleRadius;
    t.thickness = kTriangleRadius;
    t.offset = vec2(0.0);
    t.normalPerp = perpFromNormal(normal, normalize(ray));
    t.colour = first * decodeTexel(of.blocks[block].colours[a], true).xyz + w.x * decodeTexel(of.blocks[block].colours[b], true).xyz +
               w.y * decodeTexel(of.blocks[block].colours[c], true).xyz;
    t.surface = noSurface();
    if (frame.debugView == kDebugLevel) t.colour = debugLevelColour(node.level);
    if (frame.debugView == kDebugError) t.colour = debugErrorColour(node.errorPixels);
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
    triangleWords[2u * place] = kPixelTriangle | kPlainSurface;
    triangleWords[2u * place + 1u] = 0u;
}
