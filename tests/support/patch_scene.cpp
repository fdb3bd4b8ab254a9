#include "tests/support/patch_scene.h"

#include <stdexcept>

#include "engine/base/rng.h"
#include "engine/render/disc_sizes.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_map.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/materials.h"
#include "lod/store/patch_bytes.h"

namespace stipple::test {
namespace {

constexpr int kUnitLog2 = 20;  // lattice steps of a unit

}  // namespace

PatchScene::PatchScene(const std::vector<lod::Patch>& patches) {
    hierarchy_.unit = std::ldexp(1.0, -kUnitLog2);
    hierarchy_.rootLog2 = kUnitLog2 + 1;
    hierarchy_.origin = glm::dvec3(-1);
    hierarchy_.nodes.resize(1);
    setKind(hierarchy_.nodes[0], lod::Kind::patches);
    hierarchy_.nodes[0].centre = glm::dvec3(std::ldexp(1.0, kUnitLog2));
    hierarchy_.nodes[0].radius = std::ldexp(2.0, kUnitLog2);
    std::vector<lod::Patch> onLattice = patches;
    for (lod::Patch& p : onLattice) {
        p.origin = (p.origin + 1.0) / hierarchy_.unit;
        p.step = std::ldexp(p.step, kUnitLog2);
        p.quantumExponent += kUnitLog2;
        hierarchy_.nodes[0].records += lod::countBlocks(p);
    }
    hierarchy_.nodes[0].maps = lod::mapCodeOf(onLattice);
    const std::vector<uint8_t> bytes = lod::encodePatches(onLattice).bytes;
    auto decoded = lod::traitsOf(lod::Codec::patches).decode(hierarchy_, 0, bytes.data(), bytes.size(), "test", false);
    if (!decoded) throw std::runtime_error(decoded.error().line());
    chunk_ = std::move(*decoded);
    all_ = &hierarchy_;
}

void PatchScene::setMaterials(const std::vector<lod::PointMaterial>& list) {
    lod::Store store;
    store.hierarchy = hierarchy_;
    store.description.pointMaterials = list;
    const auto added = lod::addMaterials(store, 0, chunk_);
    if (!added) throw std::runtime_error(added.error().line());
    hierarchy_.hasMaterials = list.size() > 1;
    draws_.pointMaterial = {lod::defaultMaterial(store.description)};
}

const render::DrawList& PatchScene::drawsOf(const lod::View& view, const render::DrawSettings& settings,
                                            const lod::Instance& place) {
    place_ = place;
    lod::Cut cut;
    cut.draw.push_back({.count = hierarchy_.nodes[0].records, .errorCode = 255, .errorPixels = 1});
    render::makeDrawList(cut, std::span(&all_, 1), std::span(&place_, 1), view, settings, draws_);
    return draws_;
}

render::Image PatchScene::draw(render::Backend& backend, const lod::View& view, render::Mode mode,
                               const render::DrawSettings& settings, const lod::Instance& place) {
    const render::DrawList& draws = drawsOf(view, settings, place);
    render::DiscSizes sizes(backend);
    sizes.addSource(hierarchy_);
    lod::Chunk chunk = chunk_;
    if (settings.patchAs == lod::kPatchesAsSamples) lod::samplesAsPoints(hierarchy_, 0, chunk);
    render::Image image;
    const render::RenderRequest request{&draws, mode, render::passesOf(mode, render::contentOf(draws), draws.effects),
                                        true};
    auto status = sizes.upload({0, 0}, chunk);
    render::markDiscSizes(sizes, draws_);
    if (status) status = backend.render(request, image);
    sizes.evict({0, 0});
    if (!status) throw std::runtime_error(status.error().line());
    for (float& depth : image.depth)  // orthographic: counted from the eye that was asked for
        if (depth > 0) depth = static_cast<float>(depth + draws.eyeAdvanced);
    return image;
}

lod::Patch patchOfHeights(uint32_t width, uint32_t height, const std::function<double(double, double)>& f, double holes,
                          const glm::dquat& turn) {
    lod::Patch p;
    p.width = width;
    p.height = height;
    p.turn = glm::quat(turn);
    p.step = static_cast<float>(std::ldexp(1.0, -10) * std::floor(std::ldexp(2.0 / (std::max(width, height) - 1), 10)));
    p.quantumExponent = -15;
    const size_t samples = size_t{width} * height;
    p.heights.assign(samples, 0);
    p.normals.assign(samples, 0);
    p.colours.assign(samples, 0);
    p.cells.assign(size_t{width - 1} * (height - 1), 1);
    Rng rng(width * 1000 + height);
    for (uint8_t& cell : p.cells) cell = rng.uniform() < holes ? 0 : 1;
    if (p.drawnCells() == 0) p.cells[0] = 1;
    const double halfX = 0.5 * p.step * (width - 1), halfY = 0.5 * p.step * (height - 1);
    p.origin = p.frame() * glm::dvec3(-halfX, -halfY, -1);
    for (uint32_t j = 0; j + 1 < height; ++j)
        for (uint32_t i = 0; i + 1 < width; ++i)
            for (uint32_t k = 0; k < 4 && p.hasCell(i, j); ++k) {
                const uint32_t u = i + k % 2, v = j + k / 2;
                const double x = u * double{p.step} - halfX, y = v * double{p.step} - halfY, d = 1e-4;
                const size_t s = p.at(u, v);
                p.heights[s] = static_cast<uint16_t>(std::lround((f(x, y) + 1) / p.quantum()));
                p.normals[s] = lod::roundedNormal(
                    glm::vec3(glm::normalize(glm::dvec3(f(x - d, y) - f(x + d, y), f(x, y - d) - f(x, y + d), 2 * d))));
                p.colours[s] = static_cast<uint32_t>(rng.below(1u << 24));
            }
    return p;
}

void giveMap(lod::Patch& p, uint32_t density, const std::function<uint32_t(double, double)>& texel,
             const std::function<glm::vec3(double, double)>& normal, bool hasMaterials) {
    const uint32_t k = 1u << density;
    p.map.density = density;
    p.map.hasMaterials = hasMaterials;
    const lod::MapLevel level = lod::mapOf(p);
    p.map.colours.assign(level.isKnown.size(), 0);
    if (normal) p.map.normals.assign(level.isKnown.size(), 0);
    for (uint32_t y = 0; y < level.height; ++y)
        for (uint32_t x = 0; x < level.width; ++x) {
            const size_t t = level.at(x, y);
            if (level.isKnown[t] == 0) continue;
            const double i = static_cast<double>(x) / k, j = static_cast<double>(y) / k;
            p.map.colours[t] = texel(i, j) & (hasMaterials ? ~0u : 0xffffffu);
            if (normal) p.map.normals[t] = lod::roundedNormal<lod::kMapNormalStep>(normal(i, j));
        }
    lod::sampleColours(p);
}

}  // namespace stipple::test
