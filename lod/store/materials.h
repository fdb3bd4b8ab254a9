// Materials of points and patches: a list that a store has, and an index into it (without it all have the first). Of
// points it is an attribute of every record, of the name kMaterialAttribute: a coarse record has that of most points
// below it, the smallest index of equals, for the attribute's aggregate is its mode. Samples of patches have it in
// their payload (patch_bytes.h).
#pragma once

#include <optional>
#include <string>

#include "lod/store/store.h"

namespace stipple::lod {

/// As shaders read it (shaders/shared/material.h).
uint16_t packed(const PointMaterial& material);
/// What lights the records of a store that have no index; kPlainPoint where it has no materials.
uint32_t defaultMaterial(const StoreDescription& description);
/// Which of the attributes the index is: the last, if there are several materials.
std::optional<size_t> materialAttribute(const StoreDescription& description);

/// Gives the records of a payload their materials; nothing where the store has no index. `attributes`: the payload's
/// stream, as it is in the file. An index beyond the list counts as 0; verifyStore finds it.
Result<void> addMaterials(const Store& store, uint32_t chunk, const uint8_t* attributes, size_t bytes, Chunk& to);
/// The same, read from the file.
Result<void> addMaterials(const Store& store, uint32_t chunk, Chunk& to);
/// Of samples of patches.
Result<void> checkSampleMaterials(const Store& store, uint32_t chunk, const Chunk& decoded);
/// Is every index of a payload one of the list?
Result<void> checkMaterialIndices(const Store& store, uint32_t chunk, const std::vector<uint8_t>& indices);

}  // namespace stipple::lod
