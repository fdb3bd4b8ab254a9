// Discs blended by their kernels: fronts, sums and what pixels show of them. Sums are integers (sumUnit): they are the
// same whatever the order in which threads come.
#extension GL_GOOGLE_include_directive : require
#include "discs.glsl"
#include "shared/surfel_weight.h"

layout(set = 0, binding = kFrontsBinding, scalar) buffer FrontBlock { FilteredFront fronts[]; };
layout(set = 0, binding = kSumsBinding, scalar) buffer SumBlock { FilteredSums sums[]; };
layout(set = 0, binding = kMaterialSumsBinding, scalar) buffer MaterialBlock { MaterialSums materialSums[]; };
layout(set = 0, binding = kFilteredBinding, scalar) buffer FilteredBlock { FilteredPixel filtered[]; };
layout(set = 0, binding = kCoverageBinding, scalar) buffer CoverageBlock { uint coverage[]; };  // and which kind of second surface

PointRecord recordOf(uint id, out DrawNode node) {
    const DrawBlock source = blocks[id / kBlockLanes];
    node = nodes[source.node];
    return Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + id % kBlockLanes];
}

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer WeightWords { uint words[]; };
// By how much a surfel counts.
float scaleOf(uint id, DrawNode node) {
    if (frame.perSurfel == 0u) return 1.0;
    uint code = 0u;
    if (node.weights != 0u) {
        const uint at = node.weights * 16u + blocks[id / kBlockLanes].first + id % kBlockLanes;  // bytes, behind the records
        code = WeightWords(uvec2(node.addressLow, node.addressHigh)).words[at >> 2] >> (at & 3u) * 8u & 255u;
    }
    return surfelScale(code, frame.kernelSupport);
}

TexelSurface surfaceOf(uint id, DrawNode node) {
    return surfaceOfPoint(frame.hasMaterials != 0u ? materialOf(node, blocks[id / kBlockLanes].first + id % kBlockLanes) : kPlainPoint);
}

// A disc with its opaque radius.
WideDisc opaqueDisc(DrawNode node, PointRecord r, uint id) {
    WideDisc d = wideDisc(node, r, frame.supportScale, id, frameLensHere());
    const float cap = (recordFlags(r) & kFlagScattered) != 0u ? max(lensDepth(frameLensHere(), d.centre.z), 0.0) * largestSplat(kFlagScattered, frame.focal, frame.height) : 3.0e38;
    d.radius = min(opaqueRadius(d.radius, node.spacing), cap);
    return d;
}
float roughness(WideDisc d, PointRecord r) { return d.radius * ((recordFlags(r) & kFlagLeaf) != 0u ? kLeafShare : kSurfaceShare); }
vec3 towardsEye(WideDisc d) { return dot(d.normal, sightTo(frameLensHere(), d.centre)) > 0.0 ? -d.normal : d.normal; }

// The pixels that a disc may matter at: those of its opaque part, its kernel and its centre.
struct PixelBox {
    ivec2 first;
    ivec2 last;
};
PixelBox boxOf(WideDisc d, EwaKernel k) {
    const ivec2 most = ivec2(frame.width, frame.height) - 1;
    PixelBox b;
    b.first = ivec2(0);
    b.last = most;
    if (k.isNear < 0.5) {
        const vec2 middle = vec2(k.x, k.y) + frame.centre;
        const vec2 reach = vec2(k.halfX, k.halfY) + 1.0;
        b.first = ivec2(clamp(floor(middle - reach), vec2(0.0), vec2(most) + 1.0));
        b.last = ivec2(clamp(floor(middle + reach), vec2(-1.0), vec2(most)));
    }
    return b;
}

struct RayOnDisc {
    float depth;   // of the plane, within its range
    float isMet;   // 1: the opaque part is
    float rho2;    // of the kernel
    float along;   // depth per length along the ray
};
RayOnDisc rayOnDisc(WideDisc d, EwaKernel k, DepthRange range, ivec2 pixel) {
    const vec2 at = vec2(pixel) + 0.5 - frame.centre;
    const PixelRay ray = pixelRay(frameLensHere(), at.x / frame.focal, at.y / frame.focal);
    const vec3 direction = rayDirection(ray);
    const DiscHit hit = discHit(d, ray, frame.nearPlane);
    RayOnDisc r;
    r.depth = depthWithin(range, dot(d.normal, fromRay(ray, d.centre)), dot(d.normal, direction));
    r.isMet = hit.depth < kNoDisc ? 1.0 : 0.0;
    const float onDisc = hit.rho2 < kNoDisc ? hit.rho2 * kOpaqueSigmas * kOpaqueSigmas : kNoDisc;
    r.rho2 = k.isNear > 0.5 ? onDisc : ewaRho2(k, at.x, at.y);
    r.along = 1.0 / length(direction);
    return r;
}

// A kernel does not reach a pixel, and then nor does the opaque part, whose circle is the smaller one.
bool isBeyond(EwaKernel k, ivec2 pixel) {
    const vec2 at = vec2(pixel) + 0.5 - frame.centre;
    return k.isNear < 0.5 && ewaRho2(k, at.x, at.y) >= frame.kernelSupport * frame.kernelSupport;
}

// Offers a disc to the front of a pixel.
void offerFront(WideDisc d, float rough, EwaKernel k, DepthRange range, ivec2 pixel, bool isCentre) {
    if (!isCentre && isBeyond(k, pixel)) return;
    const RayOnDisc r = rayOnDisc(d, k, range, pixel);
    const uint at = uint(pixel.y) * frame.width + uint(pixel.x);
    const bool isOpaque = r.isMet > 0.5 || isCentre;
    if (isOpaque) {
        const uint64_t key = visibilityKey(floatBitsToUint(r.depth + rough * r.along), drawId(0u, d.id));
        if (mayWin(key, fronts[at].key)) atomicMin(fronts[at].key, key);
    }
    if (isCentre || !(r.rho2 < frame.kernelSupport * frame.kernelSupport && blendedAmplitude(d, k, frame.nearPlane) > 0.0)) return;
    atomicAdd(fronts[at].count, 1u);
    if (isOpaque) return;
    // (As keys, they only fall.)
    const uint depth = floatBitsToUint(r.depth);
    if (d.id < fronts[at].first) atomicMin(fronts[at].first, d.id);
    if (depth < fronts[at].nearest) atomicMin(fronts[at].nearest, depth);
}

int unitsOf(float v) { return int(floor(v + 0.5)); }
// How much deeper than the reference, from -1 to 1: in perspective of its inverse, orthographic in 512ths of its pixels.
float relativeDepth(float depth, float reference) {
    const float far = frame.orthographic != 0u ? (depth - reference) * frame.focal * 0.001953125 : reference / depth - 1.0;
    return clamp(far, -1.0, 1.0);
}
float absoluteDepth(float relative, float reference) {
    return frame.orthographic != 0u ? reference + relative * 512.0 / frame.focal : reference / (1.0 + relative);
}

// Adds a weight to the sums of a pixel.
void addSums(uint at, float w, float depth, vec3 colour, vec3 n, TexelSurface surface) {
    atomicAdd(sums[at].weight, unitsOf(w));
    atomicAdd(sums[at].depth, unitsOf(w * relativeDepth(depth, sums[at].reference)));
    atomicAdd(sums[at].red, unitsOf(w * colour.x));
    atomicAdd(sums[at].green, unitsOf(w * colour.y));
    atomicAdd(sums[at].blue, unitsOf(w * colour.z));
    atomicAdd(sums[at].nx, unitsOf(w * n.x));
    atomicAdd(sums[at].ny, unitsOf(w * n.y));
    atomicAdd(sums[at].nz, unitsOf(w * n.z));
    if (frame.hasMaterials == 0u) return;
    atomicAdd(materialSums[at].share, unitsOf(w * surface.share));
    atomicAdd(materialSums[at].metallic, unitsOf(w * surface.metallic));
    atomicAdd(materialSums[at].roughness, unitsOf(w * surface.roughness));
}
// What a pixel shows of its sums: colours, normals and materials; its depth is the answer.
float shownOf(uint at, FilteredSums s, out FilteredPixel p) {
    const float over = 1.0 / float(s.weight);
    const float ofColour = frame.perSurfel != 0u ? 1.0 / min(float(s.weight), s.unit) : over;
    p.colour = packColour(float(s.red) * ofColour, float(s.green) * ofColour, float(s.blue) * ofColour);
    p.normal = octEncode(vec3(s.nx, s.ny, s.nz) * over);
    p.cover = 0u;
    if (frame.hasMaterials != 0u) {
        const MaterialSums m = materialSums[at];
        p.cover = coverOfMaterial(TexelSurface(float(m.share) * over, float(m.metallic) * over, float(m.roughness) * over));
    }
    return absoluteDepth(float(s.depth) * over, s.reference);
}
// Depth of a pixel with a front disc.
float withinFront(WideDisc d, uvec2 pixel, float blended) {
    const Lens lens = frameLensHere();
    const vec2 at = vec2(pixel) + 0.5 - frame.centre;
    const PixelRay ray = pixelRay(lens, at.x / frame.focal, at.y / frame.focal);
    const vec3 direction = rayDirection(ray);
    const DepthRange range = depthRange(d, d.radius / kOpaqueSigmas, frame.kernelSupport, frame.lowPass, lens);
    const float plane = depthWithin(range, dot(d.normal, fromRay(ray, d.centre)), dot(d.normal, direction));
    if (!(discHit(d, ray, frame.nearPlane).depth < kNoDisc)) return placeOfMissed(d, plane);
    return shownWithin(blended, plane, 1.0 / length(direction), lens);
}
// Those of a disc on its own.
FilteredPixel ownOf(uint id, DrawNode node, PointRecord r) {
    FilteredPixel p;
    const vec3 c = pointColour(node, r);
    p.colour = packColour(c.x, c.y, c.z);
    p.normal = octEncode(towardsEye(opaqueDisc(node, r, id)));
    p.cover = frame.hasMaterials != 0u ? coverOfMaterial(surfaceOf(id, node)) : 0u;
    return p;
}
float coveredBy(int weight, float unit) { return float(weight) / unit * (frame.perSurfel != 0u ? 1.0 : gridWeight(frame.kernelSupport)); }
uint secondKind(uint at) { return coverage[at] >> kSecondShift; }

// Adds a disc to a pixel. `scale`: see scaleOf.
void addKernel(WideDisc d, vec3 colour, TexelSurface surface, float scale, EwaKernel k, DepthRange range, ivec2 pixel) {
    if (isBeyond(k, pixel)) return;
    const RayOnDisc r = rayOnDisc(d, k, range, pixel);
    const uint at = uint(pixel.y) * frame.width + uint(pixel.x);
    const FilteredFront front = fronts[at];
    if (front.key != kNoKey && r.depth > keyDepth(front.key)) {
        if (r.isMet > 0.5 && sums[at].behind == 0u) atomicOr(sums[at].behind, 1u);
        return;
    }
    const float support = frame.kernelSupport;
    if (!(r.rho2 < support * support)) return;
    const float w = scale * blendedAmplitude(d, k, frame.nearPlane) * kernelAt(r.rho2, kernelEnd(support)) * sums[at].unit;
    if (r.depth < sums[at].nearest)
        atomicAdd(sums[at].rims, unitsOf(w));
    else
        addSums(at, w, r.depth, colour, towardsEye(d), surface);
}
// The same for the pixel's second surface. `rough`: with its side (roughSide).
void addSecond(WideDisc d, float rough, vec3 colour, TexelSurface surface, float scale, EwaKernel k, DepthRange range, ivec2 pixel) {
    const uint at = uint(pixel.y) * frame.width + uint(pixel.x);
    const uint kind = secondKind(at);
    if (kind != kSecondBefore && kind != kSecondBehind) return;
    if (isBeyond(k, pixel)) return;
    const RayOnDisc r = rayOnDisc(d, k, range, pixel);
    const float support = frame.kernelSupport;
    if (!(r.rho2 < support * support)) return;
    const uint64_t front = fronts[at].key;
    if (kind == kSecondBehind ? r.depth <= sums[at].nearest || r.depth > keyDepth(front)
        : front != kNoKey     ? r.depth >= sums[at].nearest
                              : r.depth + rough * r.along >= keyDepth(visibility[at])) return;
    if (kind == kSecondBefore && d.id < fronts[at].first) atomicMin(fronts[at].first, d.id);
    const float w = scale * blendedAmplitude(d, k, frame.nearPlane) * kernelAt(r.rho2, kernelEnd(support)) * sums[at].unit;
    addSums(at, w, r.depth, colour, towardsEye(d), surface);
}
// Offers a disc to the pixel's second front. That begins with another kind's key, which a disc at the same depth does not
// replace.
void offerBehind(WideDisc d, float rough, EwaKernel k, DepthRange range, ivec2 pixel) {
    const uint at = uint(pixel.y) * frame.width + uint(pixel.x);
    if (secondKind(at) != kSecondBehind) return;
    const RayOnDisc r = rayOnDisc(d, k, range, pixel);
    if (!(r.isMet > 0.5 && r.depth > sums[at].nearest)) return;
    const float depth = r.depth + rough * r.along;
    const uint64_t front = fronts[at].key;
    if (front != kNoKey && !isPointKey(front, frame.firstBlock) && depth >= keyDepth(front)) return;
    const uint64_t key = visibilityKey(floatBitsToUint(depth), drawId(0u, d.id));
    if (mayWin(key, front)) atomicMin(fronts[at].key, key);
}
