// What both passes of strands share: segments in camera space, and wide ones in a list.
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

// A strand so wide that its pixels are filled, as the cpu backend has it.
struct WideStrand {
    float xa, ya, xb, yb;
    float inverseA, inverseB;
    float halfA, halfB;
    float nearerA, nearerB;
    RibbonEdge edgeA, edgeB;
    vec3 a, b;  // of a filled tube, camera space
    float radiusA, radiusB;
    ivec4 box;  // pixels that may be covered: from xy to zw
    uint isRound;
    uint id;
};
layout(set = 0, binding = 17, scalar) buffer WideBlock {
    uint wideCount;
    WideStrand wide[];
};
const uint kWideCapacity = 65536u;

CameraSegment cameraSegment(DrawNode node, StrandSegment s) {
    CameraSegment c;
    c.a = node.base + node.axisX * float(s.a.positionXY & 0xffffu) + node.axisY * float(s.a.positionXY >> 16) +
          node.axisZ * float(s.a.positionZ & 0xffffu);
    c.b = node.base + node.axisX * float(s.b.positionXY & 0xffffu) + node.axisY * float(s.b.positionXY >> 16) +
          node.axisZ * float(s.b.positionZ & 0xffffu);
    c.radiusA = strandRadius(s.a, node.edge);
    c.radiusB = strandRadius(s.b, node.edge);
    c.directionA = nodeDirection(node, octDecode(s.a.direction));
    c.directionB = nodeDirection(node, octDecode(s.b.direction));
    c.isRound = float(s.a.positionZ >> 31);
    return c;
}

// Offers one pixel of a wide strand: if its ray meets the tube, or its centre lies between the ribbon's edges.
void offerWide(WideStrand s, int x, int y) {
    if (s.isRound != 0u) {
        const Tube tube = tubeOf(s.a, s.b, s.radiusA, s.radiusB);
        const TubeHit hit = tubeHit(tube, (float(x) + 0.5 - frame.centre.x) * (1.0 / frame.focal),
                                    (float(y) + 0.5 - frame.centre.y) * (1.0 / frame.focal), frame.nearPlane,
                                    false);
        if (hit.depth < kNoDepth) offer(x, y, 1.0 / hit.depth, s.id);
        return;
    }
    const RibbonPlace p = ribbonPlace(float(x) + 0.5 - s.xa, float(y) + 0.5 - s.ya, s.xb - s.xa, s.yb - s.ya, s.edgeA, s.edgeB);
    if (!(abs(p.across) <= 1.0)) return;
    const float nearer = 1.0 + p.across * (s.edgeA.slope + p.along * (s.edgeB.slope - s.edgeA.slope));
    const float axis = 1.0 / (s.inverseA + p.along * (s.inverseB - s.inverseA));
    offer(x, y, 1.0 / max(axis * nearer, frame.nearPlane), s.id);
}
