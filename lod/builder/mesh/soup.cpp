// Triangles as bytes, between the steps of a build: meshoptimizer's codecs, which are fast and undo what is redundant.
#include <meshoptimizer.h>

#include <algorithm>

#include "lod/builder/mesh/mesh_work.h"
#include "lod/builder/octree/packed.h"

namespace stipple::lod {

void putSoup(const Soup& soup, ByteWriter& to) {
    putPacked(soup.vertices.low, to);
    to.put(uint8_t{soup.vertices.high.empty() ? uint8_t{0} : uint8_t{1}});
    if (!soup.vertices.high.empty()) putPacked(soup.vertices.high, to);
    std::vector<uint8_t> bytes(meshopt_encodeIndexSequenceBound(soup.indices.size(), soup.vertices.size()));
    bytes.resize(meshopt_encodeIndexSequence(bytes.data(), bytes.size(), soup.indices.data(), soup.indices.size()));
    to.put(uint64_t{soup.indices.size()});
    to.put(bytes);
}

bool getSoup(ByteReader& from, Soup& to) {
    const size_t oldVertices = to.vertices.size(), oldIndices = to.indices.size();
    if (!getPacked(from, to.vertices.low)) return false;
    uint8_t isWide = 0;
    from.get(isWide);
    if (isWide != 0 && (!getPacked(from, to.vertices.high) || to.vertices.high.size() != to.vertices.size()))
        return false;
    if (isWide == 0 && !to.vertices.high.empty()) return false;
    const size_t vertices = to.vertices.size() - oldVertices;
    uint64_t indices = 0;
    std::vector<uint8_t> bytes;
    from.get(indices);
    from.get(bytes);
    if (indices > bytes.size()) return false;
    to.indices.resize(oldIndices + indices);
    if (meshopt_decodeIndexSequence(to.indices.data() + oldIndices, indices, sizeof(uint32_t), bytes.data(),
                                    bytes.size()) != 0)
        return false;
    for (size_t i = oldIndices; i < to.indices.size(); ++i) {
        if (to.indices[i] >= vertices) return false;
        to.indices[i] += static_cast<uint32_t>(oldVertices);
    }
    return true;
}

uint64_t gather(Soup& soup, bool dropEqual) {
    weld(soup);
    const size_t count = soup.indices.size() / 3;
    std::vector<std::array<uint32_t, 3>> order(count);
    for (size_t t = 0; t < count; ++t) {
        auto& corners = order[t];
        std::copy_n(soup.indices.begin() + static_cast<ptrdiff_t>(3 * t), 3, corners.begin());
        std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    }
    std::sort(order.begin(), order.end());
    if (dropEqual) order.erase(std::unique(order.begin(), order.end()), order.end());
    soup.indices.clear();
    for (const auto& corners : order) soup.indices.insert(soup.indices.end(), corners.begin(), corners.end());
    return count - order.size();
}

}  // namespace stipple::lod
