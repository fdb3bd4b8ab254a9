// Which nodes of a draw list may hold wide discs (shaders/shared/wide_disc.h): frames without any have no pass for
// them.
#pragma once

#include <vector>

#include "engine/render/backend.h"

namespace stipple::render {

/// Hands chunks on to a backend and keeps in mind how large the largest radius of each is.
class GreatestRadii final : public streaming::ChunkSink {
  public:
    explicit GreatestRadii(Backend& backend) : backend_(backend) {}
    Result<void> upload(streaming::ChunkKey key, const lod::Chunk& chunk) override;
    void evict(streaming::ChunkKey key) override { backend_.evict(key); }
    /// Over the edge of the node's cell; 0 of what has no points.
    float shareOf(streaming::ChunkKey key) const;

  private:
    Backend& backend_;
    std::vector<std::vector<uint8_t>> codes_;  ///< radius code + 1 (at most 255) by source and node; 0: no points
};

/// Sets kNodeWide and DrawList::hasWideDiscs.
void markWideDiscs(const GreatestRadii& radii, DrawList& draws);

}  // namespace stipple::render
