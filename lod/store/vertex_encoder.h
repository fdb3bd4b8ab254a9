// meshoptimizer's codec of vertices, the writing half: version 0 of the format, which EXT_meshopt_compression
// describes, in the bytes that the library's own encoder gave up to its version 0.22, at a fifth of the time, which was
// an eighth of that of a build. Reading stays the library's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple::lod {

/// `count` records of `stride` bytes (a multiple of 4, at most 256). Puts them into `scratch`, which only grows, and
/// gives the part of it that they take.
std::span<const uint8_t> encodeVertices(const void* records, size_t count, size_t stride,
                                        std::vector<uint8_t>& scratch);

}  // namespace stipple::lod
