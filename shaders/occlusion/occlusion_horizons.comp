// Two slices of each pixel that is asked, both sides.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "occlusion.glsl"

float hiddenAlong(AoPlace a, AoSide side, ivec2 at, vec2 direction, float start) {
    for (uint step = 0u; step < kAoSteps; ++step) {
        const float far = aoStep(step, start) * a.pixels / float(occlusion.edge);
        const ivec2 to = ivec2(floor(vec2(at) + 0.5 + direction * far));
        const float z = aoDepth(to);
        const vec2 p = aoCentre(to) / frame.focal;
        side = aoRaised(side, a, alongRay(pixelRay(frameLensHere(), p.x, p.y), z), z > 0.0 ? 1.0 : 0.0);
    }
    return side.hidden;
}

void main() {
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (!aoIsInside(at)) return;
    const float z = aoDepth(at);
    float open = 1.0;
    if (z > 0.0) {
        const uint number = aoNumber(uint(at.x) & 3u, uint(at.y) & 3u);
        const float angle = aoAngle(number), start = aoStart(number);
        const vec2 p = aoCentre(at), along = vec2(cos(angle), sin(angle)), aside = vec2(-along.y, along.x);
        const AoPlace a = aoPlace(frameLensHere(), p.x, p.y, z, octDecode(surfaceBuffer[aoPixel(at)].normal), occlusion.radius);
        const AoSide s = aoSide(a, along.x, along.y), t = aoSide(a, aside.x, aside.y);
        const float hidden = hiddenAlong(a, s, at, along, start) + hiddenAlong(a, aoBack(s), at, -along, start) + hiddenAlong(a, t, at, aside, start) + hiddenAlong(a, aoBack(t), at, -aside, start);
        open = 1.0 - 0.5 * a.share * hidden;
    }
    openness[aoEntry(at)] = open;
}
