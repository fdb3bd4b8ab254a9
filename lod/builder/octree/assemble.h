// The node table of a store from the nodes that were written.
#pragma once

#include <array>

#include "lod/builder/octree/frame.h"

namespace stipple::lod {

/// Nodes whose chunks are encoded, in the order in which they go to the file.
struct NodeBatch {
    struct Written {
        Node node;
        Key key = 0;
        uint32_t firstCount = 0;  ///< into `counts`: records of each code that occurs, of parents and own
        uint16_t parentCodes = 0, ownCodes = 0;
    };
    std::vector<Written> nodes;
    std::vector<uint32_t> counts;  ///< code << 24 | records
    void addCount(uint32_t code, uint32_t records) { counts.push_back(code << 24 | records); }
    std::vector<uint8_t> bytes;  ///< chunks, each followed by its attribute streams
};

/// `batches` hold every node of one octree once; their chunk offsets are those in the file.
Hierarchy assemble(const Frame& frame, const std::vector<NodeBatch>& batches);

}  // namespace stipple::lod
