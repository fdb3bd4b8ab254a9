// The picture's pixels, over the background. LIT: with the light on them, which reads nothing but its own pixel;
// SHADOWED, too: past shadow
// maps; REFRACTED: with that of a layer of glass. FOG, TONE: what becomes of what surfaces send.
#if defined(LIT)
#include "../light.glsl"
#elif defined(REFRACTED)
#include "../glass.glsl"
#else
#include "../surface.glsl"
#endif
#include "../shared/ewa.h"
layout(set = 0, binding = kCoverageBinding, scalar) readonly buffer CoverageBlock { uint coverage[]; };
layout(set = 0, binding = kSumsBinding, scalar) readonly buffer SumBlock { FilteredSums sums[]; };  // and second surfaces
#ifdef FOG
#include "../shared/fog.h"
layout(set = 0, binding = kFogBinding, scalar) uniform FogBlock { FogConstants fog; };
#endif
#ifdef TONE
#include "../shared/tone.h"
layout(set = 0, binding = kToneBinding, scalar) uniform ToneBlock { ToneConstants tone; };
#endif
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

#ifdef LIT
// What light adds of the picture's mirror images (../reflection), two halves a word.
vec3 mirroredAt(uint at) {
    if (stepInfo.hasMirrored == 0u) return vec3(0.0);
    const uint plane = frame.width * frame.height;
    return vec3(unpackHalf2x16(texels[at + 3u * plane]), unpackHalf2x16(texels[at + 4u * plane]).x);
}
#endif

// What is behind everything at a pixel (../background).
vec3 behindAll(uint at) {
    if (stepInfo.hasBackground == 0u) return frame.background;
    const uint plane = frame.width * frame.height;
    return vec3(uintBitsToFloat(texels[at]), uintBitsToFloat(texels[at + plane]), uintBitsToFloat(texels[at + 2u * plane]));
}

// From what a surface sends to what arrives, and to what a screen is sent.
vec3 arriving(vec3 colour, float depth, uvec2 pixel) {
#ifdef FOG
    const float path = fogPath(fog, pixelRayHere(pixel), depth);
    const vec3 lost = vec3(fade(fog.density.x * path), fade(fog.density.y * path), fade(fog.density.z * path));
    colour += lost * (fog.colour - colour);
#endif
#ifdef TONE
    colour = vec3(toned(tone, colour.x), toned(tone, colour.y), toned(tone, colour.z));
#endif
    return colour;
}

// A second surface is lit on its own, and has its share of what the pixel sends; where it is the front, depth and normal
// are its own.
void mixSecond(uint kind, SecondSurface second, uvec2 pixel, inout SurfaceWords s, inout vec3 colour, inout vec3 normal) {
    const vec3 n = octDecode(second.shown.normal);
    vec3 c = vec3(unpackRed(second.shown.albedo), unpackGreen(second.shown.albedo), unpackBlue(second.shown.albedo));
#ifdef LIT
    c = litColour(second.shown, c, n, pixel);
#endif
#ifdef REFRACTED
    c = glassColour(second.shown, c, n, pixel);
#endif
    if (frame.debugView != kDebugHoles && frame.debugView != kDebugNormals) colour += second.share * (c - colour);
    if (kind != kSecondFront) return;
    s.depth = second.shown.depth;
    normal = n;
    if (frame.debugView == kDebugNormals) colour = vec3(0.5 + 0.5 * n.x, 0.5 - 0.5 * n.y, 0.5 - 0.5 * n.z);
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    SurfaceWords s = surfaceBuffer[at];
    const bool valid = s.depth > 0.0;
    vec3 colour = vec3(0.0);
    vec3 n = vec3(0.0);
    if (valid) {
        n = octDecode(s.normal);
        colour = vec3(unpackRed(s.albedo), unpackGreen(s.albedo), unpackBlue(s.albedo));
#ifdef LIT
        colour = litColour(s, colour, n, pixel) + mirroredAt(at);
#endif
#ifdef REFRACTED
        colour = glassColour(s, colour, n, pixel);
#endif
    }
    float share = valid ? 1.0 : 0.0;
    const uint kind = valid && stepInfo.hasFiltered != 0u ? coverage[at] >> kSecondShift : kSecondNone;
    if (kind != kSecondNone) mixSecond(kind, secondOfSums(sums[at]), pixel, s, colour, n);
    if (valid) colour = arriving(colour, s.depth, pixel);
    if (valid && stepInfo.hasFiltered != 0u) share = float(coverage[at] & 255u) / 255.0;
    // What rays meet: of a pixel that is hardly covered nothing. (What it shows through does not matter.)
    const bool isMet = valid && share >= kLeastShown;
    share *= wordOpacity(s.material);
    if (!valid) {
        colour = behindAll(at);
    } else if (share < 1.0 || stepInfo.hasFiltered != 0u) {
        const vec3 behind = behindAll(at);
        colour = behind + share * (colour - behind);
    }
    const vec3 c = clamp(colour, 0.0, 1.0);
    const uvec3 bytes = uvec3(vec3(srgbFromLinear(c.x), srgbFromLinear(c.y), srgbFromLinear(c.z)) * 255.0 + 0.5);
    image[at] = bytes.x | bytes.y << 8 | bytes.z << 16 | uint(share * 255.0 + 0.5) << 24;
    if (stepInfo.wantExtra == 0u) return;
    const vec3 world = isMet ? frame.viewX * n.x + frame.viewY * n.y + frame.viewZ * n.z : vec3(0.0);
    const uint pixels = frame.width * frame.height, normals = pixels + 3u * at, linears = 4u * pixels + 3u * at;
    extra[at] = isMet ? s.depth : 0.0;
    extra[normals] = world.x;
    extra[normals + 1u] = world.y;
    extra[normals + 2u] = world.z;
    extra[linears] = colour.x;
    extra[linears + 1u] = colour.y;
    extra[linears + 2u] = colour.z;
}
