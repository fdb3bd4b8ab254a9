#include "engine/scene/surfels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "engine/base/numbers.h"
#include "engine/scene/borders.h"
#include "engine/scene/even_places.h"
#include "engine/scene/pieces.h"
#include "engine/scene/texture_lookup.h"
#include "lod/builder/morton.h"
#include "lod/primitives/in_memory.h"
#include "shaders/shared/border.h"
#include "shaders/shared/record.h"

namespace stipple::scene {
namespace {

constexpr uint64_t kMostSurfels = 200'000'000;
/// How far samples keep apart, in spacings (the root of the area of one), and how often as many darts are thrown as
/// samples are wanted: on a plane as many as are wanted then find a place, and of its places one in 400,000 lies
/// farther than kReach from all of them. Such is the radius of their discs (that of opaque parts in ewa, too).
constexpr double kApart = 0.73, kReach = 1.03;
constexpr uint32_t kPasses = 8;
/// A piece of triangles that is smaller than so many samples is no surface, but a leaf or a part among others.
constexpr double kPieceSamples = 8, kMostUnknown = 0.1;

uint32_t byteOf(float linear) {
    return unitToByte(shared::srgbFromLinear(linear > 0.0f ? std::min(linear, 1.0f) : 0.0f));
}

uint32_t hashOf(uint32_t v) {
    v ^= v >> 16;
    v *= 0x7feb352du;
    v ^= v >> 15;
    v *= 0x846ca68bu;
    return v ^ v >> 16;
}

struct Surfels {
    std::vector<glm::dvec3> position;
    std::vector<glm::vec3> normal;
    std::vector<float> radius;  ///< 0: not known
    std::vector<uint32_t> colour;
    std::vector<uint8_t> material;  ///< into `materials`
    std::vector<lod::PointMaterial> materials;
    uint64_t cutOut = 0;  ///< samples that an alpha mask leaves out
};

class Sampler {
  public:
    Sampler(const Scene& scene, const std::vector<DecodedImage>& images, const SurfelSettings& settings)
        : scene_(scene), images_(images), settings_(settings) {
        chooseList();
    }

    Result<Surfels> run() {
        const std::vector<glm::dmat4> world = scene_.worldTransforms();
        const std::vector<bool> visible = scene_.visibility();
        double area = 0;
        uint64_t points = 0;
        const auto each = [&](const auto& f) {
            for (size_t n = 0; n < scene_.nodes.size(); ++n) {
                const Node& node = scene_.nodes[n];
                if (node.mesh < 0 || !visible[n]) continue;
                std::vector<glm::dmat4> places = node.instances;
                if (places.empty()) places.emplace_back(1);
                for (const glm::dmat4& place : places)
                    for (const Primitive& p : scene_.meshes[static_cast<size_t>(node.mesh)].primitives)
                        f(p, world[n] * place);
            }
        };
        each([&](const Primitive& p, const glm::dmat4& m) {
            if (p.kind == PrimitiveKind::points) points += p.indices.size();
            if (p.kind == PrimitiveKind::triangles && settings_.count > 0)
                for (size_t i = 0; i + 3 <= p.indices.size(); i += 3) area += areaOf(corners(p, m, i));
        });
        if (!(area > 0) && points == 0) return fail(ErrorKind::input, "holds no triangles and no points", scene_.path);
        if (!std::isfinite(area)) return fail(ErrorKind::input, "its triangles have no finite area", scene_.path);
        if (settings_.count > kMostSurfels || points > kMostSurfels)
            return fail(ErrorKind::budget, fmt::format("more than {} surfels", kMostSurfels), scene_.path);
        perArea_ = area > 0 ? static_cast<double>(settings_.count) / area : 0;
        spacing_ = perArea_ > 0 ? 1 / std::sqrt(perArea_) : 0;
        if (perArea_ > 0) places_.emplace(kApart * spacing_, settings_.count);
        for (pass_ = 0; pass_ < (places_ ? kPasses : 0); ++pass_) {
            carry_ = std::fmod(0.5 + 0.6180339887498949 * pass_, 1.0);  // (other triangles get the darts)
            piecesBefore_ = 0;
            each([&](const Primitive& p, const glm::dmat4& m) {
                if (p.kind == PrimitiveKind::triangles) sampleTriangles(p, m);
            });
        }
        each([&](const Primitive& p, const glm::dmat4& m) {
            if (p.kind == PrimitiveKind::points) takePoints(p, m);
        });
        if (settings_.count == 0) takeBorders(each);
        // Foliage is no surface: how wide its discs are is told by what is around each.
        const auto unknown = static_cast<size_t>(std::count(out_.radius.begin(), out_.radius.end(), 0.0f));
        if (static_cast<double>(unknown) > kMostUnknown * static_cast<double>(out_.radius.size())) out_.radius.clear();
        if (!hasMaterials_) {
            out_.material.clear();
            out_.materials.clear();
        }
        return std::move(out_);
    }

  private:
    using Corners = std::array<glm::dvec3, 3>;
    static Corners corners(const Primitive& p, const glm::dmat4& m, size_t i) {
        Corners c;
        for (size_t k = 0; k < 3; ++k) c.at(k) = glm::dvec3(m * glm::dvec4(p.at(p.indices[i + k]), 1));
        return c;
    }
    static double areaOf(const Corners& c) {
        const double a = 0.5 * glm::length(glm::cross(c[1] - c[0], c[2] - c[0]));
        return std::isfinite(a) ? a : 0;
    }

    /// First indices of the triangles of a primitive, along a curve through space: what is left over of one goes to the
    /// next, so that those in any order would give small triangles no even samples, but clumps and gaps.
    static std::vector<size_t> inSpace(const Primitive& p) {
        glm::dvec3 least(std::numeric_limits<double>::max()), most(-least);
        for (const uint32_t i : p.indices) {
            least = glm::min(least, p.at(i));
            most = glm::max(most, p.at(i));
        }
        const glm::dvec3 size = most - least;
        const double edge = std::max({size.x, size.y, size.z, 1e-300});
        std::vector<std::pair<uint64_t, size_t>> keys;
        keys.reserve(p.indices.size() / 3);
        for (size_t i = 0; i + 3 <= p.indices.size(); i += 3) {
            const glm::dvec3 middle =
                (p.at(p.indices[i]) + p.at(p.indices[i + 1]) + p.at(p.indices[i + 2])) * (1.0 / 3.0);
            uint64_t key = 0;
            for (int k = 0; k < 3; ++k) {
                const double cells = (middle[k] - least[k]) / edge * 0x1fffff;
                key |= lod::spreadBits(cells > 0 && cells <= 0x1fffff ? static_cast<uint64_t>(cells) : 0) << k;
            }
            keys.emplace_back(key, i);
        }
        std::sort(keys.begin(), keys.end());
        std::vector<size_t> firsts;
        firsts.reserve(keys.size());
        for (const auto& [key, first] : keys) firsts.push_back(first);
        return firsts;
    }

    /// A pass of darts: as many as samples are wanted, of which those stay that are not too near to others.
    void sampleTriangles(const Primitive& p, const glm::dmat4& m) {
        auto known = known_.find(&p);
        if (known == known_.end()) known = known_.emplace(&p, Known{inSpace(p), piecesOf(p)}).first;
        const Pieces& pieces = known->second.pieces;
        const glm::dmat3 linear(m);
        const Turned turned = turnedBy(linear);
        const double least =
            kPieceSamples * spacing_ * spacing_ / std::pow(std::abs(glm::determinant(linear)), 2.0 / 3);
        const uint64_t before = std::exchange(piecesBefore_, piecesBefore_ + pieces.area.size());
        for (const size_t i : known->second.order) {
            const Corners c = corners(p, m, i);
            const double area = areaOf(c);
            // What is left over goes to the next triangle: small ones get a sample every so often.
            carry_ += area * perArea_;
            const auto count = static_cast<uint64_t>(carry_);
            carry_ -= static_cast<double>(count);
            if (count == 0) continue;
            const float footprint = textureFootprint(p, i, area);
            const uint32_t seed = hashOf(triangle_++);
            for (uint64_t s = 0; s < count; ++s) {
                double u = hashOf(seed + 2 * static_cast<uint32_t>(s) + 1) * 0x1p-32,
                       v = hashOf(~seed + 2 * static_cast<uint32_t>(s) + 2) * 0x1p-32;
                if (u + v > 1) {
                    u = 1 - u;
                    v = 1 - v;
                }
                const glm::dvec3 b(1 - u - v, u, v);
                if (out_.position.size() >= settings_.count) return;
                const uint32_t piece = pieces.of[i / 3];
                const SurfacePlace place{b.x * c[0] + b.y * c[1] + b.z * c[2], normalAt(p, turned, c, i, b),
                                         before + piece};
                if (!places_->isFree(place) || !takeSample(p, i, b, place.at, place.normal, footprint)) continue;
                places_->add(place);
                if (pieces.area[piece] >= least) out_.radius.back() = static_cast<float>(kReach * spacing_);
            }
        }
    }

    /// How normals of a mesh stand in the world.
    struct Turned {
        glm::dmat3 normals;
        bool isMirrored;
    };
    static Turned turnedBy(const glm::dmat3& linear) {
        return {glm::transpose(glm::inverse(linear)), glm::determinant(linear) < 0};
    }
    /// At the place `b` (barycentric) of the triangle whose indices begin at `i`.
    static glm::vec3 normalAt(const Primitive& p, const Turned& m, const Corners& c, size_t i, const glm::dvec3& b) {
        glm::dvec3 n = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
        if (m.isMirrored) n = -n;
        if (p.normal.empty()) return glm::vec3(n);
        glm::dvec3 mixed(0);
        for (size_t k = 0; k < 3; ++k) mixed += b[static_cast<int>(k)] * glm::dvec3(p.normal[p.indices[i + k]]);
        mixed = m.normals * mixed;
        const double length = glm::length(mixed);
        return glm::vec3(length > 1e-12 && std::isfinite(length) ? mixed / length : n);
    }

    /// The place `b` of a triangle, which lies at `at` and faces along `n`. False where it is transparent.
    bool takeSample(const Primitive& p, size_t i, const glm::dvec3& b, const glm::dvec3& at, const glm::vec3& n,
                    float footprint) {
        glm::vec3 colour(1);
        if (!colourAt(p, i, glm::vec3(b), footprint, colour)) {
            out_.cutOut += pass_ == 0 ? 1 : 0;
            return false;
        }
        out_.position.push_back(at);
        out_.normal.push_back(n);
        out_.radius.push_back(0);
        out_.colour.push_back(byteOf(colour.r) | byteOf(colour.g) << 8 | byteOf(colour.b) << 16);
        out_.material.push_back(numberOf(surfaceAt(p, i, glm::vec3(b), footprint)));
        return true;
    }

    /// Where triangles end beside points, points that join both.
    template <typename Each>
    void takeBorders(const Each& each) {
        struct Triangle {
            const Primitive* primitive;
            glm::dmat4 world;
            size_t first;
        };
        std::vector<Triangle> triangles;
        std::vector<Corners> all;
        each([&](const Primitive& p, const glm::dmat4& m) {
            if (p.kind != PrimitiveKind::triangles) return;
            for (size_t i = 0; i + 3 <= p.indices.size(); i += 3) {
                const Corners c = corners(p, m, i);
                if (!(areaOf(c) > 0)) continue;
                triangles.push_back({&p, m, i});
                all.push_back(c);
            }
        });
        for (const BorderSample& s : borderSamples(all, out_.position)) {
            const Triangle& t = triangles[s.triangle];
            const Corners& c = all[s.triangle];
            const glm::dvec3& b = s.weight;
            const glm::vec3 n = normalAt(*t.primitive, turnedBy(glm::dmat3(t.world)), c, t.first, b);
            if (takeSample(*t.primitive, t.first, b, b.x * c[0] + b.y * c[1] + b.z * c[2], n, 1))
                out_.colour.back() |= shared::kFlagBorder << 24;
        }
    }

    void takePoints(const Primitive& p, const glm::dmat4& m) {
        const float footprint = pointFootprint(p);
        for (size_t k = 0; k < p.indices.size(); ++k) {
            const uint32_t i = p.indices[k];
            glm::vec3 c(1);
            if (!colourAt(p, k, {1, 0, 0}, footprint, c)) {
                ++out_.cutOut;
                continue;
            }
            out_.position.emplace_back(m * glm::dvec4(p.at(i), 1));
            out_.radius.push_back(0);
            out_.normal.push_back(p.normal.empty() ? glm::vec3(0) : glm::vec3(glm::dmat3(m) * glm::dvec3(p.normal[i])));
            out_.colour.push_back(byteOf(c.r) | byteOf(c.g) << 8 | byteOf(c.b) << 16);
            out_.material.push_back(numberOf(surfaceAt(p, k, {1, 0, 0}, footprint)));
        }
    }
    /// Texels between neighbours, were the primitive's points spread evenly over what they occupy of the texture (cells
    /// of about four points each); charts that lie over each other count as one, so that theirs is too small.
    float pointFootprint(const Primitive& p) const {
        const TextureUse& use = materialOf(p).baseColourTexture;
        const DecodedImage* image = imageOf(use);
        if (!image || image->rgba.empty() || static_cast<size_t>(use.uvSet) >= p.uv.size()) return 1;
        const double w = image->width, h = image->height;
        std::vector<glm::dvec2> texels;
        glm::dvec2 least(1e300), most(-1e300);
        for (size_t k = 0; k < p.indices.size(); ++k) {
            const glm::dvec2 at = glm::dvec2(uvAt(p, use, k, {1, 0, 0})) * glm::dvec2(w, h);
            if (!std::isfinite(at.x + at.y)) continue;
            texels.push_back(at);
            least = glm::min(least, at);
            most = glm::max(most, at);
        }
        if (texels.size() < 2) return 1;
        const auto count = static_cast<double>(texels.size());
        const glm::dvec2 size = glm::max(most - least, glm::dvec2(1));
        const double cell = std::sqrt(4 * size.x * size.y / count);
        std::vector<uint64_t> cells;
        for (const glm::dvec2& at : texels) {
            const glm::dvec2 in = glm::min((at - least) / cell, glm::dvec2(4e9));
            cells.push_back(static_cast<uint64_t>(in.x) << 32 | static_cast<uint64_t>(in.y));
        }
        std::sort(cells.begin(), cells.end());
        const auto occupied = static_cast<double>(std::unique(cells.begin(), cells.end()) - cells.begin());
        // (Cells reach beyond the outermost points: a texel and a quarter is one.)
        const double between = cell * std::sqrt(occupied / count);
        return static_cast<float>(between < 1.25 ? 1 : std::min(between, 1024.0));
    }

    /// The number of a material in the list: each once, or the grid where textures say what materials are.
    uint8_t numberOf(const lod::PointMaterial& m) {
        if (isGrid_) return lod::gridIndex(double{m.roughness}, double{m.metallic});
        const auto known = std::find(out_.materials.begin(), out_.materials.end(), m);
        const auto number = static_cast<uint8_t>(known - out_.materials.begin());
        if (known == out_.materials.end()) out_.materials.push_back(m);
        return number;
    }
    void chooseList() {
        isGrid_ = scene_.materials.size() + 2 > lod::kMostPointMaterials;
        for (const Material& m : scene_.materials) isGrid_ = isGrid_ || m.metallicRoughnessTexture.texture >= 0;
        if (isGrid_) out_.materials = lod::materialGrid();
    }
    /// The material of a sample; see colourAt. Without any it is matte. (The format's own, which is metal, would be
    /// black.)
    lod::PointMaterial surfaceAt(const Primitive& p, size_t i, const glm::vec3& b, float footprint) {
        if (p.material < 0) return {};
        hasMaterials_ = true;
        const Material& m = materialOf(p);
        const TextureUse& use = m.metallicRoughnessTexture;
        const DecodedImage* image = imageOf(use);
        if (!image || static_cast<size_t>(use.uvSet) >= p.uv.size()) return {m.roughness, m.metallic};
        const glm::vec4 texel =
            lookup(*image, scene_.textures[static_cast<size_t>(use.texture)], uvAt(p, use, i, b), footprint, false);
        return {m.roughness * texel.g, m.metallic * texel.b};
    }

    const Material& materialOf(const Primitive& p) const {
        static const Material plain;
        return p.material < 0 ? plain : scene_.materials[static_cast<size_t>(p.material)];
    }
    const DecodedImage* imageOf(const TextureUse& use) const {
        if (use.texture < 0) return nullptr;
        const int image = scene_.textures[static_cast<size_t>(use.texture)].image;
        return image < 0 ? nullptr : &images_[static_cast<size_t>(image)];
    }
    /// At a place of a triangle, or at a point.
    template <typename T>
    static T valueAt(const Primitive& p, const std::vector<T>& of, size_t i, const glm::vec3& b) {
        if (p.kind == PrimitiveKind::points) return of[p.indices[i]];
        return b.x * of[p.indices[i]] + b.y * of[p.indices[i + 1]] + b.z * of[p.indices[i + 2]];
    }
    static glm::vec2 uvAt(const Primitive& p, const TextureUse& use, size_t i, const glm::vec3& b) {
        const glm::vec2 at = valueAt(p, p.uv[static_cast<size_t>(use.uvSet)], i, b);
        return glm::vec2(use.transform * glm::vec3(at, 1));
    }

    /// Texels that one surfel covers along each axis.
    float textureFootprint(const Primitive& p, size_t i, double area) const {
        const TextureUse& use = materialOf(p).baseColourTexture;
        const DecodedImage* image = imageOf(use);
        if (!image || image->rgba.empty() || static_cast<size_t>(use.uvSet) >= p.uv.size()) return 1;
        const glm::vec2 a = uvAt(p, use, i, {1, 0, 0}), d = uvAt(p, use, i, {0, 1, 0}) - a,
                        e = uvAt(p, use, i, {0, 0, 1}) - a;
        const double texels = 0.5 * std::abs(static_cast<double>(d.x) * e.y - static_cast<double>(d.y) * e.x) *
                              image->width * image->height;
        return static_cast<float>(std::clamp(std::sqrt(texels / std::max(area, 1e-300)) * spacing_, 1.0, 1024.0));
    }

    /// False where an alpha mask (or blending below one half) leaves nothing.
    bool colourAt(const Primitive& p, size_t i, const glm::vec3& b, float footprint, glm::vec3& colour) const {
        const Material& m = materialOf(p);
        glm::vec4 c = m.baseColour;
        if (!p.colour.empty()) c *= valueAt(p, p.colour, i, b);
        const auto texel = [&](const TextureUse& use) {
            const DecodedImage* image = imageOf(use);
            if (!image || static_cast<size_t>(use.uvSet) >= p.uv.size()) return glm::vec4(1);
            return lookup(*image, scene_.textures[static_cast<size_t>(use.texture)], uvAt(p, use, i, b), footprint);
        };
        c *= texel(m.baseColourTexture);
        if (m.alphaMode != AlphaMode::opaque && c.a < (m.alphaMode == AlphaMode::mask ? m.alphaCutoff : 0.5f))
            return false;
        colour = glm::vec3(c);
        if (m.emissive != glm::vec3(0)) colour += m.emissive * glm::vec3(texel(m.emissiveTexture));
        return true;
    }

    const Scene& scene_;
    const std::vector<DecodedImage>& images_;
    SurfelSettings settings_;
    double perArea_ = 0, spacing_ = 0, carry_ = 0.5;
    uint32_t triangle_ = 0, pass_ = 0;
    std::optional<EvenPlaces> places_;
    struct Known {
        std::vector<size_t> order;  ///< inSpace
        Pieces pieces;
    };
    std::map<const Primitive*, Known> known_;
    uint64_t piecesBefore_ = 0;                   ///< of primitives before this one, copies included
    bool isGrid_ = false, hasMaterials_ = false;  ///< the list is the grid; some primitive names a material
    Surfels out_;
};

}  // namespace

Result<lod::PointSource> sampleSurfels(const Scene& scene, const std::vector<DecodedImage>& images,
                                       const SurfelSettings& settings) {
    STIPPLE_ASSIGN(Surfels sampled, Sampler(scene, images, settings).run());
    if (sampled.position.empty()) return fail(ErrorKind::input, "is transparent everywhere", scene.path);
    lod::SourceInfo info;
    info.path = scene.path;
    info.format = "meshes, sampled";
    info.isReflectance = true;
    info.materials = std::move(sampled.materials);
    info.up = lod::UpAxis::y;
    info.notes = scene.notes;
    if (sampled.cutOut > 0)
        info.notes.push_back(fmt::format("{} samples lie where the material is transparent", sampled.cutOut));
    lod::PointBlock points;
    points.position = std::move(sampled.position);
    points.normal = std::move(sampled.normal);
    points.radius = std::move(sampled.radius);
    points.colour = std::move(sampled.colour);
    points.material = std::move(sampled.material);
    return lod::pointsInMemory(std::move(info), std::move(points));
}

}  // namespace stipple::scene
