// What light adds to each pixel of the picture's mirror images, into the fourth and fifth plane of the texels. SHADOWED:
// what is met is lit past shadow maps.
#extension GL_GOOGLE_include_directive : require
#include "../light.glsl"
#include "../shared/reflection.h"
layout(set = 0, binding = kReflectionBinding, scalar) uniform ReflectionBlock { ReflectionConstants reflection; };
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

vec2 pictureSize() { return vec2(float(frame.width), float(frame.height)); }
uint entryAt(int x, int y) { return uint(y) * frame.width + uint(x); }
float depthAt(float x, float y) {
    const vec2 size = pictureSize();
    return surfaceBuffer[entryAt(mirrorPixel(x, size.x), mirrorPixel(y, size.y))].depth;
}
vec3 normalAt(float x, float y) {
    const vec2 size = pictureSize();
    return octDecode(surfaceBuffer[entryAt(mirrorPixel(x, size.x), mirrorPixel(y, size.y))].normal);
}
vec3 placeAt(float x, float y, float depth) {
    return alongRay(pixelRay(frameLensHere(), (x - frame.centre.x) / frame.focal, (y - frame.centre.y) / frame.focal), depth);
}

// What four pixels about a place send, less what would be seen without them.
vec3 lightMet(float x, float y, vec3 direction, vec3 surroundings) {
    vec3 sum = vec3(0.0);
    float counted = 0.0;
    for (uint k = 0u; k < 4u; ++k) {
        const MirrorTap tap = mirrorTap(pictureSize(), x, y, k);
        const SurfaceWords s = surfaceBuffer[entryAt(tap.x, tap.y)];
        const vec3 n = octDecode(s.normal);
        if (s.depth > 0.0 && dot(n, direction) >= 0.0) continue;
        counted += tap.share;
        if (!(s.depth > 0.0)) continue;
        const vec3 colour = vec3(unpackRed(s.albedo), unpackGreen(s.albedo), unpackBlue(s.albedo));
        sum += tap.share * (litColour(s, colour, n, uvec2(tap.x, tap.y)) - surroundings);
    }
    return sum / max(counted, kMirrorCounted);
}

// How far behind what is seen there the ray is at a share of its way.
float behindAt(MirrorRay m, float share) {
    const float z = mirrorDepth(frameLensHere(), m.linear, m.dLinear, share);
    return mirrorBehind(z, depthAt(m.x + share * m.dx, m.y + share * m.dy));
}
// The share of the way at which step number k goes behind.
float narrowed(MirrorRay m, float k) {
    float low = (k - 1.0) / m.steps, high = k / m.steps;
    for (uint h = 0u; h < kMirrorHalvings; ++h) {
        const float share = 0.5 * (low + high);
        if (behindAt(m, share) > 0.0)
            high = share;
        else
            low = share;
    }
    return high;
}

// How far behind what is seen there the ray is, of what that may be.
float offAt(MirrorRay m, float share) {
    const Lens lens = frameLensHere();
    const vec2 size = pictureSize();
    const int column = mirrorPixel(m.x + share * m.dx, size.x), line = mirrorPixel(m.y + share * m.dy, size.y);
    const SurfaceWords s = surfaceBuffer[entryAt(column, line)];
    const vec3 toEye = -normalize(rayDirection(pixelRayHere(uvec2(column, line))));
    const float on = share + kMirrorAhead * m.onePixel;
    return mirrorOff(lens, mirrorDepth(lens, m.linear, m.dLinear, share),
                     mirrorDepth(lens, m.linear, m.dLinear, share - m.onePixel), s.depth, abs(dot(octDecode(s.normal), toEye)),
                     depthAt(m.x + on * m.dx, m.y + on * m.dy));
}

vec3 mirrored(uvec2 pixel) {
    const SurfaceWords words = surfaceBuffer[pixel.y * frame.width + pixel.x];
    if (!(words.depth > 0.0) || !isMirror(words.material, frame.shade)) return vec3(0.0);
    const Lens lens = frameLensHere();
    const PixelRay ray = pixelRayHere(pixel);
    const vec3 place = alongRay(ray, words.depth);
    Surface s;
    s.colour = vec3(unpackRed(words.albedo), unpackGreen(words.albedo), unpackBlue(words.albedo));
    s.normal = octDecode(words.normal);
    s.toEye = -normalize(rayDirection(ray));
    s.metallic = float(words.material & 255u) / 255.0;
    s.roughness = float(words.material >> 8 & 255u) / 255.0;
    s.occlusion = wordOcclusion(words.material);
    s.leaf = 0.0;
    s.dielectric = vec3(kDielectric);
    const MirrorRay m = mirrorRay(reflection, lens, frame.centre, pictureSize(), place, s.normal, s.toEye, s.roughness);
    if (!(m.share > 0.0)) return vec3(0.0);
    float high = 0.0, off = 0.0;
    bool isInFront = true, isFound = false;
    uint tries = 0u;
    for (float k = 1.0; k <= m.steps && !isFound && tries < kMirrorTries; k += 1.0) {
        const float share = k / m.steps;
        const bool isBehind = behindAt(m, share) > 0.0;
        if (isInFront && isBehind) {
            high = narrowed(m, k);
            off = offAt(m, high);
            isFound = mirrorMeets(off, normalAt(m.x + high * m.dx, m.y + high * m.dy), m.direction);
            ++tries;
        }
        isInFront = !isBehind;
    }
    if (!isFound) return vec3(0.0);
    const float x = m.x + high * m.dx, y = m.y + high * m.dy, z = mirrorDepth(lens, m.linear, m.dLinear, high);
    const float share = m.share * mirrorPassed(float(int(tries) - 1)) *
                        mirrorHit(reflection, pictureSize(), m.direction, normalAt(x, y), x, y, off, distance(placeAt(x, y, z), place));
    if (!(share > 0.0)) return vec3(0.0);
    return mirrorAdded(s, share * lightMet(x, y, m.direction, mirrorSurroundings(frame, s, m.direction)));
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x, plane = frame.width * frame.height;
    const vec3 added = clamp(mirrored(pixel), -6.0e4, 6.0e4);
    texels[at + 3u * plane] = packHalf2x16(added.xy);
    texels[at + 4u * plane] = packHalf2x16(vec2(added.z, 0.0));
}
