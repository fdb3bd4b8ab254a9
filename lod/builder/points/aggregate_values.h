// What coarse records say of the attributes below them.
#pragma once

#include "lod/builder/points/levels.h"

namespace stipple::lod {

/// Of one point; `from`: its stored value.
AggregateValue leafValue(const AttributeInfo& info, const uint8_t* from);
/// Of one attribute over parts. Points without data are no part of a mean.
AggregateValue mergeValues(const AttributeInfo& info, std::span<const AggregateValue> parts);
/// The stored value of a record that stands for `count` points; where none of them has data, that of one of them.
void storeValue(const AttributeInfo& info, const AggregateValue& value, uint32_t count, uint8_t* to);

}  // namespace stipple::lod
