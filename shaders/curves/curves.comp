// One workgroup per block of 256 segments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../curves.glsl"
layout(local_size_x = 256) in;

uint rank;  // of this segment, see curveRank

const int kMostPixels = 4096;

// imageLinear of a line's surface, from that of its axis.
float lineLinear(float linear, float surface) {
    return frame.orthographic != 0u ? lineDepth(frameLensHere(), linear, surface, frame.nearPlane) : linear / surface;
}

void drawLine(FilledCurve s) {
    const bool isSteep = abs(s.xb - s.xa) < abs(s.yb - s.ya);
    vec2 a = isSteep ? vec2(s.ya, s.xa) : vec2(s.xa, s.ya);
    vec2 b = isSteep ? vec2(s.yb, s.xb) : vec2(s.xb, s.yb);
    vec4 atA = vec4(s.inverseA, s.halfA, s.nearerA, 0.0);
    vec4 atB = vec4(s.inverseB, s.halfB, s.nearerB, 0.0);
    if (b.x < a.x) {
        const vec2 c = a;
        a = b;
        b = c;
        const vec4 d = atA;
        atA = atB;
        atB = d;
    }
    const float columns = float(isSteep ? frame.height : frame.width);
    const float rows = float(isSteep ? frame.width : frame.height);
    const float across = b.x - a.x;
    const float first = max(ceil(a.x - 0.5), 0.0);
    const float last = min(ceil(b.x - 0.5), columns) - 1.0;
    if (!(first <= last) || !(across > 0.0)) return;
    const float slope = (b.y - a.y) / across;
    const float longer = sqrt(1.0 + slope * slope);
    for (int m = int(first); m <= int(last); ++m) {
        const float u = (float(m) + 0.5 - a.x) / across;
        const float other = a.y + u * (b.y - a.y);
        if (!(other >= 0.0 && other < rows)) continue;
        const int x = isSteep ? int(other) : m;
        const int y = isSteep ? m : int(other);
        const vec4 here = atA + u * (atB - atA);
        if (here.y < kNarrow && coverageThreshold(uint(y) * frame.width + uint(x), rank, frame.coverageSeed) >= 2.0 * here.y * longer)
            continue;
        offer(x, y, lineLinear(here.x, here.z), drawId(frame.firstBlock.of[kKindCurves], s.id));
    }
}

void drawEnd(float x, float y, float inverseDepth, float halfWidth, float nearer, float across, uint id) {
    if (!(x >= 0.0 && y >= 0.0 && x < float(frame.width) && y < float(frame.height))) return;
    const uint pixel = uint(y) * frame.width + uint(x);
    const float share = 3.14159265 * halfWidth * halfWidth * (1.0 - across / max(2.0 * halfWidth, 1.0e-6));
    if (halfWidth < kNarrow && coverageThreshold(pixel, ~rank, frame.coverageSeed) >= share) return;
    offer(int(x), int(y), lineLinear(inverseDepth, nearer), drawId(frame.firstBlock.of[kKindCurves], id));
}

// The pixels that a segment may cover, from lo to hi. False: none, as it lies before the near plane.
bool coverOf(FilledCurve s, CameraSegment c, ScreenSegment p, Ribbon ribbon, bool isWide, float reaches, out vec2 lo, out vec2 hi) {
    const Lens lens = frameLensHere();
    lo = min(vec2(p.xa, p.ya), vec2(p.xb, p.yb)) - 1.0;
    hi = max(vec2(p.xa, p.ya), vec2(p.xb, p.yb)) + 1.0;
    if (isWide && s.isRound != 0u) {
        lo = -vec2(tubeSlope(lens, -c.a.x, c.a.z, c.radiusA, -c.b.x, c.b.z, c.radiusB), tubeSlope(lens, -c.a.y, c.a.z, c.radiusA, -c.b.y, c.b.z, c.radiusB)) * frame.focal + frame.centre - 1.5;
        hi = vec2(tubeSlope(lens, c.a.x, c.a.z, c.radiusA, c.b.x, c.b.z, c.radiusB), tubeSlope(lens, c.a.y, c.a.z, c.radiusA, c.b.y, c.b.z, c.radiusB)) * frame.focal + frame.centre + 0.5;
    } else if (isWide) {
        bool isBefore = true;
        lo = vec2(3.0e38);
        hi = vec2(-3.0e38);
        for (int k = 0; k < 4; ++k) {
            const vec3 corner = ribbonCorner(ribbon, k < 2 ? 0.0 : 1.0, (k & 1) == 0 ? -1.0 : 1.0);
            const vec2 at = corner.xy * (frame.focal / lensDepth(lens, max(corner.z, frame.nearPlane))) + frame.centre;
            isBefore = isBefore && (lens.isOrthographic || corner.z > frame.nearPlane);
            lo = min(lo, at - 1.0);
            hi = max(hi, at + 1.0);
        }
        if (!isBefore) {  // some of it has no place on the picture
            if (reaches < 0.5) return false;
            lo = vec2(0.0);
            hi = vec2(frame.width, frame.height);
        }
    }
    return true;
}

void main() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= stepInfo.count) return;
    const DrawBlock source = blocks[frame.firstBlock.of[kKindCurves] + block];
    const DrawNode node = nodes[source.node];
    const uint index = source.first + gl_LocalInvocationID.x;
    if (index >= node.count) return;
    const CurveSegment segment = Segments(uvec2(node.addressLow, node.addressHigh)).segments[index];
    if (segmentErrorCode(segment) > node.errorCode && (segmentOctants(segment) & node.octantMask) == 0u) return;
    rank = curveRank(segment);
    const CameraSegment c = cameraSegment(node, segment);
    const Lens lens = frameLensHere();
    const ScreenSegment p = projectSegment(c.a, c.b, lens, frame.centre.x, frame.centre.y, frame.nearPlane);
    const float width = float(frame.width);
    const float height = float(frame.height);
    const float reaches = curveReaches(c, lens, frame.centre.x, frame.centre.y, width, height, frame.nearPlane);
    if (max(p.isThere, reaches) < 0.5) return;
    const vec3 t = segmentTangent(c);
    vec3 a = c.a + p.from * (c.b - c.a);
    vec3 b = c.a + p.to * (c.b - c.a);
    a.z = max(a.z, frame.nearPlane);
    b.z = max(b.z, frame.nearPlane);
    FilledCurve s;
    s.xa = p.xa;
    s.ya = p.ya;
    s.xb = p.xb;
    s.yb = p.yb;
    s.inverseA = imageLinear(lens, p.za);
    s.inverseB = imageLinear(lens, p.zb);
    s.halfA = endHalfWidth(c, p.from, c.directionA, lens, frame.nearPlane);
    s.halfB = endHalfWidth(c, p.to, c.directionB, lens, frame.nearPlane);
    const float ra = c.radiusA + p.from * (c.radiusB - c.radiusA);
    const float rb = c.radiusA + p.to * (c.radiusB - c.radiusA);
    s.acrossA = c.directionA;
    s.acrossB = c.directionB;
    s.isRound = c.isRound > 0.5 ? 1u : 0u;
    s.a = c.a;
    s.b = c.b;
    s.radiusA = c.radiusA;
    s.radiusB = c.radiusB;
    const bool isWide = isFilled(c, p, lens, frame.exactCurves) > 0.5;
    const Ribbon ribbon = ribbonOfWide(s);
    vec2 lo;
    vec2 hi;
    if (!coverOf(s, c, p, ribbon, isWide, reaches, lo, hi)) return;
    if (!(hi.x >= 0.0 && hi.y >= 0.0 && lo.x < width && lo.y < height)) return;
    s.nearerA = surfaceStep(lens, a, t, ra, c.isRound);
    s.nearerB = surfaceStep(lens, b, t, rb, c.isRound);
    const vec2 d = vec2(p.xb - p.xa, p.yb - p.ya);
    s.id = block * kSegmentsPerBlock + gl_LocalInvocationID.x;
    if (!isWide) {
        drawLine(s);
        const float across = max(abs(d.x), abs(d.y));
        drawEnd(s.xa, s.ya, s.inverseA, s.halfA, s.nearerA, across, s.id);
        drawEnd(s.xb, s.yb, s.inverseB, s.halfB, s.nearerB, across, s.id);
        return;
    }
    const ivec2 from = ivec2(max(lo, vec2(0.0)));
    const ivec2 to = ivec2(min(hi, vec2(width, height) - 1.0));
    s.box = ivec4(from, to);
    if ((to.x - from.x + 1) * (to.y - from.y + 1) > kMostPixels) {
        uint place;
        TAKE_PLACE(wideCount, place);
        if (place < kWideCapacity) {
            wide[place] = s;
            return;
        }
    }
    for (int y = from.y; y <= to.y; ++y)
        for (int x = from.x; x <= to.x; ++x) offerWide(s, ribbon, x, y);
}
