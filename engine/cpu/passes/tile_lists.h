// Discs by tiles: placed in camera space, then listed by tile in the order of their ids, then drawn tile by tile, each
// by one thread and without atomics.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "engine/cpu/frame.h"

namespace stipple::cpu {

class TileLists {
  public:
    static constexpr uint32_t kMostChunks = 128;  ///< whose discs are kept, and counted, together

    /// `blocks`: of the frame, which are to be drawn, in their order.
    TileLists(Frame& frame, const SplatReach& reach, std::span<const uint32_t> blocks)
        : frame_(frame),
          reach_(reach),
          blocks_(blocks),
          columns_((frame.constants.width + SplatTile::kWidth - 1) / SplatTile::kWidth),
          rows_((frame.constants.height + SplatTile::kHeight - 1) / SplatTile::kHeight),
          blocksPerChunk_(std::max(4u, (static_cast<uint32_t>(blocks.size()) + kMostChunks - 1) / kMostChunks)),
          chunks_((static_cast<uint32_t>(blocks.size()) + blocksPerChunk_ - 1) / blocksPerChunk_),
          splats_(frame.placedSplats),
          ranges_(frame.splatTiles) {}

    /// `countsTiles`: draw() follows, of all that is placed.
    void place(bool countsTiles) {
        isCounted_ = countsTiles;
        splats_.resize(blocks_.size() * shared::kRecordsPerBlock);
        if (frame_.isBlended()) frame_.placedColours.resize(splats_.size());
        ranges_.resize(splats_.size());
        counts_.assign(chunks_, 0);
        entries_.assign(chunks_, 0);
        if (countsTiles) frame_.tileEnds.assign(chunks_ * pitch(rows_), 0);
        frame_.executor.parallelFor(chunks_, 1, [&](size_t begin, size_t end) {
            SplatBlock placed;
            for (size_t c = begin; c < end; ++c) {
                const size_t first = c * blocksPerChunk_, last = std::min(first + blocksPerChunk_, blocks_.size());
                for (size_t k = first; k < last; ++k) {
                    const uint32_t b = blocks_[k];
                    const BlockSource& block = frame_.blocks[b];
                    const uint32_t count =
                        std::min(shared::kRecordsPerBlock, block.node->count - frame_.draws->points().blocks[b].first);
                    frame_.k.placeSplats(frame_.constants, *block.node, block.records, count, reach_, placed);
                    keep(placed, count, c, b * shared::kRecordsPerBlock);
                }
            }
        });
    }

    /// Calls drawTile(splats, places, count, tile) once for each tile that discs reach, with all of them, in the order
    /// of their ids. Where the lists may not hold all tiles at a time, some rows of tiles after others (one row at
    /// least).
    template <typename DrawTile>
    void draw(const DrawTile& drawTile) {
        const uint64_t mostEntries = frame_.mostTileEntries;
        uint64_t all = 0;
        for (const uint64_t entries : entries_) all += entries;
        if (all == 0) return;
        if (all <= mostEntries) return drawRows(0, rows_, all, drawTile);
        std::vector<uint64_t> ofRow(rows_, 0);
        for (uint32_t c = 0; c < chunks_; ++c)
            forDiscs(c, [&](size_t at) {
                const TileRange r = ranges_[at];
                for (uint32_t y = r.firstY; y <= r.lastY; ++y) ofRow[y] += r.lastX - r.firstX + 1u;
            });
        for (uint32_t first = 0; first < rows_;) {
            uint64_t sum = ofRow[first];
            uint32_t last = first + 1;
            while (last < rows_ && sum + ofRow[last] <= mostEntries) sum += ofRow[last++];
            if (sum > 0) drawRows(first, last, sum, drawTile);
            first = last;
        }
    }

    /// Discs are kept by chunks of blocks, which threads may share out.
    uint32_t chunks() const { return chunks_; }
    /// Calls use(place) for each disc of a chunk: where it is in Frame::placedSplats and Frame::splatTiles.
    template <typename Use>
    void forDiscs(size_t chunk, const Use& use) const {
        const size_t first = firstOf(chunk);
        for (size_t at = first; at < first + counts_[chunk]; ++at) use(at);
    }
    /// Calls use(tile) for each tile of the picture, shared out among threads.
    template <typename Use>
    void forTiles(const Use& use) const {
        frame_.executor.parallelFor(size_t{columns_} * rows_, 4, [&](size_t begin, size_t end) {
            for (size_t t = begin; t < end; ++t) use(tileAt(t));
        });
    }

  private:
    void keep(const SplatBlock& b, uint32_t count, size_t chunk, uint32_t firstId) {
        const auto tile = [](int pixel, uint32_t size) {
            return static_cast<uint16_t>(static_cast<uint32_t>(pixel) / size);
        };
        const size_t first = firstOf(chunk) + counts_[chunk];
        // (At hand: after each store they would be read again.)
        PlacedSplat* splat = splats_.data() + first;
        TileRange* range = ranges_.data() + first;
        const bool isBlended = frame_.isBlended();
        uint32_t* colour = isBlended ? frame_.placedColours.data() + first : nullptr;
        const uint32_t alone = isBlended ? 0u : ~0u;
        uint64_t entries = 0;
        // (Which are kept is as good as random: they are found without branches.)
        alignas(64) uint32_t places[SplatBlock::kSize];
        uint32_t kept = 0;
        for (uint32_t i = 0; i < count; ++i) {
            places[kept] = i;
            kept += b.keep[i] != 0 ? 1u : 0u;
        }
        for (uint32_t k = 0; k < kept; ++k) {
            const uint32_t i = places[k];
            if (isBlended) *colour++ = b.colour[i];
            *splat++ = {b.cx[i], b.cy[i], b.cz[i],     b.nx[i],
                        b.ny[i], b.nz[i], b.radius[i], (firstId + i) | (b.alone[i] & alone)};
            *range = {tile(b.firstX[i], SplatTile::kWidth), tile(b.firstY[i], SplatTile::kHeight),
                      tile(b.lastX[i], SplatTile::kWidth), tile(b.lastY[i], SplatTile::kHeight)};
            entries += range++->tiles();
        }
        counts_[chunk] += kept;
        entries_[chunk] += entries;
        if (!isCounted_) return;
        countInto(frame_.tileEnds.data() + chunk * pitch(rows_), first, first + kept, 0, rows_);
    }

    /// Entries of a chunk in tables of the tiles of so many rows: beyond the last there is one more row and tile.
    size_t pitch(uint32_t rows) const { return size_t{columns_} * (rows + 1u) + 1u; }
    /// Nearly all discs reach one tile or two each way, which is as good as random: no branches on that.
    /// (Of discs that are not to be drawn the last tile is before the first: not these.)
    static bool isSmall(const TileRange& r) {
        return static_cast<uint32_t>(r.lastX - r.firstX) <= 1u && static_cast<uint32_t>(r.lastY - r.firstY) <= 1u;
    }

    /// Adds to the counts of tiles.
    void countInto(uint32_t* counts, size_t first, size_t last, uint32_t firstRow, uint32_t lastRow) const {
        forEntries(first, last, firstRow, lastRow,
                   [counts](size_t tile, uint32_t, uint32_t isReached) { counts[tile] += isReached; });
    }
    /// `next`: of each tile, where its next entry goes.
    void putInto(uint32_t* places, uint32_t* next, size_t chunk, uint32_t firstRow, uint32_t lastRow) const {
        uint32_t nowhere = 0;
        forEntries(firstOf(chunk), firstOf(chunk) + counts_[chunk], firstRow, lastRow,
                   [places, next, &nowhere](size_t tile, uint32_t at, uint32_t isReached) {
                       uint32_t* const place = isReached != 0u ? places + next[tile] : &nowhere;
                       *place = at;
                       next[tile] += isReached;
                   });
    }

    /// As forTilesOf, but calls use(tile, place of the disc, 1), and of small discs also with 0 for tiles beside
    /// theirs.
    template <typename Use>
    void forEntries(size_t first, size_t last, uint32_t firstRow, uint32_t lastRow, const Use& use) const {
        const auto one = [&use](size_t tile, uint32_t at) { use(tile, at, 1u); };
        if (lastRow - firstRow < rows_) return forTilesOf(first, last, firstRow, lastRow, one);
        const TileRange* const ranges = ranges_.data();
        const size_t columns = columns_;
        for (size_t at = first; at < last; ++at) {
            const TileRange r = ranges[at];
            if (!isSmall(r)) {
                forTilesOf(at, at + 1, firstRow, lastRow, one);
                continue;
            }
            const auto right = static_cast<uint32_t>(r.lastX - r.firstX),
                       below = static_cast<uint32_t>(r.lastY - r.firstY), disc = static_cast<uint32_t>(at);
            const size_t tile = r.firstY * columns + r.firstX;
            use(tile, disc, 1u);
            use(tile + 1, disc, right);
            use(tile + columns, disc, below);
            use(tile + columns + 1, disc, right & below);
        }
    }

    /// Calls use(tile, place of the disc) for each disc of [first, last) and each tile of these rows that it reaches;
    /// tiles are counted from the first of the rows on.
    template <typename Use>
    void forTilesOf(size_t first, size_t last, uint32_t firstRow, uint32_t lastRow, const Use& use) const {
        const TileRange* const ranges = ranges_.data();
        const uint32_t columns = columns_;
        for (size_t at = first; at < last; ++at) {
            const TileRange r = ranges[at];
            const uint32_t y0 = std::max<uint32_t>(r.firstY, firstRow), y1 = std::min<uint32_t>(r.lastY + 1u, lastRow);
            for (uint32_t y = y0; y < y1; ++y) {
                const size_t row = size_t{y - firstRow} * columns;
                for (uint32_t x = r.firstX; x <= r.lastX; ++x) use(row + x, static_cast<uint32_t>(at));
            }
        }
    }

    /// Of a chunk's discs.
    size_t firstOf(size_t chunk) const { return chunk * blocksPerChunk_ * shared::kRecordsPerBlock; }

    /// Rows [firstRow, lastRow) of tiles, of which `sum` is the length of the lists.
    template <typename DrawTile>
    void drawRows(uint32_t firstRow, uint32_t lastRow, uint64_t sum, const DrawTile& drawTile) {
        const size_t tiles = size_t{columns_} * (lastRow - firstRow), chunks = chunks_,
                     pitch = this->pitch(lastRow - firstRow);
        std::vector<uint32_t>& ends = frame_.tileEnds;  // of each chunk and tile: how many, then where they end
        if (!isCounted_ || lastRow - firstRow < rows_) {
            ends.assign(chunks * pitch, 0);
            frame_.executor.parallelFor(chunks, 1, [&](size_t begin, size_t end) {
                for (size_t c = begin; c < end; ++c)
                    countInto(ends.data() + c * pitch, firstOf(c), firstOf(c) + counts_[c], firstRow, lastRow);
            });
        }
        std::vector<uint32_t> starts(tiles + 1, 0);
        for (size_t c = 0; c < chunks; ++c)
            for (size_t t = 0; t < tiles; ++t) starts[t + 1] += ends[c * pitch + t];
        for (size_t t = 0; t < tiles; ++t) starts[t + 1] += starts[t];
        std::vector<uint32_t> next(starts.begin(), starts.end() - 1);
        for (size_t c = 0; c < chunks; ++c)
            for (size_t t = 0; t < tiles; ++t) {
                const uint32_t count = ends[c * pitch + t];
                ends[c * pitch + t] = next[t];
                next[t] += count;
            }
        std::vector<uint32_t>& places = frame_.tilePlaces;
        places.resize(std::max(places.size(), static_cast<size_t>(sum)));
        frame_.executor.parallelFor(chunks, 1, [&](size_t begin, size_t end) {
            for (size_t c = begin; c < end; ++c) putInto(places.data(), ends.data() + c * pitch, c, firstRow, lastRow);
        });
        frame_.executor.parallelFor(tiles, 4, [&](size_t begin, size_t end) {
            for (size_t t = begin; t < end; ++t)
                if (starts[t] != starts[t + 1])
                    drawTile(splats_.data(), places.data() + starts[t], starts[t + 1] - starts[t],
                             tileAt(t + size_t{firstRow} * columns_));
        });
    }

    SplatTile tileAt(size_t tile) const {
        const uint32_t x0 = static_cast<uint32_t>(tile % columns_) * SplatTile::kWidth,
                       y0 = static_cast<uint32_t>(tile / columns_) * SplatTile::kHeight;
        return {x0, y0, std::min(SplatTile::kWidth, frame_.constants.width - x0),
                std::min(SplatTile::kHeight, frame_.constants.height - y0)};
    }

    Frame& frame_;
    const SplatReach reach_;
    std::span<const uint32_t> blocks_;
    uint32_t columns_, rows_, blocksPerChunk_, chunks_;
    std::vector<PlacedSplat>& splats_;  ///< of each chunk, closed up
    std::vector<TileRange>& ranges_;    ///< of each of them
    std::vector<uint32_t> counts_;      ///< of each chunk: discs
    std::vector<uint64_t> entries_;     ///< of each chunk: sum of their tiles
    bool isCounted_ = false;            ///< Frame::tileEnds: how many of each chunk and tile there are
};

}  // namespace stipple::cpu
