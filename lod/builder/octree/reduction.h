// Work from the deepest cells of an octree upwards, in bounded memory. What is worked on at a level: the subtrees of
// that level (cells.h), each with its input, and the cells to which work one level deeper has sent something. Each
// gives chunks for the file, something for the tables at its end, and something that goes up. What waits lies in the
// workspace, and a killed build goes on after the last finished cell.
//
// The cells of one level are worked on in parallel, by all ranks, and handed on in order by the first one: the file
// depends neither on threads nor on ranks.
#pragma once

#include <map>
#include <memory>
#include <optional>

#include "lod/builder/octree/inputs.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct WorkCell {
    static constexpr uint32_t kNone = ~0u;
    int level = 0;
    Key key = 0;
    uint32_t subtree = kNone;  ///< number of the subtree that it is
    bool isLast = false;       ///< nothing is left to do but this
};

/// For a cell one level up; `key` is the caller's name for it.
struct GoingUp {
    Key key = 0;
    std::vector<uint8_t> bytes;
};
struct CellProduct {
    std::vector<uint8_t> chunks;  ///< for the file
    std::vector<uint8_t> table;   ///< what the caller wants to know of them at the end
    std::vector<GoingUp> up;
    bool isCutShort = false;  ///< somebody stopped the build meanwhile: this is nothing
};
/// What was sent to a cell, with the label that the sender got when it was handed on.
struct FromBelow {
    uint64_t label = 0;
    std::vector<uint8_t> bytes;
};

class Reduction {
  public:
    /// Of inputs that are complete. `done`: what an earlier run finished.
    Reduction(Workspace& workspace, CellInputs& inputs, std::vector<Journal::Entry> done)
        : workspace_(workspace), inputs_(inputs), done_(std::move(done)) {}

    /// Any thread; `input` of a subtree, `below` of another cell, in the order of those that sent it.
    using Make = std::function<Result<CellProduct>(const WorkCell& cell, const std::vector<uint8_t>& input,
                                                   const std::vector<FromBelow>& below)>;
    /// In order, also for what an earlier run finished: chunks begin at `at` in the file. Returns the cell's label. On
    /// the first rank alone.
    using Take = std::function<uint64_t(uint64_t at, const std::vector<uint8_t>& table)>;
    Result<void> run(Executor& executor, int workers, const Make& make, const Take& take, Progress& progress);

    /// The first rank's.
    StoreWriter& writer() { return *writer_; }
    /// Bytes in the workspace, at most.
    uint64_t mostTemporaryBytes() const { return mostTemporary_; }

  private:
    struct Piece {
        uint64_t label = 0, bytes = 0, hash = 0;
    };
    struct Waiting {  ///< for a cell
        std::unique_ptr<Spill> spill;
        std::vector<Piece> pieces;
    };
    struct LevelCells {
        std::vector<WorkCell> cells;
        std::vector<Waiting> waiting;  ///< of each; empty of subtrees
    };
    LevelCells takeLevel(int level);
    std::unique_ptr<Spill> upSpill(int level, Key key) const;
    Result<void> openWriter(Executor& executor);
    Result<std::vector<FromBelow>> readBelow(const Waiting& waiting) const;
    Result<CellProduct> makeCell(const LevelCells& level, size_t i, const Make& make) const;
    Result<void> runLevel(LevelCells& level, Executor& executor, int workers, const Make& make, const Take& take,
                          Progress& progress);
    Result<void> runTogether(LevelCells& level, size_t first, Executor& executor, int workers, const Make& make,
                             const Take& take, Progress& progress);
    std::string productPath(const LevelCells& level, size_t i) const;
    void tellAbove(int level);
    size_t replay(LevelCells& level, const Take& take);
    Result<void> hand(LevelCells& level, size_t i, CellProduct product, const Take& take, Progress& progress);
    void finishCell(const WorkCell& cell, Waiting& waiting);

    Workspace& workspace_;
    CellInputs& inputs_;
    std::vector<Journal::Entry> done_;
    std::map<Key, Waiting> above_;  ///< for the next level, by key
    std::optional<StoreWriter> writer_;
    size_t replayed_ = 0;  ///< of done_
    uint64_t doneInput_ = 0, allInput_ = 0, temporary_ = 0, mostTemporary_ = 0;
};

}  // namespace stipple::lod
