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
    float widest;
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

// Offers one pixel of a wide strand, if its centre is within the half-width.
void offerWide(WideStrand s, int x, int y) {
    const float dx = s.xb - s.xa, dy = s.yb - s.ya;
    const float length2 = dx * dx + dy * dy;
    const float px = float(x) + 0.5 - s.xa, py = float(y) + 0.5 - s.ya;
    float u, nearer;
    if (s.isRound != 0u) {
        u = clamp((px * dx + py * dy) * (length2 > 1.0e-8 ? 1.0 / length2 : 0.0), 0.0, 1.0);
        const float ex = px - u * dx, ey = py - u * dy;
        const float halfWidth = s.halfA + u * (s.halfB - s.halfA);
        const float q = ex * ex + ey * ey;
        if (q > halfWidth * halfWidth) return;
        const float rise = sqrt(1.0 - min(q / (halfWidth * halfWidth), 1.0));
        nearer = 1.0 - rise * (1.0 - (s.nearerA + u * (s.nearerB - s.nearerA)));
    } else {
        const RibbonPlace p = ribbonPlace(px, py, dx, dy, s.edgeA, s.edgeB);
        if (!(abs(p.across) <= 1.0)) return;
        u = p.along;
        nearer = 1.0 + p.across * (s.edgeA.slope + u * (s.edgeB.slope - s.edgeA.slope));
    }
    const float axis = 1.0 / (s.inverseA + u * (s.inverseB - s.inverseA));
    offer(x, y, 1.0 / max(axis * nearer, frame.nearPlane), s.id);
}
