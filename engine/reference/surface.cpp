// The material and light model of glTF 2.0 (appendix B), and its textures.
#include "engine/reference/surface.h"

#include <algorithm>
#include <cmath>

#include "engine/reference/decode.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;
using glm::dvec4;

constexpr double kPi = 3.14159265358979323846;

/// A tangent-space normal: x along growing u, y against growing v.
dvec3 bump(const dvec3& normal, const Corners& c, const dvec3& texel, double scale) {
    const dvec3 n = glm::normalize(normal), e1 = c[1].at - c[0].at, e2 = c[2].at - c[0].at;
    const dvec2 d1 = c[1].uv - c[0].uv, d2 = c[2].uv - c[0].uv;
    const double det = d1.x * d2.y - d1.y * d2.x;
    if (det == 0) return n;
    dvec3 alongU = (e1 * d2.y - e2 * d1.y) / det, againstV = (e1 * d2.x - e2 * d1.x) / det;
    alongU -= glm::dot(alongU, n) * n;
    againstV -= glm::dot(againstV, n) * n;
    if (!(glm::length(alongU) > 0) || !(glm::length(againstV) > 0)) return n;
    return glm::normalize(alongU) * ((2 * texel.x - 1) * scale) +
           glm::normalize(againstV) * ((2 * texel.y - 1) * scale) + n * (2 * texel.z - 1);
}

/// Times pi, as a light's colour is what a white diffuse surface sends back.
dvec3 reflected(const Sample& s, const dvec3& n, const dvec3& v, const dvec3& l, const dvec3& light,
                const dvec3& dielectric, double pixels) {
    const double nl = glm::dot(n, l), nv = std::max(glm::dot(n, v), 1e-3);
    if (!(nl > 0))
        return !s.letsLightThrough(pixels) ? dvec3(0) : light * s.colour * (1 - s.metallic) * (kThroughLeaf * -nl);
    const dvec3 h = glm::normalize(l + v);
    const double nh = std::max(0.0, glm::dot(n, h)), vh = std::max(0.0, glm::dot(v, h));
    const double alpha2 = std::pow(std::max(s.roughness * s.roughness, 2e-3), 2);
    const double ggx = alpha2 / (kPi * std::pow(nh * nh * (alpha2 - 1) + 1, 2));
    const double visible =
        0.5 / (nl * std::sqrt(nv * nv * (1 - alpha2) + alpha2) + nv * std::sqrt(nl * nl * (1 - alpha2) + alpha2));
    const dvec3 f0 = glm::mix(dielectric, s.colour, s.metallic);
    const dvec3 fresnel = f0 + (1.0 - f0) * std::pow(1 - vh, 5);
    const dvec3 diffuse = s.colour * (1 - s.metallic) / kPi;
    return light * nl * kPi * (diffuse * (1.0 - fresnel) + fresnel * ggx * visible);
}

/// Second-order harmonics as the table has them: constants and cosine folded in.
dvec3 irradianceAround(const std::vector<float>& t, const dvec3& n) {
    const std::array<double, 9> basis{
        1, n.y, n.z, n.x, n.x * n.y, n.y * n.z, 3 * n.z * n.z - 1, n.x * n.z, n.x * n.x - n.y * n.y};
    dvec3 sum(0);
    for (size_t k = 0; k < 9; ++k) sum += basis.at(k) * dvec3(t[3 * k], t[3 * k + 1], t[3 * k + 2]);
    return glm::max(sum, dvec3(0));
}

/// An octahedral map of `edge` texels that begins at float `first`, bilinear.
dvec3 lookUp(const std::vector<float>& t, const dvec3& direction, size_t first, size_t edge) {
    const dvec3 d = direction / (std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z));
    dvec2 p(d.x, d.z);
    if (d.y < 0) p = {(1 - std::abs(d.z)) * (d.x >= 0 ? 1 : -1), (1 - std::abs(d.x)) * (d.z >= 0 ? 1 : -1)};
    const auto size = static_cast<double>(edge);
    p = glm::clamp((p * 0.5 + 0.5) * size - 0.5, dvec2(0), dvec2(size - 1.001));
    const auto at = [&](size_t x, size_t y) {
        const size_t i = first + (y * edge + x) * 3;
        return dvec3(t[i], t[i + 1], t[i + 2]);
    };
    const auto x = static_cast<size_t>(p.x), y = static_cast<size_t>(p.y);
    const dvec2 part = p - glm::floor(p);
    return glm::mix(glm::mix(at(x, y), at(x + 1, y), part.x), glm::mix(at(x, y + 1), at(x + 1, y + 1), part.x), part.y);
}

}  // namespace

dvec3 mirrored(const render::Environment& environment, const dvec3& direction, double roughness) {
    const std::vector<float>& t = environment.table;
    constexpr size_t kEdge = 128, kHarmonics = 27, kMap = kEdge * kEdge * 3;
    const auto usual = [&](size_t level) { return lookUp(t, direction, kHarmonics + level * kMap, kEdge); };
    if (environment.sharpEdge == 0 || roughness >= 0.25) {
        const double l = std::clamp(roughness, 0.0, 1.0) * 4;
        const auto level = static_cast<size_t>(std::min(l, 3.999));
        return glm::mix(usual(level), usual(level + 1), l - static_cast<double>(level));
    }
    // Maps for roughness 0, 1/16, 1/8, 3/16, each half as large as the last, and the usual one for 1/4.
    const auto sharp = [&](size_t level) {
        size_t first = kHarmonics + 5 * kMap, edge = environment.sharpEdge;
        for (size_t l = 0; l < level; ++l, edge /= 2) first += edge * edge * 3;
        return level < 4 ? lookUp(t, direction, first, edge) : usual(1);
    };
    const double l = std::max(roughness, 0.0) * 16;
    const auto level = static_cast<size_t>(std::min(l, 3.999));
    return glm::mix(sharp(level), sharp(level + 1), l - static_cast<double>(level));
}

Corner cornerOf(const lod::Hierarchy& h, const lod::Instance& instance, const shared::MeshVertex& v, const dvec3& place,
                const lod::View& view) {
    const auto toCamera = [&](const dvec3& d) {
        return dvec3(glm::dot(d, view.right), glm::dot(d, view.down), glm::dot(d, view.forward));
    };
    Corner c;
    c.at =
        toCamera(instance.translation + instance.rotation * (instance.scale * (h.origin + h.unit * place)) - view.eye);
    c.normal = toCamera(instance.rotation * decodeDirection(v.normal));
    c.colour = {decodeSrgb(v.colour & 255u), decodeSrgb(v.colour >> 8 & 255u), decodeSrgb(v.colour >> 16 & 255u),
                (v.colour >> 24) / 255.0};
    c.uv = {v.u, v.v};
    return c;
}

dvec2 weightsOn(const ViewRay& ray, const Corners& c, const dvec3& face) {
    const dvec3 e1 = c[1].at - c[0].at, e2 = c[2].at - c[0].at;
    const dvec3 off = ray.at(glm::dot(face, c[0].at - ray.origin) / glm::dot(face, ray.direction)) - c[0].at;
    const double f2 = glm::dot(face, face);
    return {glm::dot(glm::cross(off, e2), face) / f2, glm::dot(glm::cross(e1, off), face) / f2};
}

double footprintOn(const ViewRay& ray, bool isOrthographic, double step, const Corners& c, const dvec3& face) {
    const auto uvAt = [&](double dx, double dy) {
        ViewRay beside = ray;
        (isOrthographic ? beside.origin : beside.direction) += dvec3(dx, dy, 0);
        const dvec2 w = weightsOn(beside, c, face);
        return (1 - w.x - w.y) * c[0].uv + w.x * c[1].uv + w.y * c[2].uv;
    };
    const double h = 1e-3 * step;
    return std::max(glm::length(uvAt(h, 0) - uvAt(-h, 0)), glm::length(uvAt(0, h) - uvAt(0, -h))) / 2e-3;
}

bool TextureReader::level(const shared::TextureInfo& info, uint32_t l, dvec2 uv, dvec4& out) const {
    const auto sizeAt = [l](uint32_t size) { return std::max<int64_t>(1, (int64_t{size} + (1 << l) - 1) >> l); };
    const std::array<int64_t, 2> size{sizeAt(info.width), sizeAt(info.height)};
    const std::array<uint32_t, 2> wrap{info.wrapU, info.wrapV};
    std::array<int64_t, 2> low{};
    std::array<double, 2> part{};
    for (size_t k = 0; k < 2; ++k) {
        double c = uv[static_cast<int>(k)];
        const double whole = std::floor(c);
        if (wrap.at(k) == shared::kWrapClamp)
            c = std::clamp(c, 0.0, 1.0);
        else
            c = wrap.at(k) == shared::kWrapMirror && std::fmod(std::abs(whole), 2.0) == 1 ? 1 - (c - whole) : c - whole;
        if (!(c > 0)) c = 0;  // of coordinates so large that they have no fraction, too
        const double at = std::min(c, 1 - 1e-9) * static_cast<double>(size.at(k)) - 0.5;
        low.at(k) = static_cast<int64_t>(std::floor(at));
        part.at(k) = at - std::floor(at);
    }
    // The tile that holds the upper left texel; its border holds what lies beyond.
    const int64_t tx = std::max<int64_t>(low[0], 0) / 128, ty = std::max<int64_t>(low[1], 0) / 128;
    const auto found =
        chunks.find(uint64_t{textures.source} << 32 | (textures.firstChunk + info.firstTile[l] +
                                                       static_cast<uint32_t>(ty * ((size[0] + 127) / 128) + tx)));
    if (found == chunks.end()) return false;
    out = dvec4(0);
    for (int64_t k = 0; k < 4; ++k) {
        const int64_t x = low[0] + k % 2 - tx * 128 + 1, y = low[1] + k / 2 - ty * 128 + 1;
        const uint32_t c = found->second.texels.at(static_cast<size_t>(y * 130 + x));
        const double w = (k % 2 ? part[0] : 1 - part[0]) * (k / 2 ? part[1] : 1 - part[1]);
        for (uint32_t i = 0; i < 4; ++i) {
            const uint32_t byte = c >> (8 * i) & 255u;
            out[static_cast<int>(i)] += w * (info.isColour && i < 3 ? decodeSrgb(byte) : byte / 255.0);
        }
    }
    return true;
}

bool TextureReader::sample(const shared::TextureSlot& slot, dvec2 at, double footprint, dvec4& out) const {
    if (slot.texture == 0) return false;
    const shared::TextureInfo& info = textures.infos[slot.texture - 1];
    const dvec3 h(at, 1);
    const dvec2 uv(glm::dot(dvec3(slot.rowU), h), glm::dot(dvec3(slot.rowV), h));
    const double lod = std::clamp(std::log2(std::max(1e-9, footprint * std::max(info.width, info.height))), 0.0,
                                  static_cast<double>(info.levels - 1));
    auto l = static_cast<uint32_t>(lod);
    if (!level(info, l, uv, out)) {
        while (++l < info.levels)
            if (level(info, l, uv, out)) return true;
        return false;
    }
    dvec4 coarse(0);
    if (lod > l && l + 1 < info.levels && level(info, l + 1, uv, coarse)) out = glm::mix(out, coarse, lod - l);
    return true;
}

bool surfaceOn(const dvec3& ray, const dvec2& weights, double footprint, const Corners& c, const dvec3& face,
               uint32_t surface, const shared::SurfaceMaterial& m, const TextureReader& textures, Sample& s, dvec3& n) {
    const double wb = weights.x, wc = weights.y, wa = 1 - wb - wc;
    const dvec2 uv = wa * c[0].uv + wb * c[1].uv + wc * c[2].uv;
    const dvec4 own = wa * c[0].colour + wb * c[1].colour + wc * c[2].colour;
    dvec4 texel(1);
    const bool hasBase = textures.sample(m.baseTexture, uv, footprint, texel);
    if ((surface & shared::kSurfaceMasked) != 0 && m.alpha * own.w * (hasBase ? texel.w : 1) < m.alphaCutoff)
        return false;
    s.isTriangle = true;
    s.isUnlit = (surface & shared::kSurfaceUnlit) != 0;
    s.optic = m.optics >> 24;
    if (s.blends()) s.opacity = std::clamp(m.alpha * own.w * (hasBase ? texel.w : 1), 0.0, 1.0);
    s.colour = dvec3(m.baseColour) * dvec3(own) * (hasBase ? dvec3(texel) : dvec3(1));
    const dvec2 finish = wa * c[0].finish + wb * c[1].finish + wc * c[2].finish;
    s.metallic = m.metallic * finish.x;
    s.roughness = m.roughness * finish.y;
    s.emissive = dvec3(m.emissive);
    if (textures.sample(m.surfaceTexture, uv, footprint, texel)) {
        s.roughness *= texel.y;
        s.metallic *= texel.z;
    }
    if (!s.blends() && textures.sample(m.occlusionTexture, uv, footprint, texel))
        s.occlusion = 1 + m.occlusionStrength * (texel.x - 1);
    if (textures.sample(m.emissiveTexture, uv, footprint, texel)) s.emissive *= dvec3(texel);
    n = (surface & shared::kSurfaceFlat) != 0 ? face : wa * c[0].normal + wb * c[1].normal + wc * c[2].normal;
    const bool isFolded = glm::dot(face, n) < 0;
    if (textures.sample(m.normalTexture, uv, footprint, texel)) n = bump(n, c, dvec3(texel), m.normalScale);
    if (textures.show != nullptr) (*textures.show)(uv, footprint, s, n);
    if ((glm::dot(face, ray) > 0) != isFolded) n = -n;
    const dvec3 v = glm::normalize(ray);
    n -= std::max(0.0, glm::dot(n, v)) * v;
    n = glm::length(n) > 0 ? glm::normalize(n) : -v;
    return true;
}

dvec3 lightsOn(const Sample& s, const dvec3& n, const dvec3& point, const dvec3& dielectric,
               const render::DrawList& draws, const LightPast& past) {
    const shared::FrameConstants& f = draws.frame;
    const dvec3 v = -sightOf(draws.view, point);
    const double pixels = pixelsAt(draws.view, s.depth);
    dvec3 sum(0);
    if (draws.lights.empty() && !draws.environment)
        return reflected(s, n, v, dvec3(f.sunDirection), dvec3(0.75), dielectric, pixels);
    for (size_t k = 0; k < draws.lights.size(); ++k) {
        const shared::LightSource& light = draws.lights[k];
        const dvec3 colour = dvec3(light.colour) * (past ? past(k, point, n) : pastMaps(draws, k, point, n));
        if (light.kind == shared::kLightDirectional) {
            sum += reflected(s, n, v, dvec3(light.position), colour, dielectric, pixels);
            continue;
        }
        const dvec3 to = dvec3(light.position) - point;
        const double distance = glm::length(to);
        double share = 1 / (distance * distance);
        if (light.range > 0) share *= std::pow(std::max(0.0, 1 - std::pow(distance / light.range, 4)), 2);
        if (light.kind == shared::kLightSpot) {
            const double along = glm::dot(-to / distance, dvec3(light.axis));
            share *= std::pow(
                std::clamp((along - light.cosOuter) / std::max(1e-4f, light.cosInner - light.cosOuter), 0.0, 1.0), 2);
        }
        sum += reflected(s, n, v, to / distance, colour * share, dielectric, pixels);
    }
    return sum;
}

dvec3 irradianceOf(const render::Environment& environment, const dvec3& n) {
    return irradianceAround(environment.table, n);
}

dvec3 sentBy(const Sample& s, const dvec3& n, const dvec3& point, const render::DrawList& draws, bool areLit) {
    const bool isSurface = s.hasMaterial() || !draws.lights.empty() || draws.environment;
    if ((s.isTriangle && !s.isLitAsPoint) || (areLit && isSurface)) return shadeTriangle(s, n, point, draws);
    if (!areLit) return s.colour;
    return s.colour * lightOn(n, draws.frame, s.letsLightThrough(pixelsAt(draws.view, s.depth)), s.occlusion);
}

dvec3 surroundingsOf(const dvec3& mirror, const dvec3& n, double roughness, const render::DrawList& draws) {
    const shared::FrameConstants& f = draws.frame;
    if (!draws.environment) return dvec3(0.25 + 0.15 * glm::dot(glm::mix(mirror, n, roughness), dvec3(f.skyDirection)));
    const glm::dmat3 toMap =
        glm::transpose(glm::dmat3(dvec3(f.environmentX), dvec3(f.environmentY), dvec3(f.environmentZ)));
    return mirrored(*draws.environment, toMap * mirror, roughness);
}

dvec3 mirrorShareOf(const Sample& s, double facing) {
    // The environment's share of a microfacet mirror (Karis 2013, fit by Lazarov).
    const dvec4 r = s.roughness * dvec4(-1, -0.0275, -0.572, 0.022) + dvec4(1, 0.0425, 1.04, -0.04);
    const double a004 = std::min(r.x * r.x, std::exp2(-9.28 * facing)) * r.x + r.y;
    const dvec2 ab = dvec2(-1.04, 1.04) * a004 + dvec2(r.z, r.w);
    return glm::mix(dvec3(0.04), s.colour, s.metallic) * ab.x + ab.y;
}

dvec3 shadeTriangle(const Sample& s, const dvec3& n, const dvec3& point, const render::DrawList& draws,
                    const LightPast& past) {
    const shared::FrameConstants& f = draws.frame;
    if (s.isTriangle && !s.isLitAsPoint && (s.isUnlit || (f.shade & shared::kShadeTriangles) == 0)) return s.colour;
    const dvec3 v = -sightOf(draws.view, point), up(f.skyDirection);
    const double nv = std::max(glm::dot(n, v), 1e-3);
    const dvec3 blurred = surroundingsOf(2 * nv * n - v, n, s.roughness, draws);
    dvec3 around(0.25 + 0.15 * glm::dot(n, up));
    if (draws.environment) {
        const glm::dmat3 toMap =
            glm::transpose(glm::dmat3(dvec3(f.environmentX), dvec3(f.environmentY), dvec3(f.environmentZ)));
        around = irradianceAround(draws.environment->table, toMap * n);
    }
    const dvec3 sky = s.colour * (1 - s.metallic) * around + mirrorShareOf(s, nv) * blurred;
    dvec3 sum = double(f.ambient) * s.occlusion * sky;
    return sum + lightsOn(s, n, point, dvec3(0.04), draws, past) + s.emissive;
}

}  // namespace stipple::reference
