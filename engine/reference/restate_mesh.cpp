// Triangles once more, in fp64, from the definitions: clipping at the near plane, coverage by the top-left rule on
// corners snapped to 1/256 pixel, attributes where the ray through the pixel meets the triangle's plane; the material
// and light model of glTF 2.0 (appendix B).
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/reference/decode.h"
#include "engine/reference/restate.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;
using glm::dvec4;

constexpr double kPi = 3.14159265358979323846;

struct Corner {
    dvec3 at{0}, normal{0};  ///< camera space
    dvec4 colour{1};         ///< linear
    dvec2 uv{0};
};

dvec3 octahedral(uint32_t code) {
    dvec3 n((code % 65536) / 32767.0 - 1, (code / 65536) / 32767.0 - 1, 0);
    n.z = 1 - std::abs(n.x) - std::abs(n.y);
    if (n.z < 0) n = {(1 - std::abs(n.y)) * (n.x >= 0 ? 1 : -1), (1 - std::abs(n.x)) * (n.y >= 0 ? 1 : -1), n.z};
    return glm::normalize(n);
}

/// Textures of one instance.
struct TextureReader {
    const render::MeshTextures& textures;
    const Chunks& chunks;

    bool level(const shared::TextureInfo& info, uint32_t l, dvec2 uv, dvec4& out) const {
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
                c = wrap.at(k) == shared::kWrapMirror && std::fmod(std::abs(whole), 2.0) == 1 ? 1 - (c - whole)
                                                                                              : c - whole;
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

    /// Trilinear; (1, 1, 1, 1) stays where nothing is resident.
    bool sample(const shared::TextureSlot& slot, dvec2 at, double footprint, dvec4& out) const {
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
};

class MeshProjector {
  public:
    MeshProjector(const render::DrawList& draws, const Chunks& chunks, Level& level)
        : draws_(draws), chunks_(chunks), level_(level), view_(draws.view) {}

    void run() {
        uint32_t last = ~0u;
        size_t mesh = 0;
        for (const lod::CutMeshDraw& cut : draws_.meshCut) {
            if (cut.instance != last && last != ~0u) ++mesh;
            last = cut.instance;
            const lod::Instance& instance = draws_.instances[cut.instance];
            const lod::Hierarchy& h = *draws_.hierarchies[instance.hierarchy];
            const lod::Chunk& chunk = chunks_.at(uint64_t{instance.source} << 32 | cut.node);
            const TextureReader textures{draws_.meshTextures[mesh], chunks_};
            const uint32_t firstMaterial = draws_.firstMaterial[instance.hierarchy];
            for (uint32_t c = cut.firstCluster; c < cut.firstCluster + cut.clusters; ++c) {
                const shared::MeshCluster& cluster = chunk.clusters.at(c);
                for (uint32_t t = 0; t < cluster.counts >> 16; ++t) {
                    const uint32_t word = chunk.triangles.at(cluster.firstTriangle + t);
                    std::array<Corner, 3> corners;
                    const auto vertex = [&](uint32_t k) -> const shared::MeshVertex& {
                        return chunk.vertices.at(cluster.firstVertex + (word >> (8 * k)) % 256);
                    };
                    for (uint32_t k = 0; k < 3; ++k) corners.at(k) = cornerOf(h, instance, vertex(k));
                    const uint32_t surface = vertex(0).surface;
                    triangle(corners, surface, draws_.materials[firstMaterial + surface % 65536], textures, cut,
                             h.nodes[cut.node].level);
                }
            }
        }
    }

  private:
    dvec3 toCamera(const dvec3& v) const {
        return {glm::dot(v, view_.right), glm::dot(v, view_.down), glm::dot(v, view_.forward)};
    }
    Corner cornerOf(const lod::Hierarchy& h, const lod::Instance& instance, const shared::MeshVertex& v) const {
        Corner c;
        c.at = toCamera(instance.translation +
                        instance.rotation * (instance.scale * (h.origin + h.unit * dvec3(v.x, v.y, v.z))) - view_.eye);
        c.normal = toCamera(instance.rotation * octahedral(v.normal));
        c.colour = {decodeSrgb(v.colour & 255u), decodeSrgb(v.colour >> 8 & 255u), decodeSrgb(v.colour >> 16 & 255u),
                    (v.colour >> 24) / 255.0};
        c.uv = {v.u, v.v};
        return c;
    }

    void triangle(const std::array<Corner, 3>& c, uint32_t surface, const shared::SurfaceMaterial& material,
                  const TextureReader& textures, const lod::CutMeshDraw& cut, uint32_t treeLevel) {
        const dvec3 face = glm::cross(c[1].at - c[0].at, c[2].at - c[0].at);
        const double facing = glm::dot(face, c[0].at);
        if (facing == 0 || (facing > 0 && (surface & shared::kSurfaceTwoSided) == 0)) return;
        // What is in front of the near plane, as a polygon on the screen.
        std::vector<dvec3> polygon;
        for (size_t k = 0; k < 3; ++k) {
            const dvec3 &a = c.at(k).at, &b = c.at((k + 1) % 3).at;
            if (a.z >= view_.nearPlane) polygon.push_back(a);
            if ((a.z >= view_.nearPlane) != (b.z >= view_.nearPlane))
                polygon.push_back(a + (b - a) * ((view_.nearPlane - a.z) / (b.z - a.z)));
        }
        if (polygon.size() < 3) return;
        std::vector<dvec2> snapped;  // in 1/256 pixel, whole
        for (const dvec3& p : polygon)
            snapped.push_back(glm::floor(
                (view_.focalPixels * dvec2(p) / p.z + 0.5 * dvec2(view_.width, view_.height)) * 256.0 + 0.5));
        for (size_t k = 1; k + 1 < polygon.size(); ++k)
            cover({snapped[0], snapped[k], snapped[k + 1]},
                  [&](int x, int y) { pixel(x, y, c, face, surface, material, textures, cut, treeLevel); });
    }

    template <typename Use>
    void cover(std::array<dvec2, 3> p, const Use& use) const {
        const auto cross = [](const dvec2& a, const dvec2& b) { return a.x * b.y - a.y * b.x; };
        const double area = cross(p[1] - p[0], p[2] - p[0]);
        if (area == 0) return;
        if (area < 0) std::swap(p[1], p[2]);
        const dvec2 lo = glm::min(p[0], glm::min(p[1], p[2])), hi = glm::max(p[0], glm::max(p[1], p[2]));
        const int x0 = static_cast<int>(std::max(0.0, std::floor(lo.x / 256))),
                  x1 = static_cast<int>(std::min(view_.width - 1.0, std::floor(hi.x / 256))),
                  y0 = static_cast<int>(std::max(0.0, std::floor(lo.y / 256))),
                  y1 = static_cast<int>(std::min(view_.height - 1.0, std::floor(hi.y / 256)));
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) {
                const dvec2 centre(x * 256 + 128, y * 256 + 128);
                bool isIn = true;
                for (size_t k = 0; k < 3; ++k) {
                    const dvec2 edge = p.at((k + 1) % 3) - p.at(k);
                    const double side = cross(edge, centre - p.at(k));
                    const bool isTopLeftEdge = edge.y < 0 || (edge.y == 0 && edge.x > 0);
                    isIn = isIn && (side > 0 || (side == 0 && isTopLeftEdge));
                }
                if (isIn) use(x, y);
            }
    }

    dvec3 rayThrough(double x, double y) const {
        return {(x - 0.5 * view_.width) / view_.focalPixels, (y - 0.5 * view_.height) / view_.focalPixels, 1};
    }

    /// Weights of the second and third corner where the ray meets the triangle's plane.
    static dvec2 weightsOn(const dvec3& ray, const std::array<Corner, 3>& c, const dvec3& face) {
        const dvec3 e1 = c[1].at - c[0].at, e2 = c[2].at - c[0].at;
        const dvec3 off = ray * (glm::dot(face, c[0].at) / glm::dot(face, ray)) - c[0].at;
        const double f2 = glm::dot(face, face);
        return {glm::dot(glm::cross(off, e2), face) / f2, glm::dot(glm::cross(e1, off), face) / f2};
    }

    void pixel(int x, int y, const std::array<Corner, 3>& c, const dvec3& face, uint32_t surface,
               const shared::SurfaceMaterial& m, const TextureReader& textures, const lod::CutMeshDraw& cut,
               uint32_t treeLevel) {
        const dvec3 ray = rayThrough(x + 0.5, y + 0.5);
        const dvec2 exact = weightsOn(ray, c, face);
        const double wb = std::clamp(exact.x, 0.0, 1.0), wc = std::clamp(exact.y, 0.0, 1.0 - wb), wa = 1 - wb - wc;
        const double depth = (wa * c[0].at + wb * c[1].at + wc * c[2].at).z;
        Sample& s = level_.ref(x, y);
        if (s.valid && s.depth <= depth) return;
        const dvec2 uv = wa * c[0].uv + wb * c[1].uv + wc * c[2].uv;
        const dvec4 own = wa * c[0].colour + wb * c[1].colour + wc * c[2].colour;
        // Texture coordinates at the neighbouring pixels' centres, on the same plane.
        const auto uvAt = [&](double px, double py) {
            const dvec2 w = weightsOn(rayThrough(px, py), c, face);
            return (1 - w.x - w.y) * c[0].uv + w.x * c[1].uv + w.y * c[2].uv;
        };
        const double h = 1e-3;
        const double footprint = std::max(glm::length(uvAt(x + 0.5 + h, y + 0.5) - uvAt(x + 0.5 - h, y + 0.5)),
                                          glm::length(uvAt(x + 0.5, y + 0.5 + h) - uvAt(x + 0.5, y + 0.5 - h))) /
                                 (2 * h);
        dvec4 texel(1);
        const bool hasBase = textures.sample(m.baseTexture, uv, footprint, texel);
        if ((surface & shared::kSurfaceMasked) != 0 && m.alpha * own.w * (hasBase ? texel.w : 1) < m.alphaCutoff)
            return;
        s = {};
        s.valid = s.isTriangle = true;
        s.isUnlit = (surface & shared::kSurfaceUnlit) != 0;
        s.depth = depth;
        s.radius = 0.25;
        s.thickness = 0.25 * depth / view_.focalPixels;
        s.centre = dvec2(x + 0.5, y + 0.5);
        s.colour = dvec3(m.baseColour) * dvec3(own) * (hasBase ? dvec3(texel) : dvec3(1));
        s.metallic = m.metallic;
        s.roughness = m.roughness;
        s.emissive = dvec3(m.emissive);
        if (textures.sample(m.surfaceTexture, uv, footprint, texel)) {
            s.roughness *= texel.y;
            s.metallic *= texel.z;
        }
        if (textures.sample(m.occlusionTexture, uv, footprint, texel))
            s.occlusion = 1 + m.occlusionStrength * (texel.x - 1);
        if (textures.sample(m.emissiveTexture, uv, footprint, texel)) s.emissive *= dvec3(texel);
        dvec3 n = (surface & shared::kSurfaceFlat) != 0 ? face : wa * c[0].normal + wb * c[1].normal + wc * c[2].normal;
        if (textures.sample(m.normalTexture, uv, footprint, texel)) n = bump(n, c, dvec3(texel), m.normalScale);
        if (glm::dot(face, ray) > 0) n = -n;
        const dvec3 v = glm::normalize(ray);
        n -= std::max(0.0, glm::dot(n, v)) * v;
        n = glm::length(n) > 0 ? glm::normalize(n) : -v;
        s.perp = dvec2(rotationToZ(v) * n);
        const shared::FrameConstants& f = draws_.frame;
        const double t = f.debugView == shared::kDebugLevel
                             ? (treeLevel % 8) / 7.0
                             : std::clamp((std::log2(std::max(1e-6, double(cut.errorPixels))) + 3) / 6, 0.0, 1.0);
        const auto hat = [&](double middle) { return std::clamp(1.5 - std::abs(4 * t - middle), 0.0, 1.0); };
        if (f.debugView == shared::kDebugLevel || f.debugView == shared::kDebugError)
            s.colour = {hat(3), hat(2), hat(1)};
    }

    /// A tangent-space normal: x along growing u, y against growing v.
    static dvec3 bump(const dvec3& normal, const std::array<Corner, 3>& c, const dvec3& texel, double scale) {
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

    const render::DrawList& draws_;
    const Chunks& chunks_;
    Level& level_;
    const lod::View& view_;
};

/// Times pi, as a light's colour is what a white diffuse surface sends back.
dvec3 reflected(const Sample& s, const dvec3& n, const dvec3& v, const dvec3& l, const dvec3& light) {
    const double nl = glm::dot(n, l), nv = std::max(glm::dot(n, v), 1e-3);
    if (!(nl > 0)) return dvec3(0);
    const dvec3 h = glm::normalize(l + v);
    const double nh = std::max(0.0, glm::dot(n, h)), vh = std::max(0.0, glm::dot(v, h));
    const double alpha2 = std::pow(std::max(s.roughness * s.roughness, 2e-3), 2);
    const double ggx = alpha2 / (kPi * std::pow(nh * nh * (alpha2 - 1) + 1, 2));
    const double visible =
        0.5 / (nl * std::sqrt(nv * nv * (1 - alpha2) + alpha2) + nv * std::sqrt(nl * nl * (1 - alpha2) + alpha2));
    const dvec3 f0 = glm::mix(dvec3(0.04), s.colour, s.metallic);
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

/// The octahedral maps, between two of the five roughnesses.
dvec3 mirrored(const std::vector<float>& t, const dvec3& direction, double roughness) {
    const dvec3 d = direction / (std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z));
    dvec2 p(d.x, d.z);
    if (d.y < 0) p = {(1 - std::abs(d.z)) * (d.x >= 0 ? 1 : -1), (1 - std::abs(d.x)) * (d.z >= 0 ? 1 : -1)};
    p = glm::clamp((p * 0.5 + 0.5) * 128.0 - 0.5, dvec2(0), dvec2(126.999));
    const auto at = [&](size_t level, size_t x, size_t y) {
        const size_t i = 27 + ((level * 128 + y) * 128 + x) * 3;
        return dvec3(t[i], t[i + 1], t[i + 2]);
    };
    const auto look = [&](size_t level) {
        const auto x = static_cast<size_t>(p.x), y = static_cast<size_t>(p.y);
        const dvec2 part = p - glm::floor(p);
        return glm::mix(glm::mix(at(level, x, y), at(level, x + 1, y), part.x),
                        glm::mix(at(level, x, y + 1), at(level, x + 1, y + 1), part.x), part.y);
    };
    const double l = std::clamp(roughness, 0.0, 1.0) * 4;
    const auto level = static_cast<size_t>(std::min(l, 3.999));
    return glm::mix(look(level), look(level + 1), l - static_cast<double>(level));
}

}  // namespace

void projectMeshes(const render::DrawList& draws, const Chunks& chunks, Level& level) {
    MeshProjector(draws, chunks, level).run();
}

dvec3 shadeTriangle(const Sample& s, const dvec3& n, const dvec3& point, const render::DrawList& draws) {
    const shared::FrameConstants& f = draws.frame;
    if (s.isTriangle && (s.isUnlit || (f.shade & shared::kShadeTriangles) == 0)) return s.colour;
    const dvec3 v = -glm::normalize(point), up(f.skyDirection);
    const double nv = std::max(glm::dot(n, v), 1e-3);
    const dvec3 mirror = 2 * nv * n - v;
    // The environment's share of a microfacet mirror (Karis 2013, fit by Lazarov).
    const dvec4 r = s.roughness * dvec4(-1, -0.0275, -0.572, 0.022) + dvec4(1, 0.0425, 1.04, -0.04);
    const double a004 = std::min(r.x * r.x, std::exp2(-9.28 * nv)) * r.x + r.y;
    const dvec2 ab = dvec2(-1.04, 1.04) * a004 + dvec2(r.z, r.w);
    const dvec3 f0 = glm::mix(dvec3(0.04), s.colour, s.metallic);
    dvec3 blurred(0.25 + 0.15 * glm::dot(glm::mix(mirror, n, s.roughness), up)), around(0.25 + 0.15 * glm::dot(n, up));
    if (draws.environment) {
        const glm::dmat3 toMap =
            glm::transpose(glm::dmat3(dvec3(f.environmentX), dvec3(f.environmentY), dvec3(f.environmentZ)));
        around = irradianceAround(draws.environment->table, toMap * n);
        blurred = mirrored(draws.environment->table, toMap * mirror, s.roughness);
    }
    dvec3 sum = double(f.ambient) * s.occlusion * (s.colour * (1 - s.metallic) * around + (f0 * ab.x + ab.y) * blurred);
    if (draws.lights.empty() && !draws.environment) sum += reflected(s, n, v, dvec3(f.sunDirection), dvec3(0.75));
    for (const shared::LightSource& light : draws.lights) {
        const dvec3 colour(light.colour);
        if (light.kind == shared::kLightDirectional) {
            sum += reflected(s, n, v, dvec3(light.position), colour);
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
        sum += reflected(s, n, v, to / distance, colour * share);
    }
    return sum + s.emissive;
}

}  // namespace stipple::reference
