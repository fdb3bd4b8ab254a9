// The stages (course.h) of a build whose content is worked on cell by cell (reduction.h). What differs between kinds of
// content, they say of themselves.
#pragma once

#include <memory>
#include <string>

#include "lod/builder/octree/course.h"
#include "lod/builder/octree/reduction.h"

namespace stipple::lod {

/// What a build needs, in bytes.
struct MemoryNeeds {
    std::string content;     ///< in words
    uint64_t fixed = 0;      ///< whatever the content
    uint64_t aWorker = 0;    ///< for the largest cell
    uint64_t tables = 0;     ///< that stay in memory
    uint64_t between = 0;    ///< what waits between the steps
    uint64_t survey = 0;     ///< of the survey, which goes again before there are workers and tables
    uint64_t whole = 0;      ///< of everything, if it is so little that it needs no more
    double readerShare = 0;  ///< of the memory that was asked for: the reader has it, it is no part of the limit
};

class CellContent;

/// Brings content to the subtrees that hold it.
class CellSender {
  public:
    CellSender(Workspace& workspace, CellInputs& inputs, const CellContent& content, Executor& executor,
               Progress& progress, const CellTree& tree, uint64_t bufferBytes, uint64_t blocksSent);
    const std::vector<Subtree>& subtrees() const { return inputs_.subtrees(); }
    /// That may wait for being sent, of all subtrees.
    uint64_t bufferBytes() const { return bufferBytes_; }
    uint32_t subtreeOf(Key key) const { return ofCell_[tree_.cellOf(key)]; }
    bool isOwn(size_t subtree) const { return workspace_.isOwn(subtree); }
    /// For each block of the input: was it sent by an earlier run? Then it is only to be counted.
    bool begins() { return block_++ < blocksSent_; }
    uint64_t blocksSent() const { return blocksSent_; }
    /// See CellInputs.
    Result<void> append(size_t subtree, const std::vector<uint8_t>& bytes, uint64_t units, bool isSpread = false);
    /// After each block. `flush` sends what waits.
    Result<void> ends(uint64_t unitsOfBlock, uint64_t unitsOfAll, const std::function<Result<void>()>& flush);
    uint64_t mostTemporaryBytes() const { return most_; }
    /// Notes what is there; all ranks together.
    Result<void> note(Journal::What what);

  private:
    Result<void> gatherSpread();

    Workspace& workspace_;
    CellInputs& inputs_;
    const CellContent& content_;
    Executor& executor_;
    Progress& progress_;
    const CellTree& tree_;
    uint64_t bufferBytes_;
    std::vector<uint32_t> ofCell_;
    uint64_t block_ = 0, blocksSent_ = 0, done_ = 0, noted_ = 0;
    std::atomic<uint64_t> most_{0};
};

/// A kind of content. Functions are called in the order in which they stand here, but for what an earlier run did.
class CellContent {
  public:
    virtual ~CellContent() = default;
    virtual const char* primitive() const = 0;
    virtual std::string source() const = 0;  ///< in words
    virtual MemoryNeeds memory() const = 0;
    virtual uint64_t inputIdentity() const = 0;
    virtual std::string settingsAsText() const = 0;
    /// Whatever has to be known before reading; `isKnown`: load was called with what an earlier run found.
    virtual Result<void> survey(const Workspace& workspace, Progress& progress, bool isKnown) = 0;
    virtual Frame frame() const = 0;
    /// Lattice coordinates of everything, block by block; from several threads at once.
    using Places = std::function<Result<void>(const Coordinates& places, uint64_t of)>;
    virtual uint64_t declared() const = 0;  ///< about how much places() gives
    virtual Result<void> places(const Places& take) = 0;
    virtual Result<void> check(const std::vector<Subtree>& subtrees) const = 0;
    virtual uint64_t temporaryBytes(int ranks) const = 0;  ///< at most
    virtual Result<void> send(CellSender& to) = 0;
    /// A subtree's input in fewer bytes, and how many units it holds.
    virtual Result<std::vector<uint8_t>> gathered(const std::vector<uint8_t>& input, const Subtree& subtree,
                                                  uint64_t& units) const = 0;
    /// What is known so far, for a resumed build.
    virtual void save(ByteWriter& to) const = 0;
    virtual void load(ByteReader& from) = 0;
    virtual Result<void> complete(const CellInputs& inputs) = 0;  ///< everything was sent
    virtual Result<CellProduct> make(const WorkCell& cell, const std::vector<uint8_t>& input,
                                     const std::vector<FromBelow>& below) const = 0;
    virtual uint64_t take(uint64_t at, const std::vector<uint8_t>& table) = 0;
    /// Writes what the file needs beside chunks of cells, says what there is to say in `report` and `description`.
    virtual Result<Hierarchy> describe(StoreWriter& writer, StoreDescription& description, BuildReport& report) = 0;
};

Result<BuildReport> buildCells(CellContent& content, const std::string& output, const BuildLimits& limits,
                               Executor& executor, Progress& progress);

}  // namespace stipple::lod
