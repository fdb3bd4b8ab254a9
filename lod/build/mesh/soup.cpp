// Triangles as bytes, between the steps of a build: meshoptimizer's codecs, which are fast and undo what is redundant.
#include <meshoptimizer.h>

#include "lod/build/mesh/mesh_work.h"

namespace stipple::lod {

void putSoup(const Soup& soup, ByteWriter& to) {
    constexpr size_t kStride = sizeof(shared::MeshVertex);
    std::vector<uint8_t> bytes(meshopt_encodeVertexBufferBound(soup.vertices.size(), kStride));
    bytes.resize(
        meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), soup.vertices.data(), soup.vertices.size(), kStride));
    to.put(uint64_t{soup.vertices.size()});
    to.put(bytes);
    bytes.resize(meshopt_encodeIndexSequenceBound(soup.indices.size(), soup.vertices.size()));
    bytes.resize(meshopt_encodeIndexSequence(bytes.data(), bytes.size(), soup.indices.data(), soup.indices.size()));
    to.put(uint64_t{soup.indices.size()});
    to.put(bytes);
}

bool getSoup(ByteReader& from, Soup& to) {
    uint64_t vertices = 0, indices = 0;
    std::vector<uint8_t> bytes;
    from.get(vertices);
    from.get(bytes);
    const size_t oldVertices = to.vertices.size(), oldIndices = to.indices.size();
    if (vertices > bytes.size() * 256) return false;
    to.vertices.resize(oldVertices + vertices);
    if (meshopt_decodeVertexBuffer(to.vertices.data() + oldVertices, vertices, sizeof(shared::MeshVertex), bytes.data(),
                                   bytes.size()) != 0)
        return false;
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

}  // namespace stipple::lod
