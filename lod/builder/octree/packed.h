// Arrays of plain values as bytes in which each value is little more than its difference from the one before
// (meshoptimizer's vertex codec).
#pragma once

#include <meshoptimizer.h>

#include "lod/builder/octree/bytes.h"
#include "lod/store/vertex_encoder.h"

namespace stipple::lod {

template <typename T>
void putPacked(const std::vector<T>& values, ByteWriter& to) {
    static_assert(sizeof(T) % 4 == 0 && sizeof(T) <= 256);
    thread_local std::vector<uint8_t> scratch;
    const std::span<const uint8_t> bytes = encodeVertices(values.data(), values.size(), sizeof(T), scratch);
    to.put(uint64_t{values.size()});
    to.put(std::vector<uint8_t>(bytes.begin(), bytes.end()));
}

/// Appends; false if the bytes are not what putPacked wrote.
template <typename T>
bool getPacked(ByteReader& from, std::vector<T>& to) {
    uint64_t count = 0;
    std::vector<uint8_t> bytes;
    from.get(count);
    from.get(bytes);
    if (count > bytes.size() * 256) return false;
    const size_t old = to.size();
    to.resize(old + count);
    return meshopt_decodeVertexBuffer(to.data() + old, count, sizeof(T), bytes.data(), bytes.size()) == 0;
}

}  // namespace stipple::lod
