// Small separate parts of a mesh: leaves, twigs, blades of grass. Nothing else touches their borders, so that these may
// be moved and simplified, which those of a larger surface may not (its neighbours keep theirs).
#pragma once

#include <deque>

#include "lod/builder/mesh/mesh_work.h"

namespace stipple::lod {

/// Triangles of a part that is kept together at most.
constexpr uint32_t kPartTriangles = 2048;
/// Steps from the origin of a wide lattice up to which there are parts, so that no triangle of one is long (isLong).
constexpr int64_t kPartReach = int64_t{1} << 29;
/// In MeshVertex::surface, on the way from the input to its cell only: belongs to such a part.
constexpr uint32_t kSurfaceOfPart = 0x80000000u;

/// The parts of a whole mesh, by the positions that their triangles share. Two readings of the same blocks: add() all
/// of them, finish(), then place() all of them again.
///
/// Of a wide lattice parts are looked for around its origin, where most vertices are: what reaches beyond kPartReach
/// steps is none.
class PartFinder {
  public:
    /// Triangles of a mesh that is looked at as a whole; of a larger one no part is known.
    static constexpr uint64_t kMostTriangles = uint64_t{1} << 21;
    /// Memory at most: a triangle's centre and position 16, a vertex's position 12, its numbers by hash 12, its parent
    /// 4, a twentieth more for how deques keep them; and two blocks, as they are read and as they are placed.
    static constexpr uint64_t memory(uint64_t triangles, uint64_t vertices) {
        constexpr uint64_t kTriangleBytes = 17, kVertexBytes = 29, kBlockBytes = uint64_t{56} << 20;
        return triangles * kTriangleBytes + vertices * kVertexBytes + kBlockBytes;
    }
    explicit PartFinder(const Lattice& lattice = {});
    /// False: there are too many.
    bool add(const PlacedBlock& block);
    void finish(bool isKnown);
    /// Gives the triangles of small parts one place each, and marks their vertices. `block`: number in the source.
    /// False: it is not the block that it was.
    bool place(PlacedBlock& placed, size_t block) const;

  private:
    uint32_t numberOf(const glm::ivec3& p);
    uint32_t numberAt(const LatticeVertices& vertices, uint32_t i);
    std::array<uint32_t, 3> shortCentre(const PlacedBlock& block, size_t t) const;
    void grow();

    bool isWide_ = false;
    Place nearest_{};  ///< of a wide lattice: of the centres that are kept as 32 bits an axis, the least
    // (What grows without being copied: twice as much for a moment would count.)
    std::deque<glm::ivec3> positions_;
    std::deque<uint32_t> parent_;
    std::vector<uint32_t> slots_;
    std::deque<uint32_t> ofTriangle_;             ///< a position of it; after finish() its part, or ~0
    std::deque<std::array<uint32_t, 3>> centre_;  ///< of a triangle; after finish() of a part
    std::vector<size_t> firstOfBlock_{0};
};

/// Numbers of the parts of some triangles by position, in the order of their first triangles; returns how many.
uint32_t partsOf(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& indices,
                 std::vector<uint32_t>& ofTriangle);

/// Clusters of whole parts: one that fits into a cluster is in one. `parts`: triangles, local.
void appendWholeClusters(const LocalMesh& local, const std::vector<std::vector<uint32_t>>& parts,
                         std::vector<Cluster>& out);

/// Groups of about `size` clusters each, no part in two: of those with isWhole in their order, of the others by the
/// borders they share.
std::vector<std::vector<uint32_t>> groupAll(const WeldedMesh& mesh, const std::vector<Cluster>& clusters, uint32_t size,
                                            Executor& executor);

/// The place `by` steps from `from` on a lattice that ends at `least` and `largest`.
glm::ivec3 movedPlace(const Steps& from, const glm::dvec3& by, int least, int largest);

/// Simplifies whole parts to about `target` indices. Each covers as much of a picture afterwards, seen from all sides
/// in the mean, as before: it is widened, and what went altogether is made up for by those that stay. `local` gets the
/// moved vertices.
std::vector<uint32_t> simplifyParts(const WeldedMesh& mesh, LocalMesh& local, size_t target, int least, int largest);

}  // namespace stipple::lod
