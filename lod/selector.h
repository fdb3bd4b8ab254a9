// The walk behind selectCut, shared by its parts: points and strands (cut.cpp), meshes (cut_mesh.cpp), progressive
// stores and the crowds that they show (cut_progressive.cpp).
#pragma once

#include "lod/cut.h"
#include "lod/cut_view.h"

namespace stipple::lod {

class Selector {
  public:
    Selector(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
             CutScratch& scratch, Cut& cut);
    void run();

  private:
    const Hierarchy& hierarchyOf(size_t i) const { return *hierarchies_[instances_[i].hierarchy]; }
    void findDrivers();
    CutScratch::Slot& slotOf(size_t i);
    int32_t epsilonOf(size_t i, CutScratch::Slot& slot, uint32_t index, int32_t parentEpsilon);
    static double allowedAt(int32_t epsilon, int step);
    static uint32_t codeOf(const CutScratch::Slot& slot, int32_t epsilon, int step);
    static double pixelsOf(const CutScratch::Slot& slot, uint32_t code, int32_t epsilon);

    void emitBest(uint32_t i, int step);
    uint64_t bestCost(uint32_t i, int step, uint64_t most);
    uint64_t cost(int step);
    bool isGoodEnough(uint32_t standIn, int step);
    uint32_t bestOf(uint32_t i, int step);
    int stepForBudget(int target);
    bool hasRoot(uint32_t i);
    void truncate();

    uint64_t pointCost(size_t i, int step, uint64_t most);
    void emitPoints(uint32_t i, int step);

    enum GroupState : uint8_t { kCoarse = 0, kRefined = 1, kUnseen = 2 };
    template <typename OnRefined>
    void refineGroups(size_t i, int step, const OnRefined& onRefined);
    template <typename Use>
    void drawnRuns(const Hierarchy& h, const Use& use) const;
    bool drawsAny(const Hierarchy& h, uint32_t index) const;
    uint64_t meshCost(size_t i, int step);
    void emitMesh(uint32_t instance, int step);
    void wantTiles(uint32_t instance, const LocalView& local, bool isWhole);

    bool isReady(const Crowd& crowd) const;
    void wantRoots();
    void beginEvaluation();
    void activate(const Crowd& crowd, uint32_t index);
    /// What to do with a node of a progressive store.
    struct Progress {
        enum class Kind { unseen, drawn, members, children } kind = Kind::unseen;
        uint32_t count = 0;  ///< drawn: first records
        double pixels = 0;   ///< drawn: error
    };
    Progress progressOf(size_t i, CutScratch::Slot& slot, uint32_t index, int step);
    uint64_t progressiveCost(size_t i, int step, uint64_t most);
    void emitProgressive(uint32_t i, int step);

    std::span<const Hierarchy* const> hierarchies_;
    std::span<const Instance> instances_;
    std::span<const Crowd> crowds_;
    std::vector<bool> isReady_;  ///< of each crowd: can its members be drawn?
    const Residency& residency_;
    const View& view_;
    const Budgets& budgets_;
    CutScratch& scratch_;
    Cut& cut_;
};

}  // namespace stipple::lod
