// Work from the deepest cells of an octree upwards, in bounded memory. What is worked on at a level: the atoms of that
// level (cells.h), each with its input, and the cells to which work one level deeper has sent something. Each gives
// chunks for the file, something for the tables at its end, and something that goes up. What waits lies in memory or,
// with a journal, on disk, and a killed build goes on after the last finished cell.
//
// The cells of one level are worked on in parallel and handed on in order: the file does not depend on threads.
#pragma once

#include <map>
#include <memory>
#include <optional>

#include "engine/base/spill.h"
#include "lod/build/build.h"
#include "lod/build/octree/cells.h"
#include "lod/build/octree/journal.h"
#include "lod/store.h"

namespace stipple::lod {

struct WorkCell {
    static constexpr uint32_t kNone = ~0u;
    int level = 0;
    uint64_t key = 0;
    uint32_t atom = kNone;  ///< number of the atom that it is
    bool isLast = false;    ///< nothing is left to do but this
};

/// For a cell one level up; `key` is the caller's name for it.
struct GoingUp {
    uint64_t key = 0;
    std::vector<uint8_t> bytes;
};
struct CellProduct {
    std::vector<uint8_t> chunks;  ///< for the file
    std::vector<uint8_t> table;   ///< what the caller wants to know of them at the end
    std::vector<GoingUp> up;
};
/// What was sent to a cell, with the label that the sender got when it was handed on.
struct FromBelow {
    uint64_t label = 0;
    std::vector<uint8_t> bytes;
};

class Reduction {
  public:
    /// `identity`: of input and settings. On disk: finds what an interrupted build of the same left.
    static Result<Reduction> open(const std::string& output, const BuildLimits& limits, uint64_t identity,
                                  bool isOnDisk);

    // The input of the atoms is brought...
    void plan(std::vector<Atom> atoms);
    Spill& input(size_t atom) { return *inputs_[atom]; }
    /// All of it is there; `facts`: what a resumed build has to know.
    Result<void> seal(const std::vector<uint8_t>& facts, Executor& executor);
    // ... or has been, by an earlier run:
    bool isResumed() const { return isResumed_; }
    const std::vector<uint8_t>& facts() const { return facts_; }
    Result<void> restore(Progress& progress);

    /// Any thread; `input` of an atom, `below` of another cell, in the order of those that sent it.
    using Make = std::function<Result<CellProduct>(const WorkCell& cell, const std::vector<uint8_t>& input,
                                                   const std::vector<FromBelow>& below)>;
    /// In order, also for what an earlier run finished: chunks begin at `at` in the file. Returns the cell's label.
    using Take = std::function<uint64_t(uint64_t at, const std::vector<uint8_t>& table)>;
    Result<void> run(Executor& executor, int workers, const Make& make, const Take& take, Progress& progress);

    StoreWriter& writer() { return *writer_; }
    const Journal* journal() const { return journal_ ? &*journal_ : nullptr; }
    Result<void> checkStopped() const;
    /// Bytes on disk, at most.
    uint64_t temporaryBytes() const { return journal_ ? mostTemporary_ : 0; }
    /// The store is complete.
    void finish();

  private:
    Reduction(std::string output, const BuildLimits& limits) : output_(std::move(output)), limits_(limits) {}
    struct Piece {
        uint64_t label = 0, bytes = 0, hash = 0;
    };
    struct Waiting {  ///< for a cell
        std::unique_ptr<Spill> spill;
        std::vector<Piece> pieces;
    };
    struct LevelCells {
        std::vector<WorkCell> cells;
        std::vector<Waiting> waiting;  ///< of each; empty of atoms
    };
    std::unique_ptr<Spill> spill(const std::string& name) const;
    LevelCells takeLevel(int level);
    Result<void> openWriter(Executor& executor);
    Result<std::vector<FromBelow>> readBelow(const Waiting& waiting) const;
    Result<void> runLevel(LevelCells& level, Executor& executor, int workers, const Make& make, const Take& take,
                          Progress& progress);
    Result<void> replay(LevelCells& level, const Take& take);
    Result<void> hand(const WorkCell& cell, Waiting& waiting, CellProduct product, const Take& take);
    void finishCell(const WorkCell& cell, Waiting& waiting);

    std::string output_;
    const BuildLimits limits_;
    std::optional<Journal> journal_;
    bool isResumed_ = false;
    std::vector<uint8_t> facts_;
    std::vector<Atom> atoms_;
    std::vector<std::unique_ptr<Spill>> inputs_;  ///< of atoms
    std::map<uint64_t, Waiting> above_;           ///< for the next level, by key
    std::optional<StoreWriter> writer_;
    size_t replayed_ = 0;  ///< entries of the journal
    uint64_t doneInput_ = 0, allInput_ = 0, temporary_ = 0, mostTemporary_ = 0;
};

}  // namespace stipple::lod
