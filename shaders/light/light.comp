// Pixels that show triangles, and lit points where the scene has lights of its own: their light instead of what shade
// made of them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../mesh.glsl"
layout(local_size_x = 64) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height || frame.debugView != kDebugNone) return;
    const uint place = pixel.y * frame.width + pixel.x;
    uint word = stepInfo.count != 0u ? surfaces[2u * place] : 0u;
    Texel own = loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, int(pixel.x), int(pixel.y));
    uint e = word != 0u ? surfaces[2u * place + 1u] : 0u;
    if (stepInfo.hasPyramid != 0u) {
        const Texel pushed = pushedTexel(ivec2(pixel), own);
        if (pushed.depth != own.depth) word = 0u;  // a splat stands in front
        own = pushed;
    }
    own = finished(own);
    if (word == 0u) {
        const bool hasLights = frame.lightCount > 0u || frame.hasEnvironment != 0u;
        if (own.depth <= 0.0 || !hasLights || (frame.shade & kShadeLit) == 0u) return;
        word = kPlainSurface;
        e = 0u;
    }
    vec3 colour = own.colour;
    if ((word & kPixelUnlit) == 0u && (word == kPlainSurface || (frame.shade & kShadeTriangles) != 0u)) {
        const vec3 ray = rayThrough(pixel);
        const vec3 v = normalize(ray);
        const vec3 point = alongRay(pixelRayHere(pixel), depthAt(own, pixel));
        Surface s;
        s.colour = own.colour;
        s.normal = normalAt(own, pixel);
        s.toEye = -v;
        s.metallic = float(word & 255u) / 255.0;
        s.roughness = float(word >> 8 & 255u) / 255.0;
        s.occlusion = float(word >> 16 & 255u) / 255.0;
        s.leaf = letsLightThrough(own.thickness, own.radius, own.isRound, own.axis.x);
        if (frame.hasEnvironment != 0u)
            colour = frame.ambient * reflectEnvironment(s, frame.environmentX, frame.environmentY, frame.environmentZ);
        else
            colour = frame.ambient * reflectSky(s, frame.skyDirection);
        if (frame.lightCount == 0u && frame.hasEnvironment == 0u) colour += reflectLight(s, frame.sunDirection, vec3(0.75));
        for (uint k = 0u; k < frame.lightCount; ++k) {
            const LightSource light = lights[k];
            const vec3 l = light.kind == kLightDirectional ? light.position : light.position - point;
            colour += reflectLight(s, normalize(l), light.colour * lightAt(light, point, point.z));
        }
        colour += vec3(unpackRed(e), unpackGreen(e), unpackBlue(e));
    }
    const vec3 c = clamp(colour, 0.0, 1.0);
    const uvec3 bytes = uvec3(vec3(srgbFromLinear(c.x), srgbFromLinear(c.y), srgbFromLinear(c.z)) * 255.0 + 0.5);
    image[place] = bytes.x | bytes.y << 8 | bytes.z << 16 | 0xff000000u;
    if (stepInfo.wantExtra == 0u) return;
    extra[7u * place + 4u] = colour.x;
    extra[7u * place + 5u] = colour.y;
    extra[7u * place + 6u] = colour.z;
}
