// Is a PNG whole? The library that decodes it would print what it finds on standard error, in words of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "engine/base/result.h"

namespace stipple::image {

/// Reads `count` bytes at `offset`, which are there.
using ReadAt = std::function<Result<void>(uint64_t offset, void* to, size_t count)>;

/// CRC-32 as in PNG, annex D, before its last step (the complement): goes on from `crc`, which begins as ~0.
uint32_t crcOfPng(uint32_t crc, const uint8_t* bytes, size_t count);

/// Walks the chunks of a PNG of `bytes` bytes (PNG 5.3, 5.5), to its pixels or `wholly`: lengths, and checksums of the
/// chunks that make the picture. What is wrong, in words; empty: nothing is.
Result<std::string> faultOfPng(uint64_t bytes, const ReadAt& readAt, bool wholly);

}  // namespace stipple::image
