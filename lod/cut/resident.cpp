#include "lod/cut/resident.h"

#include <algorithm>
#include <utility>

#include "lod/cut/frame.h"
#include "lod/primitives/kinds.h"

namespace stipple::lod {
namespace {

class Planner {
  public:
    Planner(const CutScene& scene, uint64_t residentBytes, ResidentPlan& plan)
        : residentBytes_(residentBytes), plan_(plan) {
        for (const Instance& instance : scene.instances) {
            if (instance.source >= of_.size()) of_.resize(instance.source + 1, nullptr);
            of_[instance.source] = scene.hierarchies[instance.hierarchy];
        }
        plan_.chunks.resize(of_.size());
    }

    /// Everything is resident, or nothing.
    void fill(uint8_t value) {
        for (size_t s = 0; s < of_.size(); ++s) plan_.chunks[s].assign(of_[s] ? of_[s]->chunks() : 0, value);
        plan_.bytes = 0;
    }
    /// The chunks that `cut` keeps, and no others; what they take.
    void keepOnly(const Cut& cut) {
        fill(0);
        for (const auto& [source, chunk] : cut.keep)
            if (!std::exchange(plan_.chunks[source][chunk], uint8_t{1}))
                plan_.bytes += decodedBytes(*of_[source], chunk);
    }
    /// What `cut` wants and no table tells anything of.
    void tellUnknown(const Cut& cut) {
        plan_.unknown.clear();
        for (const CutWanted& w : cut.wanted)
            if (of_[w.source]->isUnknown(w.chunk)) plan_.unknown.emplace_back(w.source, w.chunk);
    }
    bool fits() const { return plan_.bytes <= residentBytes_; }

    void beginRounds(std::span<const std::pair<uint32_t, uint32_t>> barred) {
        fill(0);
        asked_ = plan_.chunks;
        for (const auto& [source, chunk] : barred) asked_[source][chunk] = 1;
    }
    /// Takes in what `cut` misses and what fits; false if that is nothing.
    bool takeIn(const Cut& cut) {
        wanted_.assign(cut.wanted.begin(), cut.wanted.end());
        std::sort(wanted_.begin(), wanted_.end(), isMoreUrgent);
        bool isLean = false, grew = false;
        for (const CutWanted& w : wanted_) {
            if (asked_[w.source][w.chunk] || of_[w.source]->isUnknown(w.chunk) || !hasParents(w)) continue;
            const uint64_t bytes = decodedBytes(*of_[w.source], w.chunk);
            if (plan_.bytes + bytes > residentBytes_ && !isLean) {
                const std::vector<std::vector<uint8_t>> before = plan_.chunks;
                keepOnly(cut);
                for (const CutWanted& taken : wanted_) {  // of this round
                    if (&taken == &w) break;
                    if (before[taken.source][taken.chunk] && !plan_.chunks[taken.source][taken.chunk]) add(taken);
                }
                isLean = true;
            }
            asked_[w.source][w.chunk] = 1;
            if (plan_.bytes + bytes > residentBytes_) continue;
            add(w);
            grew = true;
        }
        return grew;
    }

  private:
    void add(const CutWanted& w) {
        plan_.chunks[w.source][w.chunk] = 1;
        plan_.bytes += decodedBytes(*of_[w.source], w.chunk);
    }
    /// Is there all that the chunk builds on?
    bool hasParents(const CutWanted& w) const {
        bool all = true;
        forEachRequired(*of_[w.source], w.chunk, [&](uint32_t chunk) { all = all && plan_.chunks[w.source][chunk]; });
        return all;
    }

    uint64_t residentBytes_;
    ResidentPlan& plan_;
    std::vector<const Hierarchy*> of_;  ///< by source
    std::vector<std::vector<uint8_t>> asked_;
    std::vector<CutWanted> wanted_;
};

/// Chunks, each once.
uint64_t countOf(std::vector<CutWanted> wanted) {
    const auto byChunk = [](const CutWanted& a, const CutWanted& b) {
        return a.source != b.source ? a.source < b.source : a.chunk < b.chunk;
    };
    std::sort(wanted.begin(), wanted.end(), byChunk);
    uint64_t count = 0;
    for (size_t i = 0; i < wanted.size(); ++i) count += i == 0 || byChunk(wanted[i - 1], wanted[i]) ? 1 : 0;
    return count;
}

}  // namespace

void planResident(const CutScene& scene, uint64_t residentBytes, std::span<const std::pair<uint32_t, uint32_t>> barred,
                  const std::function<const Cut&(const Residency&)>& cutOf, ResidentPlan& plan) {
    Planner planner(scene, residentBytes, plan);
    plan.refused = 0;
    planner.fill(1);
    for (const auto& [source, chunk] : barred) plan.chunks[source][chunk] = 0;
    const Cut& whole = cutOf({plan.chunks});
    planner.tellUnknown(whole);
    planner.keepOnly(whole);
    if (planner.fits()) return;
    planner.beginRounds(barred);
    for (;;) {
        const Cut& cut = cutOf({plan.chunks});
        if (planner.takeIn(cut)) continue;
        plan.refused = countOf(cut.wanted);
        return;
    }
}

void planResident(const CutScene& scene, const View& view, const Budgets& budgets, uint64_t residentBytes,
                  std::span<const std::pair<uint32_t, uint32_t>> barred, CutScratch& scratch, Cut& cut,
                  ResidentPlan& plan) {
    planResident(
        scene, residentBytes, barred,
        [&](const Residency& residency) -> const Cut& {
            selectCut(scene, residency, view, budgets, scratch, cut);
            return cut;
        },
        plan);
}

}  // namespace stipple::lod
