// Elevation patches once more, in fp64: their lifted triangles, or, direct, the discs of their samples.
#include <algorithm>
#include <cmath>

#include "engine/reference/decode_map.h"
#include "engine/reference/decode_patch.h"
#include "engine/reference/kinds.h"
#include "engine/reference/restate_triangles.h"
#include "lod/primitives/patch_samples.h"

namespace stipple::reference {
namespace {

using glm::dvec3;

/// One drawn node of patches.
class PatchProjector {
  public:
    PatchProjector(const render::DrawList& draws, const Chunks& chunks, Level& level, size_t number)
        : draws_(draws),
          chunks_(chunks),
          cut_(draws.cut[number]),
          instance_(draws.instances[cut_.instance]),
          h_(*draws.hierarchies[instance_.hierarchy]),
          bend_(draws.bends.empty() ? render::Bend{} : draws.bends[number]),
          projector_(draws, level, draws.frame.patchAs == shared::kPatchStrips) {}

    void run() {
        const lod::Chunk& chunk = chunks_.at(uint64_t{draws_.firstSource + instance_.source} << 32 | cut_.chunk);
        const Whole whole{cut_.errorPixels, h_.nodes[cut_.node].level, !hasMaterial(chunk)};
        for (uint32_t b = 0; b < cut_.count; ++b) {
            const PatchBlockReader block(h_, h_.nodes[cut_.node], chunk.patchBlocks.at(b), chunk.patchPlanes.at(b));
            const MapReader map(chunk.patchMaps, chunk.patchBlocks[b].map);
            const ShowPlace show = [&](const glm::dvec2& at, double cells, Sample& s, dvec3& n) {
                const MapReader::Look look = map.look(at, cells);
                if (!draws_.onlyMaterial && hasMaterial(chunk)) {
                    s.emissive = look.emission;
                    s.isUnlit = look.unlit >= 0.5;
                }
                if (!map.hasColours()) return;
                s.colour = look.colour;
                if (map.hasNormals()) n = normalOf(block.inStore(look.normal));
                if (!map.hasMaterials() || draws_.onlyMaterial || chunk.materials.empty()) return;
                s.metallic = look.finish.x;
                s.roughness = look.finish.y;
            };
            const auto corner = [&](uint32_t s) {
                Corner made = cornerOfSample(block.sample(s));
                made.uv = {s % 17, s / 17};
                made.finish = finishOf(materialOf(chunk, 153 * b + s));
                return made;
            };
            const TextureReader looks{kNoTextures, chunks_, map.isThere() ? &show : nullptr};
            if (draws_.frame.patchAs == shared::kPatchDirect)
                block.forEachDisc([&](uint32_t s, const PatchBlockReader::CellsAround& cells) {
                    disc(block, s, cells, corner, looks, whole);
                });
            else
                block.forEachTriangle([&](uint32_t a, uint32_t c, uint32_t d) {
                    projector_.triangle({corner(a), corner(c), corner(d)}, shared::kSurfaceTwoSided, kPatchMaterial,
                                        looks, whole);
                });
        }
    }

  private:
    bool hasMaterial(const lod::Chunk& chunk) const {
        return materialOf(chunk, 0) <= 0xffff;  // 16 bits are one
    }
    /// Of the whole picture, the sample's own, or its store's.
    uint32_t materialOf(const lod::Chunk& chunk, uint32_t sample) const {
        if (draws_.onlyMaterial) return *draws_.onlyMaterial;
        if (!chunk.materials.empty()) return chunk.materials.at(sample);
        return instance_.hierarchy < draws_.pointMaterial.size() ? draws_.pointMaterial[instance_.hierarchy] : ~0u;
    }
    glm::dmat3 camera() const { return {draws_.view.right, draws_.view.down, draws_.view.forward}; }
    Corner cornerOfSample(const PatchCorner& of) const {
        Corner c;
        c.at = toCamera(of.place);
        c.normal = normalOf(of.normal);
        c.colour = {of.colour, 1};
        return c;
    }
    /// Of the store's axes to camera space; of a bent surface: perpendicular to its bent tangents.
    dvec3 normalOf(const dvec3& inStore) const {
        const dvec3 n = instance_.rotation * inStore;
        const dvec3 t = glm::cross(n, std::abs(n.x) < 0.5 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)), w = glm::cross(n, t);
        const auto bent = [&](const dvec3& d) { return d + bend_.along * (bend_.slope * glm::dot(bend_.up, d)); };
        return (bend_.isStill() ? n : glm::cross(bent(t), bent(w))) * camera();
    }

    dvec3 toCamera(const dvec3& onLattice) const {
        const dvec3 world =
            instance_.translation + instance_.rotation * (instance_.scale * (h_.origin + h_.unit * onLattice));
        return (bend_.moved(world) - draws_.view.eye) * camera();
    }
    /// Direct interpolation (Ochotta, Hiller & Saupe 2006, 3.3 and 3.5): rays that meet the disc of a sample see what
    /// the patch has below that place, if that is one of the sample's cells and it is drawn.
    template <typename CornerOf>
    void disc(const PatchBlockReader& block, uint32_t s, const PatchBlockReader::CellsAround& cells,
              const CornerOf& corner, const TextureReader& looks, const Whole& whole) {
        const Corner at = corner(s);
        const dvec3 n = at.normal, middle = toCamera(block.lattice({0, 0, 0}));
        const dvec3 right = toCamera(block.lattice({1, 0, 0})) - middle,
                    up = toCamera(block.lattice({0, 1, 0})) - middle;
        const dvec3 base = glm::normalize(glm::cross(right, up));
        const glm::dmat3 toPlane = glm::inverse(glm::dmat3(right, up, base));
        // On the disc, above the next sample to the right, or up.
        const auto onDisc = [&](const dvec3& step) {
            return step - base * (glm::dot(n, step) / std::max(glm::dot(n, base), 1e-9));
        };
        const double cosine = std::max(0.0, block.normalOnPlane(s).z);
        const double radius = glm::length(right) * std::sqrt(0.5) / (0.1 + 0.9 * cosine);
        forPixelsAround(at.at, radius, [&](int x, int y) {
            const ViewRay ray = viewRay(draws_.view, glm::dvec2(x + 0.5, y + 0.5));
            const double facing = glm::dot(n, ray.direction);
            if (facing == 0) return;
            const dvec3 met = ray.at(glm::dot(n, at.at - ray.origin) / facing);
            if (met.z < draws_.view.nearPlane || glm::length(met - at.at) > radius) return;
            const dvec3 off = toPlane * (met - at.at);
            if (std::abs(off.x) > 1 || std::abs(off.y) > 1 || !cells.at(off.x < 0 ? 0 : 1).at(off.y < 0 ? 0 : 1))
                return;
            const uint32_t left = off.x < 0 ? s - 1 : s, first = off.y < 0 ? left - 17 : left;
            const double u = off.x < 0 ? 1 + off.x : off.x, v = off.y < 0 ? 1 + off.y : off.y;
            Corner mixed{};
            mixed.colour = glm::dvec4(0);
            mixed.finish = glm::dvec2(0);
            for (uint32_t k = 0; k < 4; ++k) {
                const double w = (k % 2 != 0 ? u : 1 - u) * (k / 2 != 0 ? v : 1 - v);
                const Corner of = corner(first + k % 2 + 17 * (k / 2));
                mixed.normal += w * of.normal;
                mixed.colour += w * of.colour;
                mixed.finish += w * of.finish;
            }
            mixed.at = at.at;
            mixed.uv = at.uv;
            Corners seen{mixed, mixed, mixed};  // but for their places
            seen[1].at += onDisc(right);
            seen[2].at += onDisc(up);
            seen[1].uv.x += 1;
            seen[2].uv.y += 1;
            projector_.place(x, y, met.z, seen, kPatchMaterial, looks, whole);
        });
    }
    /// All pixels that may show a ball; calls use(x, y).
    template <typename Use>
    void forPixelsAround(const dvec3& centre, double radius, const Use& use) const {
        const lod::View& view = draws_.view;
        const int right = static_cast<int>(view.width) - 1, bottom = static_cast<int>(view.height) - 1;
        glm::dvec2 lo(0), hi(right, bottom);
        if (centre.z + radius < view.nearPlane) return;
        if (view.isOrthographic || centre.z - radius > view.nearPlane) {
            lo = glm::dvec2(HUGE_VAL);
            hi = glm::dvec2(-HUGE_VAL);
            for (int k = 0; k < 8; ++k) {
                const dvec3 corner = centre + radius * (2.0 * dvec3(k % 2, k / 2 % 2, k / 4) - 1.0);
                lo = glm::min(lo, imageOf(view, corner));
                hi = glm::max(hi, imageOf(view, corner));
            }
        }
        if (!(hi.x >= 0 && hi.y >= 0)) return;
        for (int y = pixelIn(lo.y, bottom + 1); y <= pixelIn(hi.y, bottom); ++y)
            for (int x = pixelIn(lo.x, right + 1); x <= pixelIn(hi.x, right); ++x) use(x, y);
    }

    static inline const render::MeshTextures kNoTextures{};

    const render::DrawList& draws_;
    const Chunks& chunks_;
    const lod::CutDraw& cut_;
    const lod::Instance& instance_;
    const lod::Hierarchy& h_;
    const render::Bend bend_;
    TriangleProjector projector_;
};

void project(const render::DrawList& draws, const Chunks& chunks, Level& level) {
    for (size_t i = 0; i < draws.cut.size(); ++i) {
        const lod::Hierarchy& h = *draws.hierarchies[draws.instances[draws.cut[i].instance].hierarchy];
        const bool areSamples = draws.frame.patchAs == lod::kPatchesAsSamples;  // points
        if (!areSamples && lod::kindOf(h, draws.cut[i].chunk) == lod::Kind::patches)
            PatchProjector(draws, chunks, level, i).run();
    }
}

}  // namespace

constinit const RestatedKind patchesRestated{project};

}  // namespace stipple::reference
