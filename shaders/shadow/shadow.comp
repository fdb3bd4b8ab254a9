// Masks: what of each light that casts shadows comes to a pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../shadow.glsl"
layout(set = 0, binding = kShadowMaskBinding, scalar) writeonly buffer ShadowMaskBlock { uint shadowMask[]; };
layout(local_size_x = 64) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const SurfaceWords s = surfaceBuffer[at];
    if (!(s.depth > 0.0)) return;
    const vec3 normal = octDecode(s.normal);
    const vec3 point = alongRay(pixelRayHere(pixel), s.depth);
    for (uint slot = 0u; slot < frame.shadowSlots; ++slot) shadowMask[slot * frame.width * frame.height + at] = packLight(lightOfSlot(slot, point, normal));
}
