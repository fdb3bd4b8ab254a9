// What is known of the discs of each node once its chunk has arrived: the largest radius, by which frames without wide
// discs (shaders/shared/wide_disc.h) have no pass for them, the usual one, by which those whose discs are no wider than
// a few pixels have none that makes them smooth (shaders/shared/smooth.h), and of older stores the spacing, by which
// the kernels of coarse levels are closed (shaders/shared/ewa.h); others tell it. And in which box of the lattice its
// records lie, by which nodes are found that are hidden behind others.
#pragma once

#include <array>
#include <vector>

#include "engine/render/backend.h"

namespace stipple::render {

/// Radii times the square root of the number of points, over the edge of their cell: about the spacings of a surface
/// that a disc reaches. Where they are more (many copies of the points, or given radii that are very large), ellipses a
/// texel are as good, and what is drawn exactly would cost pixels times thousands of discs.
constexpr float kMostSpacings = 4.0f;
/// Nodes are smooth (kNodeSmooth) whose usual disc has more than this radius at the middle of the node's cell, px.
/// Below it facets are hardly larger than what is seen of a disc anyway: no difference was found at the usual errors of
/// a pixel or two, and the pyramid costs as much again as the discs. (None is where colours are levels or errors.)
constexpr double kSmoothPixels = 4;
/// Half of the radius that a texel can hold, px. Beyond it they are drawn exactly, too, wherever they would be lost:
/// the picture lies within few spacings then.
constexpr double kMostTexelPixels = 8192;

/// Hands chunks on to a backend and keeps in mind how large the discs of each are, and how far apart.
class DiscSizes final : public streaming::ChunkSink {
  public:
    explicit DiscSizes(Backend& backend) : backend_(backend), life_(backend.life()) {}
    /// What the backend calls source 0.
    void setFirstSource(uint32_t first) { first_ = first; }
    /// Sources come in the order of their numbers. What the store tells of spacings is not measured again.
    void addSource(const lod::Hierarchy& h) { hierarchies_.push_back(&h); }
    Result<void> upload(streaming::ChunkKey key, lod::Chunk chunk) override;
    void evict(streaming::ChunkKey key) override;
    struct Share {
        float ofEdge = 0;      ///< over the edge of the node's cell; 0 of what has no points
        bool isDense = false;  ///< beyond kMostSpacings
        float usual = 0;       ///< that of a usual one, likewise
        std::array<uint16_t, 3> low{0, 0, 0}, high{65535, 65535, 65535};  ///< steps between which the records lie
    };
    /// `key`: as the backend has it; `end`: where the records that are drawn end in the chunk, which tells levels of an
    /// overview (Hierarchy::overviewOf) from what a node holds itself.
    Share shareOf(streaming::ChunkKey key, uint32_t end) const;
    /// Of stores that do not tell it: steps of the node's lattice; 0: not known.
    float spacingOf(streaming::ChunkKey key) const;

  private:
    struct Size {
        uint8_t code = 0;   ///< of the largest radius, + 1 (at most 255); 0: no points
        uint8_t usual = 0;  ///< mean of the codes, rounded to the nearest
        bool isDense = false;
        float spacing = 0;
        std::array<uint16_t, 3> low{0, 0, 0}, high{65535, 65535, 65535};
    };
    /// Of a level of an overview.
    struct OfLevel {
        uint32_t end = 0;  ///< of its records in the chunk
        Size size;
    };
    void measureOverview(uint32_t source, std::span<const shared::PointRecord> records);
    static Size measured(std::span<const shared::PointRecord> records);
    Size sizeOf(streaming::ChunkKey key) const;
    streaming::ChunkKey keyOfBackend(streaming::ChunkKey key) const;

    Backend& backend_;
    std::weak_ptr<const void> life_;  ///< of the backend: what is gone needs nothing back
    uint32_t first_ = 0;
    std::vector<std::vector<Size>> sizes_;            ///< by source and node
    std::vector<std::vector<OfLevel>> overviews_;     ///< by source
    std::vector<const lod::Hierarchy*> hierarchies_;  ///< by source
};

/// Sets kNodeWide, kNodeSmooth, DrawList::hasWideDiscs, hasSmoothDiscs and pointBounds, and the spacings of nodes that
/// stores do not tell.
void markDiscSizes(const DiscSizes& sizes, DrawList& draws);

}  // namespace stipple::render
