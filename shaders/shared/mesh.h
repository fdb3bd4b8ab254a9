// Triangles of a mesh: vertices on one lattice, clusters of at most 256 triangles, their projection and coverage.
//
// Every vertex of an instance goes through the same integers and the same fp32 operations whatever cluster it stands
// in, so that copies of a vertex land on the same subpixel: clusters, groups and levels of detail join without cracks.
// Coverage is decided in integers (1/256 pixel, top-left rule), so that neighbours share out the pixels between them
// exactly.
#ifndef STIPPLE_SHARED_MESH_H
#define STIPPLE_SHARED_MESH_H
#include "lens.h"
SHARED_BEGIN

struct MeshVertex {
    int x;  // lattice steps
    int y;
    int z;
    uint normal;  // octahedral 16 + 16
    uint colour;  // sRGB 8 + 8 + 8, alpha 8
    float u;
    float v;
    uint surface;  // material 16 | flags
};

const uint kSurfaceMaterialMask = 0xffffu;
const uint kSurfaceTwoSided = 0x10000u;
const uint kSurfaceFlat = 0x20000u;    // no normals of its own: the triangle's
const uint kSurfaceMasked = 0x40000u;  // alpha below the cutoff is cut out
const uint kSurfaceUnlit = 0x80000u;
const uint kSurfaceTextured = 0x100000u;

// A triangle is one word: three indices into the vertices of its cluster, 8 bits each.
struct MeshCluster {
    uint firstVertex;
    uint firstTriangle;
    uint counts;  // vertices | triangles << 16
};

const uint kClusterVertices = 255u;
const uint kClusterTriangles = 256u;

// One instance of a mesh, or of a wide one (coordinates beyond 30 bits) one of its groups. Position of a vertex q in
// camera space: base + axes * (q - eye), `eye` being the lattice point of the mesh nearest to the camera: near it the
// integers are small and exact, far away their rounding is. Of a wide mesh both are counted from the group's origin.
struct DrawMesh {
    vec3 axisX;
    vec3 axisY;
    vec3 axisZ;
    vec3 base;
    vec3 normalX;  // columns: camera-space normal = normalX * n.x + normalY * n.y + normalZ * n.z, not normalised
    vec3 normalY;
    vec3 normalZ;
    int eyeX;
    int eyeY;
    int eyeZ;
    int eyeHighX;  // upper halves, where `places` is not kPlacesShort
    int eyeHighY;
    int eyeHighZ;
    uint places;
    uint firstMaterial;
    float mirror;  // -1 where the instance mirrors, else 1
};

// How far q - eye reaches: 32 bits do; the eye has 64; vertices have 64, too: the second half of a cluster's vertices
// holds the upper halves of the first one's coordinates.
const uint kPlacesShort = 0u;
const uint kPlacesFar = 1u;
const uint kPlacesPaired = 2u;

// One cluster of the frame as the gpu backend sees it: one block of 256 draw ids.
struct DrawCluster {
    uint mesh;         // index of its DrawMesh
    uint counts;       // vertices | triangles << 16
    uint verticesLow;  // device address of its first vertex
    uint verticesHigh;
    uint trianglesLow;  // and of its first triangle
    uint trianglesHigh;
    uint firstTexture;  // of its store's textures
    uint firstTile;     // of its store's tiles
    uint level;
    float errorPixels;
};

SHARED_FN vec3 meshPositionFrom(float qx, float qy, float qz, DrawMesh m) {
    return vec3(m.base.x + (m.axisX.x * qx + (m.axisY.x * qy + m.axisZ.x * qz)),
                m.base.y + (m.axisX.y * qx + (m.axisY.y * qy + m.axisZ.y * qz)),
                m.base.z + (m.axisX.z * qx + (m.axisY.z * qy + m.axisZ.z * qz)));
}

SHARED_FN vec3 meshPosition(int x, int y, int z, DrawMesh m) {
    return meshPositionFrom(float(x - m.eyeX), float(y - m.eyeY), float(z - m.eyeZ), m);
}

// Difference of two integers of 64 bits, below 2^63. One of less than 32 bits is rounded as such an integer is, so that
// copies of a vertex meet whatever their groups' origins.
SHARED_FN float wideDifference(int low, int high, int eyeLow, int eyeHigh) {
    uint l = uint(low) - uint(eyeLow);
    uint h = uint(high) - uint(eyeHigh) - (uint(low) < uint(eyeLow) ? 1u : 0u);
    const bool isNegative = h >= 0x80000000u;
    if (isNegative) {
        l = 0u - l;
        h = ~h + (l == 0u ? 1u : 0u);
    }
    const float size = float(h) * 4294967296.0f + float(l);
    return isNegative ? -size : size;
}
SHARED_FN vec3 meshPositionWide(int x, int y, int z, int highX, int highY, int highZ, DrawMesh m) {
    return meshPositionFrom(wideDifference(x, highX, m.eyeX, m.eyeHighX), wideDifference(y, highY, m.eyeY, m.eyeHighY),
                            wideDifference(z, highZ, m.eyeZ, m.eyeHighZ), m);
}

const float kSubpixel = 256.0f;
// Beyond this many pixels from the image's corner a triangle is clipped, so that 64-bit integers and doubles hold every
// product.
const float kGuardPixels = 65536.0f;
// Support of a triangle's pixel, pixels: it reaches nowhere beyond the pixel that it covers.
const float kTriangleRadius = 0.25f;

SHARED_FN int snapPixel(float p) { return int(floor(p * kSubpixel + 0.5f)); }

// Edge from a to b (y down, triangle on the positive side): left edges go up, top edges are horizontal and go right.
SHARED_FN bool isTopLeft(int dx, int dy) { return (dy == 0 ? -dx : dy) < 0; }

// Where the ray through a pixel meets a triangle: weights of the second and third corner, in [0, 1]. `ray`: direction
// in camera space; a, b, c: corners, counted from its origin (Moeller and Trumbore 1997, solved for the weights alone).
SHARED_FN vec2 triangleWeights(vec3 ray, vec3 a, vec3 b, vec3 c) {
    const vec3 e1 = vec3(b.x - a.x, b.y - a.y, b.z - a.z);
    const vec3 e2 = vec3(c.x - a.x, c.y - a.y, c.z - a.z);
    const vec3 p = vec3(ray.y * e2.z - ray.z * e2.y, ray.z * e2.x - ray.x * e2.z, ray.x * e2.y - ray.y * e2.x);
    const float det = e1.x * p.x + e1.y * p.y + e1.z * p.z;
    const vec3 q = vec3(e1.y * a.z - e1.z * a.y, e1.z * a.x - e1.x * a.z, e1.x * a.y - e1.y * a.x);
    const float inverse = abs(det) > 0.0f ? 1.0f / det : 0.0f;
    const float u = min(max(-(a.x * p.x + a.y * p.y + a.z * p.z) * inverse, 0.0f), 1.0f);
    const float v = min(max((ray.x * q.x + ray.y * q.y + ray.z * q.z) * inverse, 0.0f), 1.0f - u);
    return vec2(u, v);
}

// The same direction, its largest part about 1: products of three of them are floats, whatever units a mesh has
// (edges of 1e-18 to 1e18). By a power of two, so that it rounds nothing.
SHARED_FN float toAboutOne(vec3 v) {
    const uint largest = floatBitsToUint(max(max(abs(v.x), abs(v.y)), abs(v.z))) & 0x7f800000u;
    return uintBitsToFloat(0x7f000000u - (largest < 0x7e800000u ? largest : 0x7e800000u));
}
SHARED_FN vec3 aboutOne(vec3 v) {
    const float inverse = toAboutOne(v);
    return vec3(v.x * inverse, v.y * inverse, v.z * inverse);
}

// Texture coordinates that a pixel covers: the longer of its two edges, on the triangle's plane. `a`: first corner; e1,
// e2: edges to the others; d1, d2: texture coordinates along them.
SHARED_FN float uvFootprint(PixelRay of, float inverseFocal, vec3 anyA, vec3 anyE1, vec3 anyE2, vec2 d1, vec2 d2) {
    const vec3 ray = rayDirection(of);
    // Lengths are counted in edges, as what follows has their fourth powers.
    const float unit = toAboutOne(
        vec3(max(abs(anyE1.x), abs(anyE2.x)), max(abs(anyE1.y), abs(anyE2.y)), max(abs(anyE1.z), abs(anyE2.z))));
    const vec3 a = vec3(anyA.x * unit, anyA.y * unit, anyA.z * unit);
    const vec3 e1 = vec3(anyE1.x * unit, anyE1.y * unit, anyE1.z * unit);
    const vec3 e2 = vec3(anyE2.x * unit, anyE2.y * unit, anyE2.z * unit);
    const vec3 n = vec3(e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x);
    const float na = n.x * a.x + n.y * a.y + n.z * a.z;
    const float nr = n.x * ray.x + n.y * ray.y + n.z * ray.z;
    const float nn = n.x * n.x + n.y * n.y + n.z * n.z;
    // Point on the plane P = ray * na / nr; its change with the ray's x and y.
    const float t = of.isOrthographic ? unit : na / nr;  // (there the origin moves, whatever the depth)
    const float k = -t / nr;
    const vec3 px = vec3((t + k * n.x * ray.x) * inverseFocal, k * n.x * ray.y * inverseFocal, k * n.x * inverseFocal);
    const vec3 py = vec3(k * n.y * ray.x * inverseFocal, (t + k * n.y * ray.y) * inverseFocal, k * n.y * inverseFocal);
    // Weights of a displacement within the plane: u = (p x e2) . n / nn, v = (e1 x p) . n / nn.
    const vec3 ue = vec3(e2.y * n.z - e2.z * n.y, e2.z * n.x - e2.x * n.z, e2.x * n.y - e2.y * n.x);
    const vec3 ve = vec3(n.y * e1.z - n.z * e1.y, n.z * e1.x - n.x * e1.z, n.x * e1.y - n.y * e1.x);
    const float ux = (px.x * ue.x + px.y * ue.y + px.z * ue.z) / nn;
    const float vx = (px.x * ve.x + px.y * ve.y + px.z * ve.z) / nn;
    const float uy = (py.x * ue.x + py.y * ue.y + py.z * ue.z) / nn;
    const float vy = (py.x * ve.x + py.y * ve.y + py.z * ve.z) / nn;
    const float xu = ux * d1.x + vx * d2.x;
    const float xv = ux * d1.y + vx * d2.y;
    const float yu = uy * d1.x + vy * d2.x;
    const float yv = uy * d1.y + vy * d2.y;
    const float longest = max(xu * xu + xv * xv, yu * yu + yv * yv);
    return longest < 1.0e12f ? sqrt(longest) : 1.0e6f;
}

// Normal `n` (any length) bent by a tangent-space normal `m` (x along u, y against v). Tangents are the triangle's own:
// they differ from those that a tool may have stored by what the texture turns within a triangle.
SHARED_FN vec3 bumpedNormal(vec3 anyNormal, vec3 e1, vec3 e2, vec2 d1, vec2 d2, vec3 m) {
    const vec3 n = aboutOne(anyNormal);
    const float det = d1.x * d2.y - d1.y * d2.x;
    const float side = det < 0.0f ? -1.0f : 1.0f;
    vec3 t = aboutOne(vec3(side * (e1.x * d2.y - e2.x * d1.y), side * (e1.y * d2.y - e2.y * d1.y),
                           side * (e1.z * d2.y - e2.z * d1.y)));
    vec3 b = aboutOne(vec3(side * (e1.x * d2.x - e2.x * d1.x), side * (e1.y * d2.x - e2.y * d1.x),
                           side * (e1.z * d2.x - e2.z * d1.x)));
    const float nn = max(n.x * n.x + n.y * n.y + n.z * n.z, 1.0e-30f);
    const float tn = (t.x * n.x + t.y * n.y + t.z * n.z) / nn;
    const float bn = (b.x * n.x + b.y * n.y + b.z * n.z) / nn;
    t = vec3(t.x - tn * n.x, t.y - tn * n.y, t.z - tn * n.z);
    b = vec3(b.x - bn * n.x, b.y - bn * n.y, b.z - bn * n.z);
    const float it = m.x / sqrt(max(t.x * t.x + t.y * t.y + t.z * t.z, 1.0e-30f));
    const float ib = m.y / sqrt(max(b.x * b.x + b.y * b.y + b.z * b.z, 1.0e-30f));
    const float in_ = m.z / sqrt(nn);
    return vec3(t.x * it + b.x * ib + n.x * in_, t.y * it + b.y * ib + n.y * in_, t.z * it + b.z * ib + n.z * in_);
}

// The triangle's own normal on the side of `n`, the interpolated one; any lengths. What simplification folded over in a
// flat surface, and what is too thin to have a direction, is no back of it.
SHARED_FN vec3 faceBeside(vec3 face, vec3 anyNormal) {
    const vec3 f = aboutOne(face), n = aboutOne(anyNormal);
    const float side = f.x * n.x + f.y * n.y + f.z * n.z < 0.0f ? -1.0f : 1.0f;
    return vec3(side * face.x, side * face.y, side * face.z);
}

// Unit normal to shade with, turned towards the eye. `n`: interpolated, `face`: the triangle's own, any lengths; `ray`:
// from the eye. Interpolated normals that just turn away at a silhouette are bent back to it instead of flipped.
SHARED_FN vec3 surfaceNormal(vec3 anyNormal, vec3 anyFace, vec3 ray) {
    const vec3 n = aboutOne(anyNormal), face = aboutOne(anyFace);
    const float side = face.x * ray.x + face.y * ray.y + face.z * ray.z > 0.0f ? -1.0f : 1.0f;
    const float towards =
        max(side * (n.x * ray.x + n.y * ray.y + n.z * ray.z), 0.0f) / (ray.x * ray.x + ray.y * ray.y + ray.z * ray.z);
    const vec3 bent = vec3(side * n.x - towards * ray.x, side * n.y - towards * ray.y, side * n.z - towards * ray.z);
    const float length2 = bent.x * bent.x + bent.y * bent.y + bent.z * bent.z;
    const float inverse = length2 > 0.0f ? 1.0f / sqrt(length2) : 0.0f;
    return vec3(bent.x * inverse, bent.y * inverse, bent.z * inverse);
}

SHARED_END
#endif
