// Runs of the Morton order that are built at once, and what of their neighbours they need to see.
#pragma once

#include <memory>

#include "engine/base/spill.h"
#include "lod/builder/octree/cells.h"
#include "lod/builder/points/points.h"

namespace stipple::lod {

/// Subtrees along the Morton curve, and which bucket each counted cell belongs to.
struct BucketPlan {
    struct Bucket {
        std::vector<Subtree> subtrees;
        uint64_t points = 0, firstPoint = 0;  ///< firstPoint: of the whole order
        uint32_t firstCell = 0, cells = 0;    ///< counted cells
    };
    std::vector<Bucket> buckets;
    std::vector<uint32_t> ofCell;
    /// Of a cell beside which lies another bucket's: one more than the level of the smallest of those, or than its own
    /// if that is finer; of others 0.
    std::vector<uint8_t> border;
};
/// Buckets of at most `most` points (but for single cells of the deepest level).
BucketPlan planBuckets(const Frame& frame, const CellTree& tree, uint64_t most);

/// How a point travels: bytes of one record.
class RecordLayout {
  public:
    /// Without colours and normals all points have one colour word: it does not travel.
    RecordLayout(bool hasColour, bool hasNormal, bool hasRadius, const std::vector<AttributeInfo>& attributes);
    /// With the high bits of coordinates: known after the survey.
    void widen(bool isWide) {
        bytes_ += (isWide ? 8u : 0u) - (isWide_ ? 8u : 0u);
        isWide_ = isWide;
    }
    size_t bytes() const { return bytes_; }
    bool isWide() const { return isWide_; }
    /// A ghost is the beginning of a record: its place.
    size_t ghostBytes() const { return isWide_ ? 20 : 12; }
    void write(const Points& from, size_t i, uint8_t* to) const;
    /// Of a ghost.
    void writePlace(const Place& place, uint8_t* to) const;
    /// Of a record, or of a ghost.
    Place placeAt(const uint8_t* from) const;
    void resize(Points& points, size_t count) const;
    /// One record to point i, which is there.
    void read(const uint8_t* from, size_t i, Points& to) const;

  private:
    bool hasWord_, hasNormal_, hasRadius_, isWide_ = false;
    std::vector<size_t> widths_;
    size_t bytes_;
};

/// What a bucket holds: records, and places of points of other buckets that its cells see.
struct BucketBytes {
    Spill points, ghosts;
    /// `folder` empty: in memory.
    BucketBytes(const std::string& folder, size_t index);
    uint64_t bytes() const { return points.bytes() + ghosts.bytes(); }
};
using Buckets = std::vector<std::unique_ptr<BucketBytes>>;
Buckets makeBuckets(size_t count, const std::string& folder);

/// Sends points to their buckets, and those near a border also to the neighbours that see them. A point p is seen from
/// a counted cell if it lies within a quarter of the smaller one's edge, its own cell's or that one's.
class Distributor {
  public:
    Distributor(const Frame& frame, const CellTree& tree, const BucketPlan& plan, const RecordLayout& layout,
                Buckets& buckets, int workers, uint64_t bufferBytes, bool wantGhosts);
    Result<void> add(int worker, const Points& block);
    Result<void> flush();

  private:
    void ghosts(uint32_t cell, const Place& place, std::vector<uint32_t>& to) const;
    /// Bytes on their way to a bucket: [0, used) of them.
    struct Buffer {
        std::vector<uint8_t> bytes;
        size_t used = 0;
    };
    static constexpr size_t kPoints = 0, kGhosts = 1;
    /// Calls write(to) with room for `count` bytes.
    template <typename Write>
    Result<void> put(int worker, uint32_t bucket, size_t kind, size_t count, const Write& write);
    Result<void> send(size_t slot, Buffer& buffer);

    const Frame& frame_;
    const CellTree& tree_;
    const BucketPlan& plan_;
    const RecordLayout& layout_;
    Buckets& buckets_;
    size_t bufferBytes_;
    bool wantGhosts_;
    std::vector<uint32_t> levels_;              ///< of counted cells, coarsest first
    std::vector<std::vector<Buffer>> buffers_;  ///< worker, 2 * bucket + kind
};

}  // namespace stipple::lod
