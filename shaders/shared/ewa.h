// Filtered discs (mode ewa; Zwicker et al. 2001; Ren, Pfister & Zwicker 2002): what a Gaussian in a disc's plane looks
// like, widened by a low-pass of about a pixel. The image of the circle of one sigma is an ellipse, exactly; the
// Gaussian with that ellipse is taken for the image of the Gaussian, and the low-pass adds to its variances.
#ifndef STIPPLE_SHARED_EWA_H
#define STIPPLE_SHARED_EWA_H
#include "border.h"
#include "pyramid.h"
#include "splat_disc.h"
#include "surface.h"
#include "visibility.h"
SHARED_BEGIN

// The opaque part of a disc closes the surface: what its radius covers, and, where a coarse record's radius is less
// than what its neighbours leave (s: the node's spacing), 1.03 s. Its kernel has a sigma of that over 1.5: at 0.685 s
// the kernels of a square grid add up to the same everywhere but for 5 % (support of 2 sigma) or 0.3 % (3).
const float kOpaqueSpacings = 1.0275f;
const float kOpaqueSigmas = 1.5f;
// (Of discs of one side only that face the eye are drawn; of two-sided ones a side means nothing: what is nearer than
// this is one surface.) What lies so far behind the front disc still belongs to its surface, in opaque radii (along the
// ray).
const float kSurfaceShare = 1.3333333f;
// Of a disc before another kind's surface: by how much its own must be before that, in what it is rough. Those of a
// border blend with it, too, and do not lose to it.
SHARED_FN float roughSide(uint flags) { return (flags & kFlagBorder) != 0u ? -1.0f : 1.0f; }
// Leaves among leaves are no surface: nothing but what is next to it.
const float kLeafShare = 0.0833333f;
// Weights that add up to less say nothing: the front disc's own attributes are taken.
const float kLeastWeight = 0.0009765625f;

// (But not half as much again as the radius: where samples are denser than elsewhere in their node, so are discs.)
const float kOpaqueRadii = 1.5f;
SHARED_FN float opaqueRadius(float radius, float spacing) {
    return max(radius, min(kOpaqueSpacings * spacing, kOpaqueRadii * radius));
}

// The kernel at rho^2, in sigmas: exp(-rho^2 / 2), moved down so that it ends at 0, where rho is `support` (2 or 3).
// exp as (a polynomial of a 16th)^16: at most 3.5e-6 off.
SHARED_FN float gaussian(float rho2) {
    const float x = min(rho2, 16.0f) * -0.03125f;
    const float p = 1.0f + x * (1.0f + x * (0.5f + x * (0.16666667f + x * 0.041666667f)));
    const float p2 = p * p;
    const float p4 = p2 * p2;
    const float p8 = p4 * p4;
    return p8 * p8;
}
SHARED_FN float kernelEnd(float support) { return gaussian(support * support); }
SHARED_FN float kernelAt(float rho2, float end) { return max(gaussian(rho2) - end, 0.0f) / (1.0f - end); }

// Of a square grid whose sigma is 0.685 of its spacing, one over what weights add up to: 1 / (2 pi 0.685^2 K), where K
// is the share of a Gaussian that the kernel keeps: 1 - (support^2 / 2) end / (1 - end).
SHARED_FN float gridWeight(float support) {
    const float end = kernelEnd(support);
    const float kept = 1.0f - 0.5f * support * support * end / (1.0f - end);
    return 1.0f / (6.2831853f * 0.469225f * kept);
}

// A disc's kernel on the image. rho^2 at (x, y) px from the principal point, with dx = x - this.x and dy = y - this.y:
// dx^2 alongX + (dy - skew dx)^2 alongY.
struct EwaKernel {
    float x;
    float y;
    float alongX;
    float skew;
    float alongY;
    float amplitude;  // of the weights: what the low-pass takes from a disc that is smaller than it
    float halfX;      // all that it reaches, px
    float halfY;
    float isNear;  // 1: not wholly before the eye; rho^2 is that on the disc itself (SEEDS 0.8)
};
// `sigma`: world units; `lowPass`: variance, px^2.
SHARED_FN EwaKernel ewaKernel(WideDisc d, float sigma, float support, float lowPass, Lens lens) {
    EwaKernel k;
    const float lean = lens.isOrthographic ? 0.0f : 1.0f;
    const float inverse = 1.0f / lensDepth(lens, d.centre.z);
    const float a = lean * d.centre.x * inverse;
    const float b = lean * d.centre.y * inverse;
    const vec3 n = d.normal;
    // Of two unit vectors s, t in the plane: s_i s_j + t_i t_j = (i == j) - n_i n_j.
    const float xz = -lean * n.x * n.z;
    const float yz = -lean * n.y * n.z;
    const float zz = lean * max(1.0f - n.z * n.z, 0.0f);
    const float step = support * sigma * inverse;  // the circle's radius at depth 1
    const float step2 = step * step;
    const float ahead = 1.0f - step2 * zz;
    k.isNear = lens.isOrthographic || (d.centre.z > 0.0f && ahead > 0.05f) ? 0.0f : 1.0f;
    const float den = max(ahead, 0.05f);
    const float scale = lens.focal * step;
    const float gx = lens.focal * step2 * (xz - a * zz);
    const float gy = lens.focal * step2 * (yz - b * zz);
    const float gxx = scale * scale * max(1.0f - n.x * n.x - 2.0f * a * xz + a * a * zz, 0.0f);
    const float gyy = scale * scale * max(1.0f - n.y * n.y - 2.0f * b * yz + b * b * zz, 0.0f);
    const float gxy = scale * scale * (-n.x * n.y - a * yz - b * xz + a * b * zz);
    const float over = 1.0f / (support * support * den * den);
    const float xx = (gx * gx + den * gxx) * over;
    const float yy = (gy * gy + den * gyy) * over;
    const float xy = (gx * gy + den * gxy) * over;
    const float facing = lens.isOrthographic ? n.z : a * n.x + b * n.y + n.z;
    const float area = lens.focal * lens.focal * sigma * sigma * inverse * inverse * facing;
    const float det = area * area / (den * den * den);
    const float widened = det + lowPass * (xx + yy) + lowPass * lowPass;
    const float wideX = xx + lowPass;
    k.x = d.centre.x * lens.focal * inverse - gx / den;
    k.y = d.centre.y * lens.focal * inverse - gy / den;
    k.alongX = 1.0f / wideX;
    k.skew = xy / wideX;
    k.alongY = wideX / widened;
    k.amplitude = k.isNear > 0.5f ? 1.0f : sqrt(det / widened);
    k.halfX = support * sqrt(wideX);
    k.halfY = support * sqrt(yy + lowPass);
    return k;
}
SHARED_FN float ewaRho2(EwaKernel k, float x, float y) {
    const float dx = x - k.x;
    const float dy = y - k.y - k.skew * dx;
    return dx * dx * k.alongX + dy * dy * k.alongY;
}

// The amplitude with which a disc is blended: none where its centre lies before the near plane, unless it is about the
// eye, where each pixel decides.
SHARED_FN float blendedAmplitude(WideDisc d, EwaKernel k, float nearPlane) {
    return k.isNear > 0.5f ? 1.0f : (d.centre.z > nearPlane ? k.amplitude : 0.0f);
}

// Between which depths a disc's plane counts: as far as its kernel and the low-pass reach on it. (Planes that face the
// eye by less than kGrazing count as if they did by that.)
struct DepthRange {
    float nearest;
    float farthest;
};
SHARED_FN DepthRange depthRange(WideDisc d, float sigma, float support, float lowPass, Lens lens) {
    const vec3 sight = sightTo(lens, d.centre);
    const float facing = abs(dot(d.normal, sight)) / sqrt(max(dot(sight, sight), 1.0e-37f));
    const float pixel = max(lensDepth(lens, d.centre.z), 0.0f) / lens.focal;
    const float reach = support * (sigma + sqrt(lowPass) * pixel / max(facing, kGrazing));
    const float slab = reach * sqrt(max(1.0f - d.normal.z * d.normal.z, 0.0f));
    DepthRange r;
    r.nearest = max(d.centre.z - slab, 1.0e-3f * abs(d.centre.z) + 1.0e-30f);
    r.farthest = max(d.centre.z + slab, r.nearest);
    return r;
}

// Depth of a disc's plane on a ray, within its range. `rest`: normal . ray direction; `ahead`: normal . (centre from
// the ray's origin). Beyond the horizon of its plane it is as far as it gets.
SHARED_FN float depthWithin(DepthRange range, float ahead, float rest) {
    const float plane = ahead / (abs(rest) > 1.0e-30f ? rest : 1.0e-30f);
    return min(max(plane > 0.0f ? plane : range.farthest, range.nearest), range.farthest);
}

// Where a pixel shows its front disc whose ray misses it (that of its centre): no place beyond the disc. `plane`: depth
// of the disc's plane there.
SHARED_FN float placeOfMissed(WideDisc d, float plane) {
    const float reach = discReach(d);
    return min(max(plane, d.centre.z - reach), d.centre.z + reach);
}
// The depth that a pixel shows: what was blended, but within half a pixel (in space) of its front disc, so that it
// keeps the error that is stated for that. `own`: depth of the front disc; `along`: depth per length along the ray.
SHARED_FN float shownWithin(float blended, float own, float along, Lens lens) {
    const float most = 0.5f * along * lensDepth(lens, own) / lens.focal;
    return min(max(blended, own - most), own + most);
}
// Of a pixel that is less covered a picture says no depth and no normal: its ray meets nothing.
const float kLeastShown = 0.5f;

// What a pixel shows of what was blended there, beside the depth in its key.
struct FilteredPixel {
    uint normal;  // octahedral, camera space, towards the eye
    uint colour;  // packColour
    uint cover;   // what weights add up to, of 255 | flags
};
// On the gpu, a pixel's front and sums.
struct FilteredFront {
    uint64_t key;  // of the front disc, its depth moved back
    uint count;    // of those whose kernels reach the pixel, less one: ~0 is none
    uint first;    // where there is no front: least id of them
    uint nearest;  // and bits of the least of their depths
    uint unused;
};
// The gpu's sums are whole numbers. What 1 is in them: 2^24 where at most 64 kernels reach the pixel, less where more
// do, so that no sum exceeds 2^30 and a half for each of 2^30 kernels that are rounded up.
SHARED_FN float sumUnit(FilteredFront front) {
    const uint count = front.count + 1u;
    float unit = 16777216.0f;
    for (uint most = 64u; most < count && unit > 1.0f; most += most) unit *= 0.5f;
    return unit;
}
struct FilteredSums {
    int weight;
    int depth;
    int red;
    int green;
    int blue;
    int nx;
    int ny;
    int nz;
    int rims;         // weights of what is before the front, as another surface; then kSecondBehind: those of the front
    float nearest;    // depth that it is before of; then kSecondBehind: that behind which the front ends
    uint behind;      // 1: something is opaque behind the front
    float reference;  // depth, which others are told against
    float unit;       // what 1 is (sumUnit)
};
// The same of materials, only in frames that have them.
struct MaterialSums {
    int share;
    int metallic;
    int roughness;
};
const uint kFilteredFront = 256u;  // opaque: else a rim that only coverage shows
const uint kFilteredLeaf = 512u;
// A pixel may show a second surface beside what its key says; both are lit, then mixed.
const uint kSecondNone = 0u;
const uint kSecondBefore = 1u;  // rims of discs before it that are not opaque there
const uint kSecondBehind = 2u;  // discs behind its front, which ends there
const uint kSecondFront = 3u;   // its front itself, which ends there: another kind is behind, and has the key
struct SecondSurface {
    SurfaceWords shown;
    float share;  // of the pixel
};
// On the gpu it lies in the place of the pixel's sums, which are done with by then.
SHARED_FN FilteredSums sumsOfSecond(SecondSurface second) {
    FilteredSums s;
    s.weight = s.depth = s.red = s.green = s.blue = s.rims = 0;
    s.nx = int(second.shown.normal);
    s.ny = int(second.shown.albedo);
    s.nz = int(second.shown.material);
    s.nearest = second.share;
    s.behind = 0u;
    s.reference = second.shown.depth;
    s.unit = 0.0f;
    return s;
}
SHARED_FN SecondSurface secondOfSums(FilteredSums s) {
    SecondSurface second;
    second.shown.depth = s.reference;
    second.shown.normal = uint(s.nx);
    second.shown.albedo = uint(s.ny);
    second.shown.material = uint(s.nz);
    second.share = s.nearest;
    return second;
}
const uint kSecondShift = 8u;  // of coverage
// One that is less of a pixel than this is left out: at most a 64th of the contrast.
const float kLeastShare = 0.015625f;
const uint kFilteredMaterial = 1024u;  // of a material, which is the upper half
SHARED_FN uint coverOfMaterial(TexelSurface s) {
    const uint word = surfaceWord(s);
    return (word & kPixelMaterial) != 0u ? kFilteredMaterial | (word & 0xffffu) << 16 : 0u;
}

SHARED_END
#endif
