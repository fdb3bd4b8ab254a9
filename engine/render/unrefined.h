// What needs no detail: nodes of points that are hidden, with all that they stand for, behind what a picture shows.
// Where the budget of records does not do for the error that is asked for, they are not refined (lod::Budgets), and
// what that saves makes the rest finer.
//
//   cut --draw--> picture --> hidden nodes --not refined--> finer cut --draw--> picture --> ...
//
// Every picture tells anew what is hidden, so what was left coarse and is seen is found in that very picture, and is
// refined for good as long as the view stays.
#pragma once

#include <vector>

#include "engine/render/backend.h"
#include "lod/cut/cut.h"

namespace stipple::render {

class Unrefined {
  public:
    /// Of the draws: less is not worth another cut.
    static constexpr double kLeastShare = 0.0625;
    /// So often new nodes are left coarse for one view; after that some are only refined again.
    static constexpr uint32_t kGains = 3;

    /// Sorted: for the next cut.
    const std::vector<lod::PlacedNode>& nodes() const { return nodes_; }
    /// As if nothing had been drawn before.
    void clear();
    /// Another view than that of the last picture: what is seen is looked for anew.
    void beginView(const lod::View& view);

    /// Before a picture: nothing is known of it.
    void forget() { isKnown_ = false; }
    /// What a backend says of `draws`, which it drew.
    void take(const Backend& backend, const DrawList& draws);
    /// After the picture of `cut`: what the next one leaves coarse. `isShort`: the budget does not do for everything.
    /// True if that is not what this one did.
    bool learn(const lod::Cut& cut, bool isShort);
    /// Of the last picture: nodes left coarse that were drawn, and those of them that might be seen.
    uint64_t drawn() const { return drawn_.size(); }
    uint64_t seen() const { return lastSeen_; }

  private:
    std::vector<lod::PlacedNode> nodes_, hidden_, seen_, drawn_;  ///< each sorted
    double newShare_ = 0;  ///< of the records drawn, in hidden nodes that are not left coarse yet
    bool isKnown_ = false, hasView_ = false;
    uint32_t gains_ = 0;
    uint64_t lastSeen_ = 0;
    lod::View view_;
};

/// Sets NodeBounds::error of all nodes of points.
void addErrors(std::span<const lod::Hierarchy* const> hierarchies, std::span<const lod::Instance> instances,
               DrawList& draws);

}  // namespace stipple::render
