// What both passes of curves share: segments in camera space, and wide ones in a list.
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

// A curve so wide that its pixels are filled, as the cpu backend has it.
struct FilledCurve {
    float xa, ya, xb, yb;
    float inverseA, inverseB;
    float halfA, halfB;
    float nearerA, nearerB;
    vec3 acrossA, acrossB;  // of a filled ribbon
    vec3 a, b;              // of a filled curve, camera space
    float radiusA, radiusB;
    ivec4 box;  // pixels that may be covered: from xy to zw
    uint isRound;
    uint id;
};
layout(set = 0, binding = kWideBinding, scalar) buffer WideBlock {
    uint wideCount;
    FilledCurve wide[];
};

CameraSegment cameraSegment(DrawNode node, CurveSegment s) {
    CameraSegment c;
    c.a = node.base + node.axisX * float(s.a.positionXY & 0xffffu) + node.axisY * float(s.a.positionXY >> 16) +
          node.axisZ * float(s.a.positionZ & 0xffffu);
    c.b = node.base + node.axisX * float(s.b.positionXY & 0xffffu) + node.axisY * float(s.b.positionXY >> 16) +
          node.axisZ * float(s.b.positionZ & 0xffffu);
    c.radiusA = curveRadius(s.a, node.edge);
    c.radiusB = curveRadius(s.b, node.edge);
    c.directionA = nodeDirection(node, octDecode(s.a.direction));
    c.directionB = nodeDirection(node, octDecode(s.b.direction));
    c.isRound = float(s.a.positionZ >> 31);
    return c;
}

Ribbon ribbonOfWide(FilledCurve s) { return ribbonOf(s.a, s.b, s.acrossA, s.acrossB, s.radiusA, s.radiusB); }

// Offers one pixel of a filled curve if its ray meets the curve. `ribbon`: what ribbonOfWide says, once for all pixels.
void offerWide(FilledCurve s, Ribbon ribbon, int x, int y) {
    const PixelRay ray = pixelRay(frameLensHere(), (float(x) + 0.5 - frame.centre.x) * (1.0 / frame.focal), (float(y) + 0.5 - frame.centre.y) * (1.0 / frame.focal));
    if (s.isRound != 0u) {
        const TubeHit hit = tubeHit(tubeOf(s.a, s.b, s.radiusA, s.radiusB), ray, frame.nearPlane, false);
        if (hit.depth < kNoDepth) offer(x, y, imageLinear(frameLensHere(), hit.depth), drawId(frame.firstBlock.of[kKindCurves], s.id));
        return;
    }
    const RibbonHit hit = ribbonHit(ribbon, ray, frame.nearPlane, kRibbonSlack);
    if (hit.depth < kNoRibbon) offer(x, y, imageLinear(frameLensHere(), hit.depth), drawId(frame.firstBlock.of[kKindCurves], s.id));
}
