// Graphs of clusters cut into groups of a few that share long borders.
#pragma once

#include <cstdint>
#include <vector>

namespace stipple::lod {

/// Neighbours of each vertex one after the other; an edge is there from both of its ends, with the same weight.
struct ClusterGraph {
    std::vector<uint32_t> start{0}, neighbour;
    std::vector<int32_t> weight;  ///< of an edge, more than 0
    uint32_t count() const { return static_cast<uint32_t>(start.size() - 1); }
};

/// For each vertex the number of its part: as many parts as it takes for `size` vertices each, none empty, of 5/8 to
/// 5/4 of that (rounded outwards; of fewer where there are too few), with little weight between them. Halves are halved
/// again, each the best of some beginnings whose borders are moved while that helps (Fiduccia and Mattheyses 1982);
/// then vertices go to the part beside theirs that they share more with. The same graph gives the same parts, on any
/// number of threads at once.
std::vector<uint32_t> partition(const ClusterGraph& graph, uint32_t size);

}  // namespace stipple::lod
