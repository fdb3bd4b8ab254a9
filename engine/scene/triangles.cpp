#include "engine/scene/triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "engine/base/hash.h"
#include "engine/base/numbers.h"
#include "shaders/shared/record.h"

namespace stipple::scene {
namespace {

const std::array<TextureUse Material::*, 5> kUses{&Material::baseColourTexture, &Material::normalTexture,
                                                  &Material::metallicRoughnessTexture, &Material::emissiveTexture,
                                                  &Material::occlusionTexture};

}  // namespace

TextureUse leadingUse(const Material& m) {
    for (const auto use : kUses)
        if ((m.*use).texture >= 0) return m.*use;
    return {};
}

bool isOnLeading(const Scene& scene, const TextureUse& use, const TextureUse& leading) {
    return use.texture >= 0 && use.uvSet == leading.uvSet &&
           scene.textures[static_cast<size_t>(use.texture)].image >= 0;
}

namespace {

/// The last material stands for "none": white, not metallic.
uint32_t materialIndex(const Scene& scene, const Primitive& p) {
    return p.material < 0 ? static_cast<uint32_t>(scene.materials.size()) : static_cast<uint32_t>(p.material);
}

uint32_t surfaceOf(const Scene& scene, const Primitive& p) {
    uint32_t surface = materialIndex(scene, p);
    if (p.normal.empty()) surface |= shared::kSurfaceFlat;
    if (p.material < 0) return surface;
    const Material& m = scene.materials[static_cast<size_t>(p.material)];
    if (m.isDoubleSided) surface |= shared::kSurfaceTwoSided;
    // What is drawn as a layer of its own (engine/render/layers.h) is cut out of what lies behind it.
    if (m.alphaMode != AlphaMode::opaque || !m.optics.isPlain()) surface |= shared::kSurfaceMasked;
    if (m.isUnlit) surface |= shared::kSurfaceUnlit;
    for (const TextureUse* use :
         {&m.baseColourTexture, &m.metallicRoughnessTexture, &m.normalTexture, &m.occlusionTexture, &m.emissiveTexture})
        if (use->texture >= 0) surface |= shared::kSurfaceTextured;
    return surface;
}

bool isClear(const glm::vec4& colour) { return colour.a < 1; }

/// Is hardly a texel that is there at all neither clear nor opaque? Such is a leaf, not a pane.
bool isCutOut(const DecodedImage& image) {
    constexpr uint32_t kClear = 32, kOpaque = 224;  // of 255
    constexpr double kMostBetween = 0.2;            // rims, which are filtered
    size_t there = 0, between = 0;
    for (const uint32_t texel : image.rgba) {
        const uint32_t alpha = texel >> 24;
        there += alpha >= kClear ? 1 : 0;
        between += alpha >= kClear && alpha < kOpaque ? 1 : 0;
    }
    return static_cast<double>(between) <= kMostBetween * static_cast<double>(there);
}

/// Does factor or texture let something through, as far as `images` are known? (JPEG has no alpha.)
bool mayBeClear(const Scene& scene, const Material& m, std::span<const DecodedImage> images) {
    if (m.baseColour.a < 1) return true;
    const int texture = m.baseColourTexture.texture;
    const int image = texture < 0 ? -1 : scene.textures[static_cast<size_t>(texture)].image;
    if (image < 0) return false;
    const auto at = static_cast<size_t>(image);
    if (at < images.size() && !images[at].rgba.empty()) return !isCutOut(images[at]);
    const std::vector<uint8_t>& bytes = scene.images[static_cast<size_t>(image)].bytes;
    return bytes.size() < 2 || bytes[0] != 0xff || bytes[1] != 0xd8;
}

uint32_t packedColour(const glm::vec4& c) {
    const auto byte = [](float linear) {
        return unitToByte(shared::srgbFromLinear(linear > 0.0f ? std::min(linear, 1.0f) : 0.0f));
    };
    return byte(c.r) | byte(c.g) << 8 | byte(c.b) << 16 | unitToByte(c.a) << 24;
}

shared::TextureSlot slotOf(const Scene& scene, const TextureUse& use, const TextureUse& leading) {
    shared::TextureSlot slot{};
    slot.rowU = {1, 0, 0};
    slot.rowV = {0, 1, 0};
    if (!isOnLeading(scene, use, leading)) return slot;
    slot.texture = static_cast<uint32_t>(use.texture) + 1;
    if (use.transform == leading.transform || glm::determinant(leading.transform) == 0) return slot;
    const glm::mat3 t = use.transform * glm::inverse(leading.transform);
    slot.rowU = {t[0][0], t[1][0], t[2][0]};
    slot.rowV = {t[0][1], t[1][1], t[2][1]};
    return slot;
}

}  // namespace

std::vector<Placement> placements(const Scene& scene) {
    std::vector<Placement> out;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    const std::vector<bool> visible = scene.visibility();
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        const Node& node = scene.nodes[n];
        if (node.mesh < 0 || !visible[n]) continue;
        if (node.instances.empty()) out.push_back({node.mesh, world[n]});
        for (const glm::dmat4& place : node.instances) out.push_back({node.mesh, world[n] * place});
    }
    return out;
}

namespace {

/// Vertices of one primitive at one place.
struct PlacedPrimitive {
    PlacedPrimitive(const Scene& scene, const Placement& at, const Primitive& primitive)
        : p(primitive),
          world(at.world),
          surface(surfaceOf(scene, primitive)),
          use(primitive.material < 0 ? TextureUse{}
                                     : leadingUse(scene.materials[static_cast<size_t>(primitive.material)])),
          set(static_cast<size_t>(use.uvSet)),
          hasUv(use.uvSet >= 0 && set < p.uv.size() && !p.uv[set].empty()) {
        const glm::dmat3 linear(at.world);
        // Cofactors turn normals under any scale, flat ones included, and carry the sign of a mirror.
        forNormals = glm::dmat3(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                                glm::cross(linear[0], linear[1]));
        isMirrored = glm::determinant(linear) < 0;
    }
    void copy(size_t i, lod::TriangleMesh& to) const {
        to.position.emplace_back(world * glm::dvec4(p.at(i), 1));
        const glm::dvec3 n = p.normal.empty() ? glm::dvec3(0) : forNormals * glm::dvec3(p.normal[i]);
        const double length = glm::length(n);
        const double sign = isMirrored ? -1 : 1;
        to.normal.emplace_back(length > 0 && std::isfinite(length) ? n * (sign / length) : glm::dvec3(0));
        const glm::vec2 uv = hasUv ? glm::vec2(use.transform * glm::vec3(p.uv[set][i], 1)) : glm::vec2(0);
        to.uv.push_back(std::isfinite(uv.x + uv.y) ? uv : glm::vec2(0));
        to.colour.push_back(p.colour.empty() ? ~0u : packedColour(p.colour[i]));
        to.surface.push_back(surface);
    }

    const Primitive& p;
    glm::dmat4 world;
    uint32_t surface;
    TextureUse use;
    size_t set;
    bool hasUv, isMirrored = false;
    glm::dmat3 forNormals{1};
};

}  // namespace

lod::MeshSource triangleSource(const Scene& scene, std::vector<Placement> placed) {
    using Use = std::function<Result<void>(const Placement&, const Primitive&)>;
    const auto forAll = [&scene, placed = std::move(placed)](const Use& use) -> Result<void> {
        for (const Placement& at : placed)
            for (const Primitive& p : scene.meshes[static_cast<size_t>(at.mesh)].primitives)
                if (p.kind == PrimitiveKind::triangles && p.indices.size() >= 3) STIPPLE_TRY(use(at, p));
        return {};
    };
    lod::MeshSource source;
    static_cast<void>(forAll([&](const Placement&, const Primitive& p) -> Result<void> {
        source.triangles += p.indices.size() / 3;
        source.vertices += p.position.size();
        return {};
    }));
    source.identity = [forAll] {
        uint64_t hash = 0;
        static_cast<void>(forAll([&](const Placement& at, const Primitive& p) -> Result<void> {
            hash = hashBytes(&at.world, sizeof(at.world), hash);
            hash = hashBytes(p.position.data(), p.position.size() * sizeof(p.position[0]), hash);
            hash = hashBytes(p.rest.data(), p.rest.size() * sizeof(p.rest[0]), hash);
            hash = hashBytes(p.indices.data(), p.indices.size() * sizeof(p.indices[0]), hash);
            return {};
        }));
        return hash;
    };
    source.survey = [forAll](const lod::MeshSource::Tell&) -> Result<lod::MeshSource::Bounds> {
        lod::MeshSource::Bounds bounds;
        STIPPLE_TRY(forAll([&](const Placement& at, const Primitive& p) -> Result<void> {
            for (size_t i = 0; i < p.position.size(); ++i) bounds.add(glm::dvec3(at.world * glm::dvec4(p.at(i), 1)));
            return {};
        }));
        return bounds;
    };
    source.read = [&scene, forAll](const lod::MeshSource::Take& take) -> Result<void> {
        std::optional<PlacedPrimitive> now;
        uint64_t first = 0;
        lod::BlockMaker blocks([&](uint64_t v, lod::TriangleMesh& to) { now->copy(v - first, to); }, take);
        const Result<void> read = forAll([&](const Placement& at, const Primitive& p) -> Result<void> {
            now.emplace(scene, at, p);
            const size_t second = now->isMirrored ? 2 : 1, third = now->isMirrored ? 1 : 2;
            for (size_t i = 0; i + 3 <= p.indices.size(); i += 3)
                STIPPLE_TRY(
                    blocks.triangle(first + p.indices[i], first + p.indices[i + second], first + p.indices[i + third]));
            first += p.position.size();
            return {};
        });
        return read ? blocks.finish() : read;
    };
    return source;
}

std::vector<shared::SurfaceMaterial> surfaceMaterials(const Scene& scene) {
    std::vector<shared::SurfaceMaterial> out;
    for (const Material& m : scene.materials) {
        shared::SurfaceMaterial s{};
        const TextureUse leading = leadingUse(m);
        const auto slot = [&](const TextureUse& use) { return slotOf(scene, use, leading); };
        s.baseColour = glm::vec3(m.baseColour);
        s.alpha = m.baseColour.a;
        s.alphaCutoff = m.alphaMode == AlphaMode::opaque ? 0.0f : m.alphaMode == AlphaMode::mask ? m.alphaCutoff : 0.5f;
        s.emissive = m.emissive;
        s.metallic = m.metallic;
        s.roughness = m.roughness;
        s.normalScale = m.normalScale;
        s.occlusionStrength = m.occlusionStrength;
        s.baseTexture = slot(m.baseColourTexture);
        s.surfaceTexture = slot(m.metallicRoughnessTexture);
        s.normalTexture = slot(m.normalTexture);
        s.occlusionTexture = slot(m.occlusionTexture);
        s.emissiveTexture = slot(m.emissiveTexture);
        out.push_back(s);
    }
    shared::SurfaceMaterial plain{};
    plain.baseColour = {1, 1, 1};
    plain.alpha = plain.roughness = plain.normalScale = 1;
    plain.baseTexture = plain.surfaceTexture = plain.normalTexture = plain.occlusionTexture = plain.emissiveTexture =
        slotOf(scene, {}, {});
    out.push_back(plain);
    return out;
}

std::vector<lod::Optics> surfaceOptics(const Scene& scene, const std::vector<Placement>& placed,
                                       std::span<const DecodedImage> images) {
    std::vector<bool> isUsed(scene.materials.size() + 1), hasAlpha(scene.materials.size() + 1);
    for (const Placement& at : placed)
        for (const Primitive& p : scene.meshes[static_cast<size_t>(at.mesh)].primitives) {
            if (p.kind != PrimitiveKind::triangles) continue;
            const uint32_t m = materialIndex(scene, p);
            isUsed[m] = true;
            hasAlpha[m] = hasAlpha[m] || std::any_of(p.colour.begin(), p.colour.end(), isClear);
        }
    // What is opaque all over is drawn as such, whatever its material says.
    const auto of = [&](size_t m) {
        if (m >= scene.materials.size()) return lod::Optics{};
        lod::Optics o = scene.materials[m].optics;
        o.blends = o.blends && (hasAlpha[m] || mayBeClear(scene, scene.materials[m], images));
        return o;
    };
    const auto first = static_cast<size_t>(std::find(isUsed.begin(), isUsed.end(), true) - isUsed.begin());
    std::vector<lod::Optics> out;
    bool isPlain = true;
    for (size_t m = 0; m < isUsed.size(); ++m) {
        out.push_back(of(isUsed[m] || first == isUsed.size() ? m : first));
        isPlain = isPlain && out.back() == lod::Optics{};
    }
    if (isPlain) out.clear();
    return out;
}

std::vector<lod::TextureImage> textureImages(const Scene& scene) {
    std::vector<lod::TextureImage> out(scene.textures.size());
    for (size_t t = 0; t < out.size(); ++t) {
        const auto wrap = [](Wrap w) {
            return w == Wrap::repeat   ? shared::kWrapRepeat
                   : w == Wrap::mirror ? shared::kWrapMirror
                                       : shared::kWrapClamp;
        };
        out[t].wrapU = wrap(scene.textures[t].wrapU);
        out[t].wrapV = wrap(scene.textures[t].wrapV);
        out[t].kind = lod::TextureKind::data;
    }
    const auto set = [&](const TextureUse& use, lod::TextureKind kind) {
        if (use.texture >= 0) out[static_cast<size_t>(use.texture)].kind = kind;
    };
    for (const Material& m : scene.materials) {
        set(m.normalTexture, lod::TextureKind::normal);
        set(m.baseColourTexture, lod::TextureKind::colour);
        set(m.emissiveTexture, lod::TextureKind::colour);
    }
    return out;
}

}  // namespace stipple::scene
