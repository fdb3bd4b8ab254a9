// The triangles of a node at its level of detail: what its patches are made of. Those of an inner node are what its
// children's simplifications left.
#pragma once

#include "lod/builder/mesh/mesh_work.h"

namespace stipple::lod {

/// Appends triangles of another soup one by one, with the vertices that they use.
class SoupPart {
  public:
    SoupPart(const Soup& from, Soup& to) : from_(from), to_(to), place_(from.vertices.size(), ~0u) {}
    void add(size_t triangle);

  private:
    const Soup& from_;
    Soup& to_;
    std::vector<uint32_t> place_;
};
void appendSoup(const Soup& from, Soup& to);

/// Every place once, with the mean of its vertices' looks; triangles without an area there and those that are there
/// twice go. The order of the result hangs on places alone.
void uniteByPlace(Soup& soup);

/// To about a quarter of the triangles, or as few as `wanted` error allows, edges of the border kept; where that leaves
/// more than `most`, to as few however wrong. Looks are the means of neighbours. Returns the largest distance of the
/// two surfaces, both ways (lattice units).
double simplify(Soup& soup, double wanted, size_t most);

}  // namespace stipple::lod
