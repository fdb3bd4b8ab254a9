// Materials of points: a list that a store has, and in an attribute of the name kMaterialAttribute an index into it for
// every record (without it all have the first). A coarse record has that of most points below it, the smallest index of
// equals: the attribute's aggregate is its mode.
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
/// Is every index of a payload one of the list?
Result<void> checkMaterialIndices(const Store& store, uint32_t chunk, const std::vector<uint8_t>& indices);

}  // namespace stipple::lod
