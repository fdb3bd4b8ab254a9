// Pixels that show curves, after resolve, to texels of level 0; measures the widest that is reconstructed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../curves.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint64_t key = visibility[pixel.y * frame.width + pixel.x];
    if (keyKind(key, frame.firstBlock) != kKindCurves) return;
    const DrawBlock source = blocks[keyBlock(key)];
    const DrawNode node = nodes[source.node];
    const CurveSegment segment =
        Segments(uvec2(node.addressLow, node.addressHigh)).segments[source.first + keyLane(key)];
    const CameraSegment s = cameraSegment(node, segment);
    const float cx = frame.centre.x - 0.5 - float(pixel.x);
    const float cy = frame.centre.y - 0.5 - float(pixel.y);
    const Lens lens = frameLensHere();
    const ScreenSegment on = projectSegment(s.a, s.b, lens, cx, cy, frame.nearPlane);
    const CurvePixel seen = curvePixel(s, on, frame.supportScale, lens, cx, cy, frame.nearPlane, frame.sunDirection);
    Texel t = seen.texel;
    float place = seen.place;
    if (isFilled(s, on, lens, frame.exactCurves) > 0.5) {
        const PixelRay ray = pixelRay(lens, -cx * (1.0 / frame.focal), -cy * (1.0 / frame.focal));
        FilledPixel hit;
        if (s.isRound > 0.5)
            hit = tubePixel(s, ray, frame.nearPlane);
        else
            hit = ribbonPixel(s, ray, frame.nearPlane);
        t.depth = hit.depth < kNoDepth ? hit.depth : keyDepth(key);  // where rounding lets the ray pass by
        t.normalPerp = hit.depth < kNoDepth ? hit.normalPerp : vec2(0.0);
        t.radius = 0.25;
        t.thickness = s.isRound > 0.5 ? 0.25 : kLeafThickness * 0.25;  // a filled ribbon is a leaf
        t.offset = vec2(0.0);
        t.isRound = 0.0;
        t.axis = vec2(0.0);
        place = hit.place;
    }
    const vec4 a = decodeTexel(segment.a.colour, true);
    const vec4 b = decodeTexel(segment.b.colour, true);
    t.colour = a.xyz + place * (b.xyz - a.xyz);
    if (frame.debugView == kDebugLevel) t.colour = debugLevelColour(node.level);
    if (frame.debugView == kDebugError) t.colour = debugErrorColour(node.errorPixels);
    takeLargest(t.radius);
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
}
