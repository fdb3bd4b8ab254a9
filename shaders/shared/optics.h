// Glass, water, and whatever reflects more or less than most: a layer that is drawn after what lies behind it.
//
// Light to the eye = what is reflected (Fresnel's share F, by Schlick) + (1 - F) x what comes through. What comes
// through is found in one of three ways. Environment: the ray bends once, and meets the surroundings. Screen: it goes
// on for the thickness of the body, and meets what the picture of all opaque things shows there. Object: it is followed
// to the body's back, which was drawn from behind (depth and normal, parallel rays), bends again, and is followed
// through the depths of that picture; where it leaves it, it meets the surroundings.
//
//        eye --- d ---> front --- t, refracted --- back --- refracted again ---> picture of what is behind
//
// The two tables: `behind` holds, per pixel, linear light times coverage, and coverage, at every level of a pyramid of
// means; then the depths of its first level. `back` holds depth and normal (camera space, outwards) per texel.
#ifndef STIPPLE_SHARED_OPTICS_H
#define STIPPLE_SHARED_OPTICS_H
#include "environment.h"
SHARED_BEGIN

const uint kRefractEnvironment = 0u;
const uint kRefractScreen = 1u;
const uint kRefractObject = 2u;

const uint kMostOptics = 14u;  // of a frame, counted from 1 (kPixelOptics); number 0 is what has none, 15 kPixelBlends
const uint kBehindLevels = 16u;
const uint kMarchSteps = 16u;  // through the body, and then so many halvings
const uint kMarchHalvings = 4u;
const uint kScreenSteps = 32u;  // across the picture behind it

struct Optic {
    float transmission;
    float ior;
    float thickness;  // world units; 0: a thin wall
    vec3 absorption;  // per world unit
    vec3 straightOn;  // what a dielectric reflects straight on
    float most;       // what it reflects at grazing angles
};

// Of one layer. Camera space, world units.
struct LayerConstants {
    uint way;
    uint pointOptic;       // of points, curves and patches: which of the optics
    float plainRoughness;  // of those of them that have no material of their own
    uint behindLevels;     // 0: nothing was drawn behind it
    uint behindDepths;     // first float of the depths
    uint behindFirst[16];  // first float of each level
    float farthest;        // depth of what is farthest behind it
    uint backEdge;         // texels; 0: its back is not known
    vec3 backX;            // rows of the rotation from camera space to that of the view from behind
    vec3 backY;
    vec3 backZ;
    vec3 backEye;     // its eye
    float backFocal;  // texels per world unit
    vec3 bodyCentre;  // of a sphere around the body
    float bodyRadius;
    float advanced;  // what the depths behind count too much: they are of the eye that was asked for
};

SHARED_FN vec3 scaled(vec3 a, float s) { return vec3(a.x * s, a.y * s, a.z * s); }
SHARED_FN vec3 times(vec3 a, vec3 b) { return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }

// 1 - (n1 / n2)^2 sin^2: the squared cosine beyond the interface; below 0: total reflection. `eta`: n1 / n2.
SHARED_FN float bentCosine2(float c, float eta) { return 1.0f - eta * eta * (1.0f - c * c); }
// d refracted; n is against it, c = -dot(n, d), k = bentCosine2(c, eta) >= 0.
SHARED_FN vec3 bentRay(vec3 d, vec3 n, float c, float eta, float k) {
    const float along = eta * c - sqrt(k);
    return vec3(eta * d.x + along * n.x, eta * d.y + along * n.y, eta * d.z + along * n.z);
}
SHARED_FN vec3 reflectedRay(vec3 d, vec3 n, float c) {
    return vec3(d.x + 2.0f * c * n.x, d.y + 2.0f * c * n.y, d.z + 2.0f * c * n.z);
}
// Share of light that is reflected on the way from n1 to n2 (Schlick 1994). His formula is of the thinner side: with
// the cosine of the denser one it says 4 % where glass is about to reflect all of it.
SHARED_FN float fresnelBetween(float n1, float n2, float c) {
    const float root = (n1 - n2) / (n1 + n2);
    const float r0 = root * root;
    const float k = bentCosine2(c, n1 / n2);
    const float x = 1.0f - (n1 < n2 ? c : sqrt(max(k, 0.0f)));
    const float x2 = x * x;
    return k < 0.0f ? 1.0f : r0 + (1.0f - r0) * x2 * x2 * x;
}
// The same from outside, of a rough surface, for three colours; `most`: at grazing angles (Lagarde 2011).
SHARED_FN vec3 fresnelOutside(vec3 straight, float most, float roughness, float c) {
    const float x = 1.0f - c;
    const float x5 = x * x * x * x * x;
    const float edge = most * (1.0f - roughness);
    return vec3(straight.x + (max(edge, straight.x) - straight.x) * x5,
                straight.y + (max(edge, straight.y) - straight.y) * x5,
                straight.z + (max(edge, straight.z) - straight.z) * x5);
}
// Light that went through a rough surface is spread less where it bends less.
SHARED_FN float roughnessThrough(float roughness, float ior) {
    return roughness * min(max(2.0f * ior - 2.0f, 0.0f), 1.0f);
}

// ---- what lies behind ----

struct BehindTexel {
    vec3 light;  // times cover
    float cover;
};
SHARED_FN BehindTexel behindTexel(SHARED_SEEN uint at) {
    BehindTexel t;
    t.light = vec3(SHARED_SEEN_BEHIND(at), SHARED_SEEN_BEHIND(at + 1u), SHARED_SEEN_BEHIND(at + 2u));
    t.cover = SHARED_SEEN_BEHIND(at + 3u);
    return t;
}
SHARED_FN BehindTexel mixTexels(BehindTexel a, BehindTexel b, float t) {
    BehindTexel m;
    m.light = vec3(a.light.x + t * (b.light.x - a.light.x), a.light.y + t * (b.light.y - a.light.y),
                   a.light.z + t * (b.light.z - a.light.z));
    m.cover = a.cover + t * (b.cover - a.cover);
    return m;
}
// Bilinear; (x, y): pixels of the first level.
SHARED_FN BehindTexel behindLevel(SHARED_SEEN LayerConstants l, uint width, uint height, uint level, float x, float y) {
    const uint w = (width + (1u << level) - 1u) >> level;
    const uint h = (height + (1u << level) - 1u) >> level;
    const float size = float(1u << level);
    const float px = min(max(0.0f, x / size - 0.5f), float(w - 1u));
    const float py = min(max(0.0f, y / size - 0.5f), float(h - 1u));
    const uint x0 = uint(int(px));
    const uint y0 = uint(int(py));
    const uint x1 = x0 + 1u < w ? x0 + 1u : x0;
    const uint y1 = y0 + 1u < h ? y0 + 1u : y0;
    const uint first = l.behindFirst[level];
    const BehindTexel a = behindTexel(SHARED_SEEN_USE first + (y0 * w + x0) * 4u);
    const BehindTexel b = behindTexel(SHARED_SEEN_USE first + (y0 * w + x1) * 4u);
    const BehindTexel c = behindTexel(SHARED_SEEN_USE first + (y1 * w + x0) * 4u);
    const BehindTexel d = behindTexel(SHARED_SEEN_USE first + (y1 * w + x1) * 4u);
    const float fx = px - float(x0);
    return mixTexels(mixTexels(a, b, fx), mixTexels(c, d, fx), py - float(y0));
}
// The light behind a pixel as a surface of that roughness lets it through; `missed` where nothing is.
SHARED_FN vec3 behindAt(SHARED_SEEN LayerConstants l, uint width, uint height, float x, float y, float roughness,
                        vec3 missed) {
    const float wide = float(width) > float(height) ? float(width) : float(height);
    const float lod = min(max(0.0f, roughness * log2(wide)), float(l.behindLevels) - 1.0f);
    const uint level = uint(int(lod));
    const uint next = level + 1u < l.behindLevels ? level + 1u : level;
    const BehindTexel t = mixTexels(behindLevel(SHARED_SEEN_USE l, width, height, level, x, y),
                                    behindLevel(SHARED_SEEN_USE l, width, height, next, x, y), lod - float(level));
    return addScaled(t.light, missed, 1.0f - t.cover);
}

// ---- the surroundings ----

// What comes from direction d where nothing is in the way: the environment, or the background of the picture.
SHARED_FN vec3 farLight(SHARED_SEEN FrameConstants f, vec3 d, float roughness) {
    if (f.hasEnvironment == 0u) return f.background;
    const vec3 to = vec3(dot(f.environmentX, d), dot(f.environmentY, d), dot(f.environmentZ, d));
    return environmentMirror(SHARED_SEEN_ENVIRONMENT to, roughness, f.environmentSharp);
}

struct OnPicture {
    float x;
    float y;
    bool isInside;
};
SHARED_FN OnPicture pictureOf(FrameConstants f, vec3 p) {
    const float scale = f.orthographic != 0u ? f.focal : f.focal / max(p.z, 1.0e-20f);
    OnPicture o;
    o.x = p.x * scale + f.centre.x;
    o.y = p.y * scale + f.centre.y;
    o.isInside = (f.orthographic != 0u || p.z > 0.0f) && o.x >= 0.0f && o.y >= 0.0f && o.x < float(f.width) &&
                 o.y < float(f.height);
    return o;
}
SHARED_FN float behindDepth(SHARED_SEEN FrameConstants f, LayerConstants l, OnPicture at) {
    const float depth = SHARED_SEEN_BEHIND(l.behindDepths + uint(int(at.y)) * f.width + uint(int(at.x)));
    return depth > 0.0f ? depth - l.advanced : 0.0f;
}

// Place on the ray p + s d, s in [0, reach], that is seen `share` of the way from one end to the other.
SHARED_FN vec3 alongPicture(FrameConstants f, vec3 p, vec3 d, float reach, float share) {
    const float z1 = p.z + reach * d.z;
    const float s = f.orthographic != 0u ? share * reach : reach * share * p.z / (z1 + share * (p.z - z1));
    return addScaled(p, d, s);
}

// The light that a ray brings which leaves the body at p: what it meets among the opaque things that are seen, else the
// surroundings. It is followed across the picture until it goes behind something that it was in front of.
SHARED_FN vec3 leavingLight(SHARED_SEEN FrameConstants f, LayerConstants l, vec3 p, vec3 d, float roughness) {
    const vec3 missed = farLight(SHARED_SEEN_USE f, d, roughness);
    if (l.behindLevels == 0u || !(l.farthest > 0.0f)) return missed;
    // To where all is passed; towards the eye no farther than nine tenths of the way.
    const float ahead = d.z > 1.0e-6f ? (l.farthest * 1.001f - p.z) / d.z : 8.0f * l.farthest;
    const float towards = d.z < -1.0e-6f ? -0.9f * p.z / d.z : 8.0f * l.farthest;
    const float reach = min(min(ahead, towards), 8.0f * l.farthest);
    if (!(reach > 0.0f) || !(p.z > 0.0f)) return missed;
    float before = 0.0f;
    bool wasInFront = false;
    for (uint k = 0u; k <= kScreenSteps; ++k) {
        const float share = float(k) / float(kScreenSteps);
        const vec3 q = alongPicture(f, p, d, reach, share);
        const OnPicture at = pictureOf(f, q);
        if (!at.isInside) return missed;
        const float depth = behindDepth(SHARED_SEEN_USE f, l, at);
        const bool isBehind = depth > 0.0f && q.z > depth;
        if (isBehind && wasInFront) {
            float low = before;
            float high = share;
            for (uint h = 0u; h < kMarchHalvings; ++h) {
                const float middle = 0.5f * (low + high);
                const vec3 m = alongPicture(f, p, d, reach, middle);
                const float there = behindDepth(SHARED_SEEN_USE f, l, pictureOf(f, m));
                if (there > 0.0f && m.z > there)
                    high = middle;
                else
                    low = middle;
            }
            const OnPicture hit = pictureOf(f, alongPicture(f, p, d, reach, high));
            return behindAt(SHARED_SEEN_USE l, f.width, f.height, hit.x, hit.y, roughness, missed);
        }
        wasInFront = !isBehind;
        before = share;
    }
    return missed;
}

// ---- the body's back ----

struct BackTexel {
    float depth;  // of the view from behind; 0: nothing is there
    vec3 normal;
};
SHARED_FN vec3 seenFromBehind(LayerConstants l, vec3 p) {
    const vec3 d = vec3(p.x - l.backEye.x, p.y - l.backEye.y, p.z - l.backEye.z);
    return vec3(dot(l.backX, d), dot(l.backY, d), dot(l.backZ, d));
}
// Bilinear, of the texels that are there; nothing where the nearest is not.
SHARED_FN BackTexel backAt(SHARED_SEEN LayerConstants l, vec3 q) {
    BackTexel t;
    t.depth = 0.0f;
    t.normal = vec3(0.0f, 0.0f, 0.0f);
    const float half_ = 0.5f * float(l.backEdge);
    const float x = q.x * l.backFocal + half_ - 0.5f;
    const float y = q.y * l.backFocal + half_ - 0.5f;
    if (!(x >= 0.0f && y >= 0.0f && x < float(l.backEdge) - 1.0f && y < float(l.backEdge) - 1.0f)) return t;
    const uint x0 = uint(int(x));
    const uint y0 = uint(int(y));
    const float fx = x - float(x0);
    const float fy = y - float(y0);
    const uint nearest = ((y0 + (fy >= 0.5f ? 1u : 0u)) * l.backEdge + x0 + (fx >= 0.5f ? 1u : 0u)) * 4u;
    if (!(SHARED_SEEN_BACK(nearest) > 0.0f)) return t;
    float weights = 0.0f;
    for (uint k = 0u; k < 4u; ++k) {
        const uint at = ((y0 + (k >> 1)) * l.backEdge + x0 + (k & 1u)) * 4u;
        const float depth = SHARED_SEEN_BACK(at);
        const float w =
            ((k & 1u) != 0u ? fx : 1.0f - fx) * ((k >> 1) != 0u ? fy : 1.0f - fy) * (depth > 0.0f ? 1.0f : 0.0f);
        weights += w;
        t.depth += w * depth;
        t.normal = addScaled(t.normal,
                             vec3(SHARED_SEEN_BACK(at + 1u), SHARED_SEEN_BACK(at + 2u), SHARED_SEEN_BACK(at + 3u)), w);
    }
    t.depth = t.depth / weights;
    const float inverse = 1.0f / sqrt(max(dot(t.normal, t.normal), 1.0e-20f));
    t.normal = scaled(t.normal, inverse);
    return t;
}

struct BodyExit {
    bool isFound;
    float path;   // of the way through the body
    vec3 normal;  // outwards
};
// How far the place at s along the ray is inside the body, as seen from behind; below 0: outside.
SHARED_FN float insideBack(LayerConstants l, vec3 p, vec3 t, float s, BackTexel back) {
    return back.depth > 0.0f ? seenFromBehind(l, addScaled(p, t, s)).z - back.depth : -1.0e30f;
}
SHARED_FN BodyExit bodyExit(SHARED_SEEN LayerConstants l, vec3 p, vec3 t) {
    BodyExit e;
    e.isFound = false;
    e.path = 0.0f;
    e.normal = vec3(0.0f, 0.0f, 0.0f);
    if (l.backEdge == 0u) return e;
    const vec3 to = vec3(l.bodyCentre.x - p.x, l.bodyCentre.y - p.y, l.bodyCentre.z - p.z);
    const float along = dot(to, t);
    const float inside = along * along - (dot(to, to) - l.bodyRadius * l.bodyRadius);
    const float reach = along + sqrt(max(inside, 0.0f));
    if (!(reach > 0.0f)) return e;
    float low = 0.0f;
    float high = reach;
    float lowInside = 0.0f;
    float highInside = -1.0e30f;
    bool isOut = false;
    for (uint k = 1u; k <= kMarchSteps && !isOut; ++k) {
        const float s = reach * float(k) / float(kMarchSteps);
        const float in_ = insideBack(l, p, t, s, backAt(SHARED_SEEN_USE l, seenFromBehind(l, addScaled(p, t, s))));
        if (in_ < 0.0f) {
            high = s;
            highInside = in_;
            isOut = true;
        } else {
            low = s;
            lowInside = in_;
        }
    }
    for (uint h = 0u; h < kMarchHalvings; ++h) {
        const float s = 0.5f * (low + high);
        const float in_ = insideBack(l, p, t, s, backAt(SHARED_SEEN_USE l, seenFromBehind(l, addScaled(p, t, s))));
        if (in_ < 0.0f) {
            high = s;
            highInside = in_;
        } else {
            low = s;
            lowInside = in_;
        }
    }
    // Between the last two the surface is taken for a plane.
    const bool isBracketed = highInside > -1.0e29f && lowInside > 0.0f;
    e.path = isBracketed ? low + (high - low) * lowInside / (lowInside - highInside) : low;
    BackTexel back = backAt(SHARED_SEEN_USE l, seenFromBehind(l, addScaled(p, t, e.path)));
    if (!(back.depth > 0.0f)) back = backAt(SHARED_SEEN_USE l, seenFromBehind(l, addScaled(p, t, low)));
    e.isFound = isOut && back.depth > 0.0f && e.path > 0.0f;
    e.normal = back.normal;
    return e;
}

// ---- a pixel ----

SHARED_FN vec3 absorbed(Optic o, float path) {
    return vec3(exp2(-1.44269504f * o.absorption.x * path), exp2(-1.44269504f * o.absorption.y * path),
                exp2(-1.44269504f * o.absorption.z * path));
}

// What comes through at the place p of a surface whose normal n faces the eye; d: the ray from the eye, unit.
SHARED_FN vec3 throughLight(SHARED_SEEN FrameConstants f, LayerConstants l, Optic o, vec3 p, vec3 d, vec3 n,
                            float roughness) {
    const bool isThin = !(o.thickness > 0.0f);
    const float ior = max(o.ior, 1.0f);
    const float c = min(max(-dot(n, d), 1.0e-3f), 1.0f);
    const float eta = 1.0f / ior;
    const vec3 bent = bentRay(d, n, c, eta, bentCosine2(c, eta));
    const vec3 t = vec3(isThin ? d.x : bent.x, isThin ? d.y : bent.y, isThin ? d.z : bent.z);
    const float rough = roughnessThrough(roughness, ior);
    const vec3 missed = farLight(SHARED_SEEN_USE f, t, rough);
    if (l.way == kRefractEnvironment) return times(missed, absorbed(o, o.thickness));
    if (l.way == kRefractObject && !isThin) {
        const BodyExit e = bodyExit(SHARED_SEEN_USE l, p, t);
        if (e.isFound) {
            const float out_ = min(max(dot(t, e.normal), 1.0e-3f), 1.0f);
            const vec3 against = scaled(e.normal, -1.0f);
            const float k = bentCosine2(out_, ior);
            const float back_ = fresnelBetween(ior, 1.0f, out_);
            const vec3 inner = farLight(SHARED_SEEN_USE f, reflectedRay(t, against, out_), rough);
            vec3 light = scaled(inner, back_);
            if (k >= 0.0f)
                light = addScaled(light,
                                  leavingLight(SHARED_SEEN_USE f, l, addScaled(p, t, e.path),
                                               bentRay(t, against, out_, ior, k), rough),
                                  1.0f - back_);
            return times(light, absorbed(o, e.path));
        }
    }
    const OnPicture at = pictureOf(f, addScaled(p, t, isThin ? 0.0f : o.thickness));
    vec3 light = missed;
    if (at.isInside && l.behindLevels > 0u)
        light = behindAt(SHARED_SEEN_USE l, f.width, f.height, at.x, at.y, rough, missed);
    return times(light, absorbed(o, isThin ? 0.0f : o.thickness));
}

// The whole of a pixel but for lights (`lights`: what they send back, of opaqueShare(s, o)).
SHARED_FN float throughShare(Surface s, Optic o) { return o.transmission * (1.0f - s.metallic); }
// What of it is diffuse: of what is no metal, what does not go through (glTF, KHR_materials_transmission).
SHARED_FN float diffuseShare(Surface s, Optic o) { return (1.0f - s.metallic) * (1.0f - o.transmission); }
// As lights see it: that share is its colour, and what it reflects straight on, as metal and as dielectric, stays.
SHARED_FN Surface opaqueShare(Surface s, Optic o) {
    Surface opaque = s;
    opaque.dielectric = o.straightOn;
    opaque.dielectric = straightOn(opaque);
    opaque.colour = scaled(s.colour, diffuseShare(s, o));
    opaque.metallic = 0.0f;
    return opaque;
}
SHARED_FN vec3 opticLight(SHARED_SEEN FrameConstants f, LayerConstants l, Optic o, Surface s, vec3 p, vec3 lights) {
    Surface whole = s;
    whole.dielectric = o.straightOn;
    const float c = min(max(dot(s.normal, s.toEye), 1.0e-3f), 1.0f);
    const vec3 d = scaled(s.toEye, -1.0f);
    const vec3 mirror = reflectedRay(d, s.normal, c);
    const float most = o.most + (1.0f - o.most) * s.metallic;
    const vec3 share = fresnelOutside(straightOn(whole), most, s.roughness, c);
    vec3 reflected;
    vec3 around;
    if (f.hasEnvironment != 0u) {
        const vec3 n = s.normal;
        reflected = farLight(SHARED_SEEN_USE f, mirror, s.roughness);
        around = environmentDiffuse(
            SHARED_SEEN_ENVIRONMENT vec3(dot(f.environmentX, n), dot(f.environmentY, n), dot(f.environmentZ, n)));
    } else {
        const float sky = 0.25f + 0.15f * (1.0f - s.roughness) * dot(mirror, f.skyDirection) +
                          0.15f * s.roughness * dot(s.normal, f.skyDirection);
        const float light = skyLight(s.normal, f.skyDirection);
        reflected = vec3(sky, sky, sky);
        around = vec3(light, light, light);
    }
    const float through = throughShare(s, o);
    const float diffuse = diffuseShare(s, o) * s.occlusion * f.ambient;
    const float seen_ = s.occlusion * f.ambient;
    vec3 sum = vec3(lights.x + diffuse * s.colour.x * around.x + seen_ * share.x * reflected.x,
                    lights.y + diffuse * s.colour.y * around.y + seen_ * share.y * reflected.y,
                    lights.z + diffuse * s.colour.z * around.z + seen_ * share.z * reflected.z);
    if (through > 0.0f) {
        const vec3 light = throughLight(SHARED_SEEN_USE f, l, o, p, d, s.normal, s.roughness);
        sum = vec3(sum.x + through * (1.0f - share.x) * s.colour.x * light.x,
                   sum.y + through * (1.0f - share.y) * s.colour.y * light.y,
                   sum.z + through * (1.0f - share.z) * s.colour.z * light.z);
    }
    return sum;
}

SHARED_END
#endif
