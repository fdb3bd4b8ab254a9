// The light behind each pixel that is not covered, into the first three planes of the texels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../surface.glsl"
#include "../shared/background.h"
layout(set = 0, binding = kBackgroundBinding, scalar) uniform BackgroundBlock { BackgroundConstants background; };
layout(set = 0, binding = kBackdropBinding, scalar) readonly buffer BackdropBlock { uint backdrop[]; };
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

vec3 lightAt(uint level, vec2 place) {
    const BackdropTaps t = backdropTaps(background.first[level], backdropSize(background.width, level), backdropSize(background.height, level), place);
    return mixTaps(t, backdropLight(backdrop[t.at00]), backdropLight(backdrop[t.at10]), backdropLight(backdrop[t.at01]), backdropLight(backdrop[t.at11]));
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const SurfaceWords s = surfaceBuffer[at];
    if (s.depth > 0.0 && stepInfo.hasFiltered == 0u && wordOpacity(s.material) == 1.0) return;
    const vec3 ray = rayDirection(pixelRayHere(pixel));
    const float level = backdropLevel(background, dot(ray, ray));
    const uint fine = uint(level), coarse = min(fine + 1u, background.levels - 1u);
    const vec2 place = backdropPlace(backdropDirection(background, ray));
    const vec3 c = backdropShown(background, lightAt(fine, place), lightAt(coarse, place), level - float(fine));
    const uint plane = frame.width * frame.height;
    texels[at] = floatBitsToUint(c.x);
    texels[at + plane] = floatBitsToUint(c.y);
    texels[at + 2u * plane] = floatBitsToUint(c.z);
}
