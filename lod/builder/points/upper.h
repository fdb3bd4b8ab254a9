// The tree above the subtrees, which come in Morton order, and a node is made as soon as its last child is there.
#pragma once

#include "lod/builder/octree/bytes.h"
#include "lod/builder/points/levels.h"

namespace stipple::lod {

/// One subtree: all chunks but that of its root, whose order its parent gives.
struct BuiltSubtree {
    PendingNode root;
    NodeBatch batch;
};

void putPending(const PendingNode& node, ByteWriter& to);
void getPending(ByteReader& from, PendingNode& node);

class UpperTree {
  public:
    explicit UpperTree(const Frame& frame) : frame_(frame) {}
    /// Nodes that end before `key` are made and their children's chunks appended to `batch`.
    void closeBefore(Key key, NodeBatch& batch);
    void add(PendingNode subtree) { open_.push_back(std::move(subtree)); }
    /// The root, once all subtrees are there.
    void finish(NodeBatch& batch);
    /// Since the last call: how many open nodes stayed, and after them come new ones.
    void saveChanges(ByteWriter& to);
    void loadChanges(ByteReader& from);

  private:
    void closeLast(NodeBatch& batch);
    const Frame& frame_;
    std::vector<PendingNode> open_;  ///< in Morton order, none inside another
    size_t unchanged_ = 0;           ///< of them, since the last saveChanges
};

}  // namespace stipple::lod
