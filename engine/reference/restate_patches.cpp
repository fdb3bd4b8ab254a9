// Elevation patches once more, in fp64: their lifted triangles.
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
        const Whole whole{cut_.errorPixels, h_.nodes[cut_.node].level};
        for (uint32_t b = 0; b < cut_.count; ++b) {
            const PatchBlockReader block(h_, h_.nodes[cut_.node], chunk.patchBlocks.at(b), chunk.patchPlanes.at(b));
            const MapReader map(chunk.patchMaps, chunk.patchBlocks[b].map);
            const ShowPlace show = [&](const glm::dvec2& at, double cells, Sample& s, dvec3& n) {
                const MapReader::Look look = map.look(at, cells);
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
            block.forEachTriangle([&](uint32_t a, uint32_t c, uint32_t d) {
                projector_.triangle({corner(a), corner(c), corner(d)}, shared::kSurfaceTwoSided, kPatchMaterial,
                                    {kNoTextures, chunks_, map.isThere() ? &show : nullptr}, whole);
            });
        }
    }

  private:
    /// Of the whole picture, the sample's own, or its store's.
    uint32_t materialOf(const lod::Chunk& chunk, uint32_t sample) const {
        if (draws_.onlyMaterial) return *draws_.onlyMaterial;
        if (!chunk.materials.empty()) return chunk.materials.at(sample);
        return instance_.hierarchy < draws_.pointMaterial.size() ? draws_.pointMaterial[instance_.hierarchy] : ~0u;
    }
    glm::dmat3 camera() const { return {draws_.view.right, draws_.view.down, draws_.view.forward}; }
    Corner cornerOfSample(const PatchCorner& of) const {
        const dvec3 world =
            instance_.translation + instance_.rotation * (instance_.scale * (h_.origin + h_.unit * of.place));
        Corner c;
        c.at = (bend_.moved(world) - draws_.view.eye) * camera();
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
