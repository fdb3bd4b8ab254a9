// What the passes of ambient occlusion share: of each pixel that is asked, twice how much light gets to it.
#extension GL_GOOGLE_include_directive : require
#include "../surface.glsl"
#include "../shared/occlusion.h"
#ifdef ALONG_ROWS
layout(local_size_x = kPixelTile * kPixelTile) in;  // what it reads lies in the row
#else
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;
#endif

layout(set = 0, binding = kOcclusionBinding, scalar) uniform OcclusionBlock { OcclusionConstants occlusion; };
layout(set = 0, binding = kOpenBinding, scalar) buffer OpenBlock { float openness[]; };

ivec2 aoSize() { return (ivec2(frame.width, frame.height) + int(occlusion.edge) - 1) / int(occlusion.edge); }
int aoEntry(ivec2 at) { return at.y * aoSize().x + at.x; }
uint aoPixel(ivec2 at) { return uint(at.y) * occlusion.edge * frame.width + uint(at.x) * occlusion.edge; }
bool aoIsInside(ivec2 at) { return at.x >= 0 && at.y >= 0 && at.x < aoSize().x && at.y < aoSize().y; }
// Its centre, px from the principal point.
vec2 aoCentre(ivec2 at) { return vec2(at) * float(occlusion.edge) + 0.5 - frame.centre; }
float aoDepth(ivec2 at) { return aoIsInside(at) ? max(surfaceBuffer[aoPixel(at)].depth, 0.0) : 0.0; }
