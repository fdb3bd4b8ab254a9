// What is seen at each pixel, into the surface buffer: in modes with a pyramid after the last push, into level 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../surface.glsl"
#include "../shared/smooth.h"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

layout(set = 0, binding = kTriangleWordsBinding, scalar) readonly buffer TriangleBlock { uint triangleWords[]; };  // two a pixel

// Is a point of a smooth node seen there?
bool isWideAt(uint place) {
    const uint64_t key = visibility[place];
    return isPointKey(key, frame.firstBlock) && (nodes[blocks[keyBlock(key)].node].octantMask & kNodeSmooth) != 0u;
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint place = pixel.y * frame.width + pixel.x;
    const Texel own = loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, int(pixel.x), int(pixel.y));
    Texel t = own;
    if (stepInfo.hasPyramid != 0u) t = pushedTexel(ivec2(pixel), own);
    SurfaceWords s;
    s.material = stepInfo.hasTriangles != 0u ? triangleWords[2u * place] : 0u;
    if (t.depth != own.depth || s.material == 0u) s.material = surfaceWord(t.surface);  // no triangle, or a splat in front
    t = finished(t);
    s.depth = t.depth > 0.0 ? depthAt(t, pixel, float(stepInfo.hasPyramid)) : t.depth;
    s.normal = 0u;
    vec3 colour = t.colour;
    if (t.depth > 0.0) {
        const vec3 n = normalAt(t, pixel);
        s.normal = octEncode(n);
        if (frame.debugView == kDebugHoles) colour = debugHoleColour(finished(own).depth, t.depth);
        if (frame.debugView == kDebugNormals) colour = vec3(0.5 + 0.5 * n.x, 0.5 - 0.5 * n.y, 0.5 - 0.5 * n.z);
        if (letsLightThrough(t.thickness, t.radius, t.isRound, t.axis.x) > 0.5) s.material |= kPixelLeaf;
    }
    if (stepInfo.hasSmooth != 0u && t.depth > 0.0 && isWideAt(place)) {
        const Texel mean = pushedTexel(ivec2(pixel), loadTexel(stepInfo.smoothTexels, stepInfo.fineWidth, stepInfo.fineHeight, int(pixel.x), int(pixel.y)));
        if (isOfSurface(mean, depthAt(mean, pixel, 1.0), s.depth, frameLensHere()) > 0.5) {
            const vec3 n = normalAt(mean, pixel);
            s.normal = octEncode(n);
            s.material = surfaceWord(mean.surface);
            if (frame.debugView != kDebugHoles) colour = frame.debugView == kDebugNormals ? vec3(0.5 + 0.5 * n.x, 0.5 - 0.5 * n.y, 0.5 - 0.5 * n.z) : mean.colour;
            if (letsLightThrough(mean.thickness, mean.radius, mean.isRound, mean.axis.x) > 0.5) s.material |= kPixelLeaf;
        }
    }
    s.albedo = packColour(colour.x, colour.y, colour.z);
    surfaceBuffer[place] = s;
}
