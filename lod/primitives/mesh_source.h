// Where the triangles of a build come from.
#pragma once

#include <functional>
#include <limits>

#include "engine/base/numbers.h"
#include "engine/base/result.h"
#include "lod/primitives/mesh.h"

namespace stipple::lod {

/// Triangles that are read block by block, as often as it takes: they need not fit in memory.
struct MeshSource {
    struct Bounds {
        glm::dvec3 lo{std::numeric_limits<double>::max()}, hi{-lo};  ///< of finite vertices; lo > hi: there are none
        /// Some of them. Which ones hangs on their coordinates alone, not on their order.
        std::vector<glm::dvec3> sample;
        void add(const glm::dvec3& p);
        void add(const Bounds& other);
        /// Of all places that are in the sample.
        double share() const { return std::ldexp(1.0, -static_cast<int>(thinned_)); }

      private:
        void keep(const glm::dvec3& p);
        uint32_t thinned_ = 0;  ///< times that the sample was halved
    };
    using Take = std::function<Result<void>(const TriangleMesh& block)>;

    uint64_t triangles = 0;              ///< as far as is known before reading
    uint64_t vertices = 0;               ///< at most; 0: as many as triangles have corners
    std::function<uint64_t()> identity;  ///< another number: the source has changed
    /// Told now and then how much is done of how much; an error stops what is going on.
    using Tell = std::function<Result<void>(uint64_t done, uint64_t all)>;
    std::function<Result<Bounds>(const Tell& tell)> survey;  ///< once, before read
    uint64_t surveyBytes = 0, readBytes = 0;  ///< on disk at most, of its own: during the survey and after that
    /// Gives every triangle once; blocks have vertices of their own. Always the same.
    std::function<Result<void>(const Take& take)> read;
    std::function<uint64_t()> badTriangles;  ///< left out by the last read, a corner is no vertex; empty: none
};

/// Of triangles in memory.
MeshSource sourceOf(TriangleMesh mesh);
/// The triangles of several sources, one source after the other.
MeshSource joined(std::vector<MeshSource> sources);

/// Some triangles of a larger mesh as a mesh of their own: vertices come as they are used.
class BlockMaker {
  public:
    /// `copy(vertex, block)` appends a vertex to the block's arrays.
    using Copy = std::function<void(uint64_t vertex, TriangleMesh& block)>;
    BlockMaker(Copy copy, MeshSource::Take take) : copy_(std::move(copy)), take_(std::move(take)) {}
    Result<void> triangle(uint64_t a, uint64_t b, uint64_t c);
    Result<void> finish();

  private:
    Copy copy_;
    MeshSource::Take take_;
    TriangleMesh block_;
    std::vector<uint64_t> table_;  ///< open addressing: vertex + 1 << 24 | its number in the block
    std::vector<uint32_t> used_;   ///< places of the table
};

/// `block` after `to`, with its indices moved. Both have the same arrays.
void append(TriangleMesh& to, const TriangleMesh& block);

}  // namespace stipple::lod
