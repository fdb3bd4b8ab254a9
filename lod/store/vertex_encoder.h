// meshoptimizer's codec of vertices, the writing half: the same bytes as meshopt_encodeVertexBuffer (version 0 of the
// format, which EXT_meshopt_compression describes), several times as fast. A build spends an eighth of its time there;
// reading stays the library's.
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
