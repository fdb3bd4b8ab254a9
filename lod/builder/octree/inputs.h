// The input of the subtrees of a build (cells.h), each in a place of its own, while it is brought and until it is used.
#pragma once

#include "engine/base/executor.h"
#include "lod/builder/octree/bytes.h"
#include "lod/builder/octree/cells.h"
#include "lod/builder/octree/workspace.h"

namespace stipple::lod {

class CellInputs {
  public:
    explicit CellInputs(const Workspace& workspace) : workspace_(workspace) {}
    void plan(std::vector<Subtree> subtrees);
    const std::vector<Subtree>& subtrees() const { return subtrees_; }

    // While it is brought; each subtree by the rank that owns it, from several threads, but no subtree from two at
    // once:
    /// `units`: of content. `isSpread`: takes more room than it would if it were gathered with the rest of the subtree.
    Result<void> append(size_t subtree, const std::vector<uint8_t>& bytes, uint64_t units, bool isSpread);
    /// Is enough of it spread to be worth gathering?
    bool isSpread(size_t subtree) const;
    Result<std::vector<uint8_t>> all(size_t subtree) const;
    /// Instead of what is there, which on disk stays until dropOld().
    Result<void> replace(size_t subtree, const std::vector<uint8_t>& bytes, uint64_t units);
    void dropOld();

    /// What save() says stays true whatever is appended later.
    Result<void> seal(Executor& executor);
    /// Of this rank's subtrees, after seal.
    void save(ByteWriter& to) const;
    /// Of those of any rank; false if the bytes are not what save wrote.
    bool load(const std::vector<uint8_t>& saved);
    uint64_t units(size_t subtree) const { return inputs_[subtree].units; }
    /// Of all subtrees.
    uint64_t bytes() const;

    // When all of it is there:
    Result<std::vector<uint8_t>> take(size_t subtree) { return inputs_[subtree].spill->take(); }
    /// Returns how many bytes went.
    uint64_t remove(size_t subtree);

  private:
    struct Input {
        std::unique_ptr<Spill> spill;
        uint32_t generation = 0;
        uint64_t units = 0, spreadBytes = 0;
    };
    std::unique_ptr<Spill> spillOf(size_t subtree, uint32_t generation) const;
    const Workspace& workspace_;
    std::vector<Subtree> subtrees_;
    std::vector<Input> inputs_;
    std::vector<std::unique_ptr<Spill>> old_;
};

}  // namespace stipple::lod
