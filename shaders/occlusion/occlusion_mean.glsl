// The mean over the pattern along one axis, within the surface. DOWN: from the second half of the plane back to the
// first; else across, the other way.
#include "occlusion.glsl"

void main() {
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (!aoIsInside(at)) return;
    const int count = aoSize().x * aoSize().y;
    const Lens lens = frameLensHere();
    const float z = aoDepth(at);
    float mean = 1.0;
    if (z > 0.0) {
        const vec2 p = aoCentre(at);
        const vec2 slopes = aoSlope(lens, p.x, p.y, octDecode(surfaceBuffer[aoPixel(at)].normal)) * float(occlusion.edge);
        const float tolerance = aoTolerance(lens, z, occlusion.radius);
        float sum = 0.0, weights = 0.0;
        for (int k = -kAoReach; k <= kAoReach; ++k) {
#ifdef DOWN
            const ivec2 to = at + ivec2(0, k);
            const float slope = slopes.y;
            const int from = count;
#else
            const ivec2 to = at + ivec2(k, 0);
            const float slope = slopes.x;
            const int from = 0;
#endif
            if (!aoIsInside(to)) continue;
            const float w = aoShare(k) * aoWeight(lens, z, aoDepth(to), float(k) * slope, tolerance);
            sum += w * openness[from + aoEntry(to)];
            weights += w;
        }
        mean = weights > 0.0 ? sum / weights : 1.0;
    }
#ifdef DOWN
    openness[aoEntry(at)] = mean;
#else
    openness[count + aoEntry(at)] = mean;
#endif
}
