#include "engine/base/hash.h"

#include <fmt/format.h>
#include <xxhash.h>

namespace stipple {

uint64_t hashBytes(const void* bytes, size_t count, uint64_t seed) { return XXH3_64bits_withSeed(bytes, count, seed); }
std::string hexDigits(uint64_t value) { return fmt::format("{:016x}", value); }

}  // namespace stipple
