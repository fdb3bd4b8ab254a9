#include "apps/study/loose_patches.h"

#include <cmath>

#include "engine/render/disc_sizes.h"
#include "engine/render/frame_passes.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/patch_blocks.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/patch_bytes.h"

namespace stipple::study {
namespace {

constexpr int kStepsLog2 = 20;  ///< lattice steps of a unit

}  // namespace

Result<LoosePatches> LoosePatches::of(const std::vector<lod::Patch>& patches) {
    LoosePatches out;
    lod::Hierarchy& h = out.hierarchy_;
    h.unit = std::ldexp(1.0, -kStepsLog2);
    h.rootLog2 = kStepsLog2 + 1;
    h.origin = glm::dvec3(-1);
    h.nodes.resize(1);
    lod::setKind(h.nodes[0], lod::Kind::patches);
    h.nodes[0].centre = glm::dvec3(std::ldexp(1.0, kStepsLog2));
    h.nodes[0].radius = std::ldexp(2.0, kStepsLog2);
    std::vector<lod::Patch> onLattice = patches;
    for (lod::Patch& p : onLattice) {
        p.origin = (p.origin + 1.0) / h.unit;
        p.step = std::ldexp(p.step, kStepsLog2);
        p.quantumExponent += kStepsLog2;
        h.nodes[0].records += lod::countBlocks(p);
    }
    const std::vector<uint8_t> bytes = lod::encodePatches(onLattice).bytes;
    STIPPLE_ASSIGN(out.chunk_,
                   lod::traitsOf(lod::Codec::patches).decode(h, 0, bytes.data(), bytes.size(), "figures", false));
    return out;
}

Result<render::Image> LoosePatches::draw(render::Backend& backend, const lod::View& view, render::Mode mode,
                                         const render::DrawSettings& settings) const {
    lod::Cut cut;
    cut.draw.push_back({.count = hierarchy_.nodes[0].records, .errorCode = 255, .errorPixels = 1});
    const lod::Hierarchy* all = &hierarchy_;
    const lod::Instance place;
    render::DrawList draws;
    render::makeDrawList(cut, std::span(&all, 1), std::span(&place, 1), view, settings, draws);
    lod::Chunk chunk = chunk_;
    if (settings.patchAs == lod::kPatchesAsSamples) lod::samplesAsPoints(hierarchy_, 0, chunk);
    render::DiscSizes sizes(backend);
    sizes.addSource(hierarchy_);
    STIPPLE_TRY(sizes.upload({0, 0}, chunk));
    render::markDiscSizes(sizes, draws);
    render::Image image;
    const Result<void> drawn =
        backend.render({&draws, mode, render::passesOf(mode, render::contentOf(draws), draws.effects), true}, image);
    sizes.evict({0, 0});
    STIPPLE_TRY(drawn);
    return image;
}

}  // namespace stipple::study
