// Texels of level 0 where wide discs are in front: the mean of those about the front one's depth.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

PointRecord recordOf(uint id, out DrawNode node) {
    const DrawBlock source = blocks[id / kRecordsPerBlock];
    node = nodes[source.node];
    return Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + id % kRecordsPerBlock];
}

const uint kThreads = kPixelTile * kPixelTile;
shared ivec2 rowsOf[kThreads];  // of as many discs: first and last that may be covered, of those in the workgroup's columns
shared uint anyHere;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    const bool isInside = pixel.x < frame.width && pixel.y < frame.height;
    uint64_t key = kNoKey;
    if (isInside) key = visibility[pixel.y * frame.width + pixel.x];
    const bool isDisc = isInside && keyKind(key, frame.firstBlock) == kKindDiscs;
    const uint thread = gl_LocalInvocationIndex;
    if (thread == 0u) anyHere = 0u;
    barrier();
    if (isDisc) anyHere = 1u;
    barrier();
    if (anyHere == 0u) return;
    const vec2 at = (vec2(pixel) + 0.5 - frame.centre) * (1.0 / frame.focal);
    const Lens lens = frameLensHere();
    const PixelRay ray = pixelRay(lens, at.x, at.y);
    const float depth = keyDepth(key);
    DrawNode node;
    float apart = 0.0;
    PointRecord front;
    if (isDisc) {
        const uint frontId = keyPlace(key, frame.firstBlock.of[kKindDiscs]);
        front = recordOf(frontId, node);
        apart = depthShared(wideDisc(node, front, frame.supportScale, frontId, lens), ray);
    }
    float weight = 0.0;
    float inverseDepth = 0.0;
    vec3 n = vec3(0.0);
    vec3 colour = vec3(0.0);
    TexelSurface surface = noSurface();
    const uint count = min(discCount, kDiscCapacity);
    const ivec2 corner = ivec2(gl_WorkGroupID.xy * kPixelTile), end = corner + int(kPixelTile);
    for (uint first = 0u; first < count; first += kThreads) {
        const uint mine = first + thread;
        rowsOf[thread] = ivec2(1, 0);
        if (mine < count) {
            const DiscBox box = discBox(discs[mine], frame);
            if (box.x.first < end.x && box.x.last >= corner.x && box.y.first < end.y && box.y.last >= corner.y) rowsOf[thread] = ivec2(box.y.first, box.y.last);
        }
        barrier();
        for (uint k = 0u; k < kThreads; ++k) {
            if (!isDisc || int(pixel.y) < rowsOf[k].x || int(pixel.y) > rowsOf[k].y) continue;
            const WideDisc d = discs[first + k];
            const DiscHit hit = discHit(d, ray, frame.nearPlane);
            const float w = discWeight(hit, depth, apart);
            if (w == 0.0) continue;
            const PointRecord r = recordOf(d.id, node);
            weight += w;
            inverseDepth += lens.isOrthographic ? w * hit.depth : w / hit.depth;
            n += d.normal * (dot(d.normal, sightTo(lens, d.centre)) > 0.0 ? -w : w);
            colour += w * pointColour(node, r);
            if (frame.hasMaterials == 0u) continue;
            const DrawBlock source = blocks[d.id / kRecordsPerBlock];
            const TexelSurface s = surfaceOfPoint(materialOf(node, source.first + d.id % kRecordsPerBlock));
            surface.share += w * s.share;
            surface.metallic += w * s.metallic;
            surface.roughness += w * s.roughness;
        }
        barrier();
    }
    if (!isDisc) return;
    Texel t;
    t.depth = lens.isOrthographic ? inverseDepth / weight : weight / inverseDepth;
    t.radius = kExactRadius;
    t.thickness = (recordFlags(front) & kFlagLeaf) != 0u ? kLeafThickness * kExactRadius : apart * frame.focal / lensDepth(lens, t.depth);  // its mean is of what lies so far apart
    t.offset = vec2(0.0);
    t.normalPerp = perpFromNormal(normalize(n), viewDirection(at.x * frame.focal, at.y * frame.focal, lens));
    t.colour = colour / weight;
    t.isRound = 0.0;
    t.axis = vec2(0.0);
    t.surface = surface;
    t.surface.share /= weight;
    t.surface.metallic /= weight;
    t.surface.roughness /= weight;
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
}
