// Pixels that show triangles, after resolve: attributes where the ray meets the triangle, into level 0 and the surface
// words. All other pixels get surface words of 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../mesh.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

uint byteOf(float v) { return uint(clamp(v, 0.0, 1.0) * 255.0 + 0.5); }

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint place = pixel.y * frame.width + pixel.x;
    const uint64_t key = visibility[place];
    const bool isTriangle = keyKind(key, frame.firstBlock) == kKindTriangles;
    if (!isTriangle) {
        triangleWords[2u * place] = 0u;
        return;
    }
    const uint id = keyPlace(key, frame.firstBlock.of[kKindTriangles]);
    const DrawCluster c = clusters[id / kClusterTriangles];
    const DrawMesh m = meshes[c.mesh];
    const uint word = Words(uvec2(c.trianglesLow, c.trianglesHigh)).words[id % kClusterTriangles];
    Vertices vertices = Vertices(uvec2(c.verticesLow, c.verticesHigh));
    const MeshVertex va = vertices.vertices[word & 255u];
    const MeshVertex vb = vertices.vertices[word >> 8 & 255u];
    const MeshVertex vc = vertices.vertices[word >> 16 & 255u];
    const PixelRay pixelsRay = pixelRayHere(pixel);
    const vec3 ray = rayDirection(pixelsRay);
    const vec3 p0 = placeOf(c, m, word & 255u);
    const vec3 p1 = placeOf(c, m, word >> 8 & 255u);
    const vec3 p2 = placeOf(c, m, word >> 16 & 255u);
    const vec2 w = triangleWeights(ray, fromRay(pixelsRay, p0), fromRay(pixelsRay, p1), fromRay(pixelsRay, p2));
    const float a = 1.0 - w.x - w.y;
    const vec3 n = a * octDecode(va.normal) + w.x * octDecode(vb.normal) + w.y * octDecode(vc.normal);
    vec3 normal = m.normalX * n.x + m.normalY * n.y + m.normalZ * n.z;
    const vec3 e1 = p1 - p0;
    const vec3 e2 = p2 - p0;
    vec3 face = cross(e1, e2);
    if ((va.surface & kSurfaceFlat) != 0u) normal = face;
    face = faceBeside(face, normal);
    const SurfaceMaterial material = materials[m.firstMaterial + (va.surface & kSurfaceMaterialMask)];
    vec3 colour = material.baseColour;
    vec3 emissive = material.emissive;
    float metallic = material.metallic;
    float roughness = material.roughness;
    float occlusion = 1.0;
    float opacity = material.alpha * (a * float(va.colour >> 24) + w.x * float(vb.colour >> 24) + w.y * float(vc.colour >> 24)) / 255.0;
    colour *= a * decodeTexel(va.colour, true).xyz + w.x * decodeTexel(vb.colour, true).xyz + w.y * decodeTexel(vc.colour, true).xyz;
    if ((va.surface & kSurfaceTextured) != 0u) {
        const vec2 uv = vec2(a * va.u + w.x * vb.u + w.y * vc.u, a * va.v + w.x * vb.v + w.y * vc.v);
        const vec2 d1 = vec2(vb.u - va.u, vb.v - va.v);
        const vec2 d2 = vec2(vc.u - va.u, vc.v - va.v);
        const float footprint = uvFootprint(pixelsRay, 1.0 / frame.focal, p0, e1, e2, d1, d2);
        vec4 s;
        if (sampleTexture(c, material.baseTexture, uv, footprint, s)) {
            colour *= s.xyz;
            opacity *= s.w;
        }
        if (sampleTexture(c, material.surfaceTexture, uv, footprint, s)) {
            roughness *= s.y;
            metallic *= s.z;
        }
        if (sampleTexture(c, material.occlusionTexture, uv, footprint, s)) occlusion = 1.0 + material.occlusionStrength * (s.x - 1.0);
        if (sampleTexture(c, material.emissiveTexture, uv, footprint, s)) emissive *= s.xyz;
        if (sampleTexture(c, material.normalTexture, uv, footprint, s))
            normal = bumpedNormal(normal, e1, e2, d1, d2, vec3((2.0 * s.xy - 1.0) * material.normalScale, 2.0 * s.z - 1.0));
    }
    if (material.optics == kPixelBlends) occlusion = opacity;
    normal = surfaceNormal(normal, face, ray);
    Texel t;
    t.depth = keyDepth(key);
    t.radius = kTriangleRadius;
    t.thickness = kTriangleRadius;
    t.offset = vec2(0.0);
    t.normalPerp = perpFromNormal(normal, normalize(ray));
    t.colour = colour;
    t.surface = noSurface();
    if (frame.debugView == kDebugLevel) t.colour = debugLevelColour(c.level);
    if (frame.debugView == kDebugError) t.colour = debugErrorColour(c.errorPixels);
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
    triangleWords[2u * place] = kPixelTriangle | material.optics | ((va.surface & kSurfaceUnlit) != 0u ? kPixelUnlit : 0u) | byteOf(metallic) |
                           byteOf(roughness) << 8 | byteOf(occlusion) << 16;
    triangleWords[2u * place + 1u] = packColour(emissive.x, emissive.y, emissive.z);
}
