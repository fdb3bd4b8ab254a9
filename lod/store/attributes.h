// Attribute streams of a chunk: stored values of every record, one stream per attribute, byte planes under zstd. They
// follow the chunk in the file, so that one read gets both and who does not want them does not read them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// Value of one attribute of one record.
double attributeValue(const AttributeInfo& info, const uint8_t* stored);
/// "Not measured": the value that the file declares for it; of floating-point attributes also what is not a number or
/// no smaller than the largest fp32 (1.8e308, 3.4e38), as many programs write it.
bool isNoData(const AttributeInfo& info, const uint8_t* stored);
/// The stored form that is nearest to `value`.
void storeAttribute(const AttributeInfo& info, double value, uint8_t* to);

/// `streams[k]` holds `records` values of `infos[k]`. Empty if there are no attributes.
std::vector<uint8_t> encodeAttributes(const std::vector<AttributeInfo>& infos,
                                      const std::vector<std::vector<uint8_t>>& streams);

/// The stream of attribute `index`. `where` names the place in errors.
Result<std::vector<uint8_t>> decodeAttribute(const uint8_t* bytes, size_t count,
                                             const std::vector<AttributeInfo>& infos, size_t index, uint32_t records,
                                             const std::string& where);

}  // namespace stipple::lod
