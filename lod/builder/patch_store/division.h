// Triangles that are long beside the cells that they lie in, divided: each piece then belongs to the cell of its
// middle and reaches no farther than an edge beyond it.
#pragma once

#include <array>

#include "lod/builder/mesh/mesh_work.h"

namespace stipple::lod {

/// How long the longest edges are, in octaves: what a division makes of them is known before anything is divided.
class EdgeLengths {
  public:
    void add(const Soup& soup);
    /// Pieces at most, where no edge may be longer than 2^limitLog2 lattice units.
    double pieces(int limitLog2) const;

  private:
    static constexpr int kOctaves = 64;
    std::array<uint64_t, kOctaves> triangles_{};  ///< longest edge at most 2^octave
};

/// Divides triangles of a lattice of 24 to 30 bits at the middles of edges longer than `longest`, which hangs on the
/// edge alone: neighbours stay neighbours. (Middles are rounded to the lattice.) What loses its area is left out.
void divideLong(Soup& soup, double longest);

/// The middle of a triangle, rounded down: what says which cell it belongs to.
inline Steps middleOf(const Soup& soup, size_t triangle) {
    const auto at = [&](size_t k) { return soup.vertices.at(soup.indices[3 * triangle + k]); };
    return (at(0) + at(1) + at(2)) / int64_t{3};
}

}  // namespace stipple::lod
