// Runs of the Morton order that are built at once, and what of their neighbours they need to see.
#pragma once

#include <array>
#include <cstring>
#include <memory>

#include "engine/base/spill.h"
#include "lod/builder/octree/cells.h"
#include "lod/builder/points/points.h"
#include "shaders/shared/record.h"

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
    /// How places are held: known after the survey.
    void holdPlacesOf(const Frame& frame) {
        const bool areExact = frame.keyLevels == frame.rootLog2 && frame.keyLevels <= kShortBits;
        places_ = areExact ? Places::keys : frame.rootLog2 > 32 ? Places::wide : Places::narrow;
    }
    size_t bytes() const { return ghostBytes() + restBytes_; }
    bool isWide() const { return places_ == Places::wide; }
    bool holdsKeys() const { return places_ == Places::keys; }
    /// A ghost is the beginning of a record: its place.
    size_t ghostBytes() const { return places_ == Places::keys ? 8 : places_ == Places::wide ? 20 : 12; }
    /// `key`: of point i, where keys are held.
    void write(const Points& from, size_t i, uint64_t key, uint8_t* to) const {
        writePlace(from.place(i), key, to);
        to += ghostBytes();
        const auto put = [&](const void* value, size_t bytes) {
            std::memcpy(to, value, bytes);
            to += bytes;
        };
        if (hasWord_) put(&from.colour[i], 4);
        if (hasNormal_) put(&from.normal[i], 4);
        if (hasRadius_) put(&from.radius[i], 4);
        for (size_t a = 0; a < widths_.size(); ++a) put(from.attributes[a].data() + i * widths_[a], widths_[a]);
    }
    /// Of a ghost.
    void writePlace(const Place& place, uint64_t key, uint8_t* to) const {
        if (holdsKeys()) {
            std::memcpy(to, &key, 8);
            return;
        }
        const std::array<uint32_t, 3> low{static_cast<uint32_t>(place[0]), static_cast<uint32_t>(place[1]),
                                          static_cast<uint32_t>(place[2])};
        std::memcpy(to, low.data(), 12);
        if (!isWide()) return;
        const uint64_t high = highOf(place);
        std::memcpy(to + 12, &high, 8);
    }
    /// Of a record, or of a ghost.
    Place placeAt(const uint8_t* from) const {
        if (holdsKeys()) {
            const uint64_t key = keyAt(from);
            return {compactShort(key), compactShort(key >> 1), compactShort(key >> 2)};
        }
        std::array<uint32_t, 3> low{};
        uint64_t high = 0;
        std::memcpy(low.data(), from, 12);
        if (isWide()) std::memcpy(&high, from + 12, 8);
        return placeOf(low[0], low[1], low[2], high);
    }
    /// Where keys are held.
    static uint64_t keyAt(const uint8_t* from) {
        uint64_t key = 0;
        std::memcpy(&key, from, 8);
        return key;
    }
    void resize(Points& points, size_t count) const;
    /// One record to point i, which is there; but for its place, where keys are held.
    void read(const uint8_t* from, size_t i, Points& to) const {
        const auto take = [&](void* value, size_t bytes) {
            std::memcpy(value, from, bytes);
            from += bytes;
        };
        if (holdsKeys()) {
            from += 8;
        } else {
            for (auto* column : {&to.x, &to.y, &to.z}) take(&(*column)[i], 4);
            if (isWide()) take(&to.high[i], 8);
        }
        to.colour[i] = kPlainColour | shared::kFlagNoNormal << 24;
        if (hasWord_) take(&to.colour[i], 4);
        if (hasNormal_) take(&to.normal[i], 4);
        if (hasRadius_) take(&to.radius[i], 4);
        for (size_t a = 0; a < widths_.size(); ++a) take(to.attributes[a].data() + i * widths_[a], widths_[a]);
    }

  private:
    /// As the key alone, where it is the whole place; as 32 bits an axis; with their high bits.
    enum class Places { keys, narrow, wide };
    Places places_ = Places::narrow;
    bool hasWord_, hasNormal_, hasRadius_;
    std::vector<size_t> widths_;
    size_t restBytes_;
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
