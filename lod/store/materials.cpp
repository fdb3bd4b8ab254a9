#include "lod/store/materials.h"

#include <fmt/format.h>

#include <algorithm>

#include "lod/store/attributes.h"
#include "lod/store/check.h"
#include "shaders/shared/material.h"

namespace stipple::lod {
namespace {

bool hasIndex(const Store& store, uint32_t chunk) {
    return materialAttribute(store.description) && !store.hierarchy.isTile(chunk) &&
           store.hierarchy.payload(chunk).kind == Kind::points && store.hierarchy.payload(chunk).attributeBytes > 0;
}

uint16_t materialAt(const Store& store, size_t number) {
    const std::vector<PointMaterial>& list = store.description.pointMaterials;
    return packed(list[number < list.size() ? number : 0]);
}

void give(const Store& store, const std::vector<uint8_t>& indices, Chunk& to) {
    to.materials.resize(indices.size());
    for (size_t i = 0; i < indices.size(); ++i) to.materials[i] = materialAt(store, indices[i]);
}

/// Of patches, whose samples have their numbers above their colours.
void giveSamples(const Store& store, Chunk& to) {
    if (store.description.pointMaterials.size() < 2) return;
    to.materials.reserve(to.patchBlocks.size() * shared::kPatchSamples + 1);
    for (const shared::PatchBlock& block : to.patchBlocks)
        for (const uint32_t colour : block.colours) to.materials.push_back(materialAt(store, colour >> 24));
    if (!to.patchMaps.empty()) to.materials.resize((to.materials.size() + 1) / 2 * 2);  // words stand behind them
}

}  // namespace

uint16_t packed(const PointMaterial& m) {
    return static_cast<uint16_t>(shared::packPointMaterial(m.roughness, m.metallic));
}

uint32_t defaultMaterial(const StoreDescription& d) {
    return d.pointMaterials.empty() ? shared::kPlainPoint : packed(d.pointMaterials.front());
}

std::optional<size_t> materialAttribute(const StoreDescription& d) {
    // The build puts it last; of one material there is no index, and an attribute of that name is the user's.
    if (d.pointMaterials.size() < 2 || d.attributes.empty()) return {};
    const AttributeInfo& last = d.attributes.back();
    if (last.type != ScalarType::u8 || !last.name.starts_with(kMaterialAttribute)) return {};
    return d.attributes.size() - 1;
}

Result<void> addMaterials(const Store& store, uint32_t chunk, const uint8_t* attributes, size_t bytes, Chunk& to) {
    giveSamples(store, to);
    if (!hasIndex(store, chunk)) return {};
    const std::string where = fmt::format("{}: chunk {}", store.path, chunk);
    STIPPLE_ASSIGN(const std::vector<uint8_t> indices, decodeAttribute(attributes, bytes, store.description.attributes,
                                                                       *materialAttribute(store.description),
                                                                       store.hierarchy.payload(chunk).records, where));
    give(store, indices, to);
    return {};
}

Result<void> addMaterials(const Store& store, uint32_t chunk, Chunk& to) {
    giveSamples(store, to);
    if (!hasIndex(store, chunk)) return {};
    STIPPLE_ASSIGN(const std::vector<uint8_t> indices,
                   readAttribute(store, chunk, *materialAttribute(store.description)));
    give(store, indices, to);
    return {};
}

Result<void> checkMaterialIndices(const Store& store, uint32_t chunk, const std::vector<uint8_t>& indices) {
    const size_t count = std::max<size_t>(store.description.pointMaterials.size(), 1);
    const auto beyond = std::find_if(indices.begin(), indices.end(), [&](uint8_t i) { return i >= count; });
    if (beyond == indices.end()) return {};
    return tl::unexpected(damagedStore(fmt::format("{}: chunk {}", store.path, chunk),
                                       fmt::format("a record names material {}, which there is not", *beyond)));
}

Result<void> checkSampleMaterials(const Store& store, uint32_t chunk, const Chunk& decoded) {
    std::vector<uint8_t> numbers;
    for (const shared::PatchBlock& block : decoded.patchBlocks)
        for (const uint32_t colour : block.colours) numbers.push_back(static_cast<uint8_t>(colour >> 24));
    return checkMaterialIndices(store, chunk, numbers);
}

}  // namespace stipple::lod
