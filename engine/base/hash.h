#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace stipple {

/// XXH3 64 bit of `bytes`; the hash of every section of a store.
uint64_t hashBytes(const void* bytes, size_t count, uint64_t seed = 0);
/// 16 lower-case hexadecimal digits.
std::string hexDigits(uint64_t value);

}  // namespace stipple
