// What coarse records say of the attributes below them.
#pragma once

#include "lod/builder/points/levels.h"

namespace stipple::lod {

/// Of one point; `from`: its stored value.
RisingValue leafValue(const AttributeInfo& info, const uint8_t* from);
/// Of one attribute over parts; `records[i]` says how many points parts[i] stands for.
RisingValue mergeValues(const AttributeInfo& info, std::span<const RisingValue> parts, std::span<const Rising> records);
/// The stored value of a record that stands for `count` points.
void storeValue(const AttributeInfo& info, const RisingValue& value, uint32_t count, uint8_t* to);

}  // namespace stipple::lod
